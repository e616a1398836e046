// The program itself: `northing live` on free ports with a data folder of its own.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { atTheEnd, web } from "./browser.mjs";

/**
 * Starts the program and waits for its first line. Pages come from `web/dist`, which may be newer than the program.
 * `data`: the folder of a lab before, `more`: further options.
 */
export async function startLab({ port: wanted = 0, data, more = [] } = {}) {
  const folder = data ?? mkdtempSync(join(tmpdir(), "northing-lab-"));
  const [command, ...before] = process.env.NORTHING ? [process.env.NORTHING] : ["cargo", "run", "-q", "-p", "northing", "--"];
  const child = spawn(command, [...before, "live", "--port", String(wanted), "--no-open", "--json", "--data-dir", folder, "--web-dir", join(web, "dist"), ...more], { cwd: dirname(web), stdio: ["ignore", "pipe", "inherit"] });
  const gone = new Promise((done) => child.once("exit", done));
  // However this process ends.
  process.once("exit", () => child.kill("SIGKILL"));
  atTheEnd(async () => {
    child.kill("SIGCONT");
    child.kill("SIGTERM");
    const late = setTimeout(() => child.kill("SIGKILL"), 4000);
    await gone;
    clearTimeout(late);
    rmSync(folder, { recursive: true, force: true });
  });
  const events = [];
  const ready = await new Promise((done, fail) => {
    createInterface({ input: child.stdout }).on("line", (line) => {
      const event = JSON.parse(line);
      if (event.event === "ready") done(event);
      if (!["devices"].includes(event.event)) events.push(event);
    });
    child.once("exit", (code) => fail(new Error(`the program ended with ${code}`)));
    child.once("error", fail);
  });
  const port = Number(new URL(ready.lab).port);
  const status = async () => (await fetch(new URL("/api/status", ready.lab))).json();
  return {
    ready, port, folder, events, status,
    token: ready.token,
    // The certificate names this address too; the first one on the list may be another network's.
    phoneUrl: (token = ready.token) => `https://127.0.0.1:${port + 1}/p#t=${token}`,
    device: async (name) => (await status()).devices.find((d) => d.name === name),
    /** As if the network or the program stood still, and on again. */
    freeze: () => child.kill("SIGSTOP"),
    thaw: () => child.kill("SIGCONT"),
    /** Ends the program as a crash does. */
    kill: async () => {
      child.kill("SIGKILL");
      await gone;
    },
  };
}
