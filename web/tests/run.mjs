// Runs the browser tests, two at a time, and counts: `browser tests: N passed, N failed, N skipped`.
import { spawn } from "node:child_process";
import { cpus } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

const folder = dirname(fileURLToPath(import.meta.url));
/** Side by side; in each lane one after the other. On a computer that is busy already all in one lane. The load average would not do: it is
 * that of the minute before, and then the tests before these were running. */
const SIDE_BY_SIDE = [["lab.mjs", "panels.mjs", "charts.mjs", "opened.mjs", "hand_in.mjs", "words.mjs", "looks.mjs"], ["phones.mjs", "truth.mjs", "phone.mjs", "wall.mjs", "class.mjs"]];
const LANES = await busyShare(3000) < 0.5 ? SIDE_BY_SIDE : [SIDE_BY_SIDE.flat()];
const LONGEST_S = 2100;

const children = new Set();
let passed = 0, failed = 0;
/** Files that failed beside another one: pages in real time may only have been short of processors, so each runs once more, alone. */
const failedInCompany = [];

/** Share of the processors' time that is used by others while this waits for so many milliseconds. */
async function busyShare(milliseconds) {
  const spent = () => cpus().map(({ times }) => [times.idle, Object.values(times).reduce((sum, time) => sum + time, 0)])
    .reduce(([idle, all], [i, a]) => [idle + i, all + a], [0, 0]);
  const [idle, all] = spent();
  await new Promise((done) => setTimeout(done, milliseconds));
  const [idleNow, allNow] = spent();
  return 1 - (idleNow - idle) / Math.max(allNow - all, 1);
}

function run(file, isAlone) {
  return new Promise((done) => {
    const child = spawn(process.execPath, [join(folder, file)], { stdio: ["ignore", "pipe", "inherit"] });
    children.add(child);
    let counted = false, ownPassed = 0, ownFailed = 0;
    createInterface({ input: child.stdout }).on("line", (line) => {
      const count = /^(\d+) passed, (\d+) failed$/.exec(line);
      if (count) {
        counted = true;
        ownPassed = Number(count[1]);
        ownFailed = Number(count[2]);
      } else if (line) console.log(`${file.replace(".mjs", "").padEnd(7)} ${line}`);
    });
    child.once("close", (code, signal) => {
      children.delete(child);
      if (!counted) {
        ownFailed = 1;
        console.log(`${file} ended by ${signal ?? code} before it had counted`);
      } else if (code && !ownFailed) ownFailed = 1;
      if (ownFailed && !isAlone && !lanesEnd) failedInCompany.push(file);
      else {
        passed += ownPassed;
        failed += ownFailed;
      }
      done();
    });
  });
}

/** Ends the children: politely, and after ten seconds for certain. */
function stop(why) {
  console.log(why);
  failed++;
  lanesEnd = true;
  for (const child of children) child.kill("SIGTERM");
  setTimeout(() => { for (const child of children) child.kill("SIGKILL"); }, 10_000).unref();
}

let lanesEnd = false;
for (const signal of ["SIGTERM", "SIGINT", "SIGHUP"]) process.once(signal, () => stop(`ended by ${signal}`));
const limit = setTimeout(() => stop(`the browser tests took more than ${LONGEST_S} s`), LONGEST_S * 1000);
await Promise.all(LANES.map(async (lane) => { for (const file of lane) if (!lanesEnd) await run(file, LANES.length === 1); }));
for (const file of failedInCompany) {
  if (lanesEnd) break;
  console.log(`\n${file} failed while other tests ran; again, alone:`);
  await run(file, true);
}
clearTimeout(limit);
console.log(`\nbrowser tests: ${passed} passed, ${failed} failed, 0 skipped`);
process.exit(failed || !passed ? 1 : 0);
