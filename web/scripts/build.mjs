// Bundles the pages: dist/lab, dist/phone, dist/join and the script of reports in dist/report (with --dev: dist-dev/lab, fed by a synthetic device).
import { build } from "esbuild";
import { copyFile, mkdir, readdir, readFile, rm, stat, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const dev = process.argv.includes("--dev");
const out = join(root, dev ? "dist-dev" : "dist");

const common = {
  bundle: true,
  minify: !dev,
  sourcemap: dev ? "inline" : false,
  charset: "utf8",
  legalComments: "eof",
  jsx: "automatic",
  jsxImportSource: "preact",
  logLevel: "warning",
};

/** Text files travel compressed; each lies beside the plain one. */
async function compress(folder) {
  for (const file of await readdir(folder)) {
    if (!/\.(js|css|html|svg|json)$/.test(file)) continue;
    const path = join(folder, file);
    if (!dev) await writeFile(`${path}.gz`, gzipSync(await readFile(path), { level: 9 }));
    const packed = dev ? "" : `, ${((await stat(`${path}.gz`)).size / 1000).toFixed(1)} kB compressed`;
    console.log(`${path.slice(out.length + 1)}: ${((await stat(path)).size / 1000).toFixed(1)} kB${packed}`);
  }
}

async function page(name, entry, settings, files = ["index.html", "icon.svg"]) {
  const folder = join(out, name);
  await mkdir(folder, { recursive: true });
  await build({ ...common, ...settings, entryPoints: { [name]: join(root, entry) }, outdir: folder });
  for (const file of files) await copyFile(join(root, name, file), join(folder, file));
  await compress(folder);
}

/** The program's sentences in every language, without the spaces of the source. */
async function writeWords(name) {
  await mkdir(join(out, name), { recursive: true });
  await writeFile(join(out, name, "program.json"), JSON.stringify(JSON.parse(await readFile(join(root, "words/program.json"), "utf8"))));
}

await rm(out, { recursive: true, force: true });
// The lab page runs in browsers of today, and loads its 3-D view after itself; phones may be years old; reports are one file.
await page("lab", dev ? "dev/lab.ts" : "lab/main.tsx", { format: "esm", splitting: true, chunkNames: "[name]-[hash]", target: "es2020" });
await page("join", "join/main.ts", { format: "iife", target: "es2019" });
// What the program says is another file there: the page is read in English, too.
await writeWords("phone");
await page("phone", "phone/main.ts", { format: "iife", target: "es2019" });
if (!dev) await page("report", "report/main.ts", { format: "iife", target: "es2020" }, []);
