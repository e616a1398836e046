// Bundles the pages: dist/lab and dist/phone (with --dev: dist-dev/lab, fed by a synthetic device).
import { build } from "esbuild";
import { copyFile, mkdir, rm, stat } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const dev = process.argv.includes("--dev");
const out = join(root, dev ? "dist-dev" : "dist");

const common = {
  bundle: true,
  minify: !dev,
  sourcemap: dev ? "inline" : false,
  format: "iife",
  charset: "utf8",
  legalComments: "eof",
  jsx: "automatic",
  jsxImportSource: "preact",
  logLevel: "warning",
};

// The lab page runs on the laptop that runs the program; phones may be years old.
const TARGETS = { lab: "es2020", phone: "es2019" };

async function page(name, entry) {
  const folder = join(out, name);
  await mkdir(folder, { recursive: true });
  await build({ ...common, target: TARGETS[name], entryPoints: { [name]: join(root, entry) }, outdir: folder });
  for (const file of ["index.html", "icon.svg"]) await copyFile(join(root, name, file), join(folder, file));
  for (const file of ["index.html", "icon.svg", `${name}.js`, `${name}.css`]) {
    const { size } = await stat(join(folder, file));
    console.log(`${name}/${file}: ${(size / 1000).toFixed(1)} kB`);
  }
}

await rm(out, { recursive: true, force: true });
await page("lab", dev ? "dev/lab.ts" : "lab/main.tsx");
await page("phone", "phone/main.ts");
