// The wall: all phones of a class in the order of their names, each with lamps, state and attitude; orders to all, and the results board.

import { useEffect, useRef } from "preact/hooks";
import { mainEstimate } from "../history";
import { endedEarly, judged } from "../judged";
import { LiveText, useFrame } from "../live";
import type { Device, Frame, Lamp } from "../protocol";
import type { View as ViewOf, World } from "../scene";
import { attitudes, partsOf } from "../stage";
import { historyOf, onFrame, rowsOf, select, state, titleOf, update } from "../store";
import { t } from "../t";
import { degrees, said, VERDICTS } from "../words";
import { Board } from "./board";
import { Orders } from "./orders";
import { type Motion, motionOf } from "./stillness";

export function Wall() {
  const grid = useRef<HTMLDivElement>(null);
  // About as many columns as make boxes that are a little wider than high.
  const columns = Math.max(1, Math.ceil(Math.sqrt(state.devices.length * 1.35)));
  return (
    <section class="wall" aria-label={t("wall")}>
      <Orders />
      <div class="wall-body">
        <Boxes grid={grid} />
        <div class="grid" ref={grid} style={{ "--columns": String(columns) }}>
          {state.devices.map((device) => <Cell key={device.id} device={device} />)}
          {!state.devices.length && <p class="empty">{t("wall.none")}</p>}
        </div>
        <Board />
      </div>
    </section>
  );
}

function Cell({ device }: { device: Device }) {
  const name = <button type="button" class="pick" onClick={() => update((s) => { select(s, device.id); s.view = "lab"; })}><b>{device.name}</b></button>;
  return (
    <article class={`cell ${device.delivers ? "" : "bad"}`} data-device={device.id} aria-label={device.name}>
      {name}
      <State device={device} />
      <div class="cell-body">
        <div>
          <dl class="cell-angles">
            {partsOf("yaw-pitch-roll").map(({ name, role }, i) => (
              <div key={name} style={{ "--role": `var(--${role})` }}><dt>{name}</dt><dd><LiveText device={device.id} text={(f) => angle(f, i)} /></dd></div>
            ))}
          </dl>
          <WallLamps device={device} />
        </div>
        <div class="box" data-cell={device.id} />
      </div>
    </article>
  );
}

const angle = (frame: Frame, i: number): string => {
  const v = mainEstimate(frame)?.angles_deg[i];
  return v === undefined ? "–" : `${v.toFixed(0)}°`.replace("-", "−").replace("−0°", "0°");
};

/** Whether the noise of each sensor is consistent, in as little room as three letters take. */
function WallLamps({ device }: { device: Device }) {
  const lamps = useFrame<Lamp[]>(device.id, (frame) => frame.lamp, 1, []);
  return (
    <ul class="cell-lamps" aria-label={t("lamps")}>
      {lamps.map((lamp) => {
        const tone = device.delivers ? lamp.tone : "idle";
        const text = `${titleOf(lamp.sensor)}: ${device.delivers ? said(lamp.text) : t("lamp.nothingReceived")}`;
        return (
          <li key={lamp.sensor} class={`lamp ${tone}`} data-lamp={lamp.sensor} title={text}>
            <span class="light" aria-hidden="true" /><span aria-hidden="true">{titleOf(lamp.sensor).slice(0, 3)}</span><span class="spoken">{text}</span>
          </li>
        );
      })}
    </ul>
  );
}

/** How long something lasts or is over, for people. */
export function span(seconds: number): string {
  const whole = Math.max(0, Math.round(seconds));
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}

interface Said {
  what: "lost" | "silent" | "ended" | "calibrates" | "refused" | "experiment" | "done" | "rests" | "steady" | "moves" | "waits";
  tone: string;
  text: string;
  hint?: string;
}

/** What a device does: what is wrong first, then what is under way, then what came out. */
function stateOf(device: Device, motion: Motion | null): Said {
  if (device.silent_s !== null && device.silent_s !== undefined && !device.delivers) return silent(device, device.silent_s);
  const calibration = state.calibrations[device.id], experiment = state.running[device.id];
  const left = device.under_way?.remaining_s ?? 0;
  if (device.is_calibrating) {
    const seconds = Math.ceil(calibration?.state === "running" ? calibration.remaining_s : left);
    return { what: "calibrates", tone: "info", text: t("wall.calibrates", { seconds }) };
  }
  if (device.is_experimenting) return { what: "experiment", tone: "info", text: t("wall.experiment", { seconds: Math.ceil(experiment?.remaining_s ?? left) }) };
  if (calibration?.state === "refused") return { what: "refused", tone: "bad", text: t("wall.refused"), hint: said(calibration.verdict?.text ?? "") };
  const row = rowsOf(device.id).filter((r) => !r.is_archived && !r.is_earlier).at(-1);
  if (row) {
    const result = row.results[row.subject], verdict = result?.verdict ? VERDICTS[result.verdict] : undefined;
    const text = t(verdict ? verdict.text : "wall.noVerdict"), of = judged(result), early = endedEarly(row);
    const error = `${row.name}: ${degrees(of.calculated)}${of.isTilt ? ` ${t("tilt")}` : ""}`;
    return { what: "done", tone: verdict?.tone ?? "idle", text: t("wall.done", { verdict: text }), hint: early ? `${error}; ${early}` : error };
  }
  const calibrated = device.is_calibrated ? t("wall.calibrated") : t("wall.uncalibrated");
  if (!motion || motion.is === "waiting") return { what: "waits", tone: "idle", text: t("still.waiting"), ...(motion ? { hint: calibrated } : {}) };
  if (motion.is === "rest") return { what: "rests", tone: "good", text: t("still.rest"), hint: calibrated };
  return motion.is === "constant" ? { what: "steady", tone: "info", text: t("still.constant"), hint: calibrated } : { what: "moves", tone: "warn", text: t("still.moving"), hint: calibrated };
}

function silent(device: Device, seconds: number): Said {
  const since = span(seconds);
  if (device.source === "replay") return { what: "ended", tone: "idle", text: t("wall.ended") };
  return device.connected ? { what: "silent", tone: "bad", text: t("wall.silent", { since }), hint: said(device.silence) } : { what: "lost", tone: "bad", text: t("wall.lost", { since }), hint: said(device.silence) };
}

/** What to do about these is the same for each: it stands in their titles. */
const QUIET: Said["what"][] = ["lost", "silent"];

function State({ device }: { device: Device }) {
  const motion = useFrame<Motion | null>(device.id, (frame) => motionOf(frame, device.rest), 2, null);
  const told = stateOf(device, motion);
  return <p class={`cell-state ${told.tone}`} data-state={told.what} title={told.hint}><b>{told.text}</b> {told.hint && !QUIET.includes(told.what) && <small>{told.hint}</small>}</p>;
}

/** The attitudes in 3-D: one canvas behind all boxes. */
function Boxes({ grid }: { grid: { readonly current: HTMLDivElement | null } }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const worlds = new Map<string, World>();
    let stop = (): void => undefined, gone = false;
    void import("../scene").then(({ View, World }) => {
      if (gone) return;
      const worldOf = (id: string): World => {
        let world = worlds.get(id);
        if (!world) {
          worlds.set(id, (world = new World()));
          const latest = historyOf(id).latest;
          if (latest) world.set(attitudes(latest).filter((b) => b.solid));
        }
        return world;
      };
      const cells = (): { world: World; box: DOMRect }[] => {
        const elements = [...grid.current!.querySelectorAll<HTMLElement>("[data-cell]")];
        for (const [id, world] of worlds) {
          if (elements.some((element) => element.dataset["cell"] === id)) continue;
          world.dispose();
          worlds.delete(id);
        }
        return elements.map((element) => ({ world: worldOf(element.dataset["cell"]!), box: element.getBoundingClientRect() }));
      };
      const view: ViewOf<World> = new View<World>(canvas.current!, null, cells);
      const follow = onFrame((frame) => {
        if (document.visibilityState === "hidden" || !worlds.has(frame.device)) return view.ask();
        worldOf(frame.device).set(attitudes(frame).filter((b) => b.solid));
        view.ask();
      });
      // The page scrolls where it is narrow, the wall where it is wide.
      const scrolled = (): void => view.ask();
      window.addEventListener("scroll", scrolled, { capture: true, passive: true });
      const moved = new ResizeObserver(scrolled);
      moved.observe(grid.current!);
      view.ask();
      stop = () => {
        follow();
        moved.disconnect();
        window.removeEventListener("scroll", scrolled, { capture: true });
        view.close();
      };
    }).catch(() => undefined);
    return () => {
      gone = true;
      stop();
      for (const world of worlds.values()) world.dispose();
    };
  }, []);
  return <canvas class="wall-canvas" ref={canvas} aria-hidden="true" />;
}
