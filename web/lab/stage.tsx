// The stage: the 3-D view with its legend, the angles in large type, a second device beside the first.

import { useEffect, useRef, useState } from "preact/hooks";
import { GIMBAL_LOCK_DEG, NOTATIONS, type Notation, angleBetween, middleAngle, tiltAndHeading, written } from "./attitude";
import { mainEstimate, mainName } from "./history";
import { LiveText, useFrame } from "./live";
import { followShown, spanOf } from "./moments";
import type { Device, EstimatorKind, Frame } from "./protocol";
import type { Body, View as ViewOf, World } from "./scene";
import { historyOf, onFrame, send, state, update } from "./store";
import { type Key, t } from "./t";
import { nameOf, roleOf } from "./theme";
import { number } from "./words";

/** Every attitude of a frame, the subject's first. */
export function attitudes(frame: Frame): Body[] {
  const main = mainName(frame);
  const names = Object.keys(frame.estimates).sort((a, b) => Number(b === main) - Number(a === main));
  const bodies: Body[] = names.map((name) => ({ name, solid: name === main, q: frame.estimates[name]!.q }));
  if (frame.truth) bodies.push({ name: "truth", solid: false, q: frame.truth.q });
  return bodies;
}

/** The subject of the second device, where one is chosen. */
function besideBody(device: string): Body | null {
  if (!state.beside || state.beside === device) return null;
  const frame = historyOf(state.beside).latest, estimate = frame && mainEstimate(frame);
  return estimate ? { name: mainName(frame!)!, solid: true, q: estimate.q, second: true } : null;
}

/** The 3-D view with its legend: switch ghosts, read the angle to each. */
export function Device3d({ device }: { device: string | null }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [failed, setFailed] = useState(false);
  const [past, setPast] = useState<number | null>(null);
  useEffect(() => {
    let view: ViewOf<World> | null = null, gone = false;
    let stop = (): void => undefined;
    // The 3-D library is large: the page is there before it.
    void import("./scene").then(({ View, World }) => {
      if (gone) return;
      view = new View(canvas.current!, new World());
      let shown: Frame | null = null;
      const draw = (): void => {
        if (!shown || document.visibilityState === "hidden") return;
        const beside = device ? besideBody(device) : null;
        view!.world!.set([...attitudes(shown).filter((b) => !state.hidden.has(b.name)), ...(beside ? [beside] : [])]);
        view!.ask();
      };
      view.ask();
      if (!device) return;
      const ends = [
        followShown(device, (frame, isPast) => {
          shown = frame;
          setPast(isPast ? frame.t_s : null);
          draw();
        }),
        onFrame((frame) => frame.device === state.beside && draw()),
      ];
      stop = () => ends.forEach((end) => end());
    }).catch(() => setFailed(true));
    return () => {
      gone = true;
      stop();
      view?.close();
    };
  }, [device]);
  return (
    <div class="view3d">
      <canvas ref={canvas} tabIndex={0} role="img" aria-label={t("stage.canvas")} />
      {failed && <p class="empty">{t("stage.noWebgl")}</p>}
      {device && <Legend device={device} />}
      {device && past !== null && (
        <p class="past"><b>{past.toFixed(1)} s</b> <button type="button" onClick={() => spanOf(device).follow()}>{t("stage.live")}</button></p>
      )}
    </div>
  );
}

/** Chooses the estimator that lamps, innovations, NIS, result and report are about. */
function Subject({ device }: { device: Device }) {
  return (
    <label class="subject" title={t("subject.hint")}>{t("subject")}
      <select value={device.subject ?? ""} onChange={(e) => send({ type: "subject", device: device.id, estimator: e.currentTarget.value as EstimatorKind })}>
        {device.subject === null && <option value="">{t("none")}</option>}
        {device.estimators.map((name) => <option key={name} value={name}>{nameOf(name)}</option>)}
      </select>
    </label>
  );
}

/** A second device in the same scene: taped together, two phones check each other without a truth. */
function Beside({ device }: { device: string }) {
  const others = state.devices.filter((d) => d.id !== device);
  if (!others.length) return null;
  const shown = others.some((d) => d.id === state.beside) ? state.beside! : "";
  return (
    <div class="beside">
      <label class="subject">{t("beside")}
        <select value={shown} onChange={(e) => update((s) => (s.beside = e.currentTarget.value || null))}>
          <option value="">{t("none")}</option>
          {others.map((d) => <option key={d.id} value={d.id}>{d.name}</option>)}
        </select>
      </label>
      {shown && <LiveText device={device} text={(frame) => betweenDevices(frame, shown)} />}
    </div>
  );
}

/** The angle between the subjects of two devices, and how much of it is tilt and heading. */
function betweenDevices(frame: Frame, other: string): string {
  const own = mainEstimate(frame)?.q, second = historyOf(other).latest, their = second && mainEstimate(second)?.q;
  if (!own || !their) return "–";
  const [tilt, heading] = tiltAndHeading(own, their);
  return t("beside.angle", { angle: number(angleBetween(own, their), 1), tilt: number(tilt, 1), heading: number(heading, 1) });
}

function Legend({ device }: { device: string }) {
  const names = useFrame(device, (frame) => attitudes(frame).map((b) => b.name).join(" "), 1, "");
  const list = names ? names.split(" ") : [];
  const row = state.devices.find((d) => d.id === device);
  const subject = row?.subject;
  const toggle = (name: string): void => update((s) => void (s.hidden.has(name) ? s.hidden.delete(name) : s.hidden.add(name)));
  return (
    <div class="ghosts">
      {row && <Subject device={row} />}
      <div class="scroll">
        <table>
          <thead><tr><th scope="col">{t("attitude")}</th><th scope="col" class="num">{subject ? t("to", { name: nameOf(subject) }) : ""}</th></tr></thead>
          <tbody>
            {list.map((name) => (
              <tr key={name}>
                <th scope="row">
                  <label>
                    <input type="checkbox" checked={!state.hidden.has(name)} onChange={() => toggle(name)} />
                    <span class={`swatch ${name === subject ? "" : "ghost"}`} style={{ "--role": `var(--${roleOf(name)})` }} />
                    {nameOf(name)}
                  </label>
                </th>
                <td class="num">{name === subject ? "" : <LiveText device={device} text={(frame) => angleTo(frame, name)} />}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <Beside device={device} />
    </div>
  );
}

/** Angle from the main estimate to another attitude, as text. */
function angleTo(frame: Frame, name: string): string {
  const main = mainName(frame);
  const known = frame.between_deg[`${main}|${name}`] ?? frame.between_deg[`${name}|${main}`];
  const other = name === "truth" ? frame.truth?.q : frame.estimates[name]?.q;
  const own = mainEstimate(frame)?.q;
  const angle = known ?? (other && own ? angleBetween(own, other) : undefined);
  return angle === undefined ? "–" : `${angle.toFixed(2)}°`;
}

const PARTS: Record<Notation, { name: string; role: string }[]> = {
  "yaw-pitch-roll": [{ name: "yaw", role: "z" }, { name: "pitch", role: "y" }, { name: "roll", role: "x" }],
  "alpha-beta-gamma": [{ name: "alpha", role: "z" }, { name: "beta", role: "x" }, { name: "gamma", role: "y" }],
  quaternion: [{ name: "w", role: "ink" }, { name: "x", role: "x" }, { name: "y", role: "y" }, { name: "z", role: "z" }],
  "rotation-vector": [{ name: "x", role: "x" }, { name: "y", role: "y" }, { name: "z", role: "z" }],
};

/** What the numbers of a notation are called, and the axis that each turns about. */
export const partsOf = (notation: Notation): { name: string; role: string }[] =>
  PARTS[notation].map(({ name, role }) => ({ name: name.length > 1 ? t(`angle.${name}` as Key) : name, role }));

/** The attitude in numbers with 3 sigma, in large type, in the notation that is chosen; gimbal lock is said. */
export function Angles({ device }: { device: string }) {
  const notation = state.notation;
  const parts = partsOf(notation);
  return (
    <div class="angles">
      <select class="notation" aria-label={t("notation")} value={notation} onChange={(e) => update((s) => (s.notation = e.currentTarget.value as Notation))}>
        {NOTATIONS.map((n) => <option key={n} value={n}>{t(`notation.${n}`)}</option>)}
      </select>
      <dl>
        {parts.map(({ name, role }, i) => (
          <div key={`${notation} ${name}`} style={{ "--role": `var(--${role})` }}>
            <dt>{name}</dt>
            <dd>
              <LiveText device={device} text={(f) => part(f, notation, i)} />
              <LiveText device={device} className="sigma" text={(f) => (notation === "yaw-pitch-roll" ? threeSigma(mainEstimate(f)?.std_deg?.[i]) : "")} />
            </dd>
          </div>
        ))}
      </dl>
      <LiveText device={device} className="lock" text={(f) => gimbalLock(f, notation)} />
    </div>
  );
}

function part(frame: Frame, notation: Notation, i: number): string {
  const q = mainEstimate(frame)?.q;
  if (!q) return "–";
  const v = written(q, notation)[i]!;
  return notation === "quaternion" ? signed(v, 4, "") : signed(v, 1, "°");
}

const signed = (v: number, digits: number, unit: string): string => {
  const size = Math.abs(v).toFixed(digits);
  return `${v < 0 && Number(size) !== 0 ? "−" : "\u2007"}${size}${unit}`;
};
const threeSigma = (v: number | undefined): string => (v === undefined ? "" : `±${(3 * v).toFixed(3 * v < 10 ? 2 : 0)}°`);

/** Near ±90° of the middle angle the other two turn about one axis: only their sum or difference means something. */
function gimbalLock(frame: Frame, notation: Notation): string {
  const q = mainEstimate(frame)?.q, middle = q ? middleAngle(q, notation) : null;
  if (middle === null || Math.abs(middle) < GIMBAL_LOCK_DEG) return "";
  const names = partsOf(notation).map((p) => p.name);
  return t("gimbalLock", { middle: names[1]!, angle: number(middle, 1), first: names[0]!, third: names[2]! });
}
