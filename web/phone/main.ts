// The phone page: one tap, then every reading goes to the lab in batches of 100 ms.

import "./main.css";
import { askPermission, type Channel, meters, type Row, startSensors } from "./sensors";
import { language, setLanguage } from "../words/language";
import { followLanguage } from "../words/program";
import { Mine, sentence, type UnderWay } from "./mine";
import { byId, element, say, t, writeFixed } from "./t";
import { type Command, Uplink } from "./uplink";

const BATCH_MS = 100;
const MOST_ROWS = 400;
const token = new URLSearchParams(location.hash.slice(1)).get("t") ?? "";
const platform = /iPhone|iPad|iPod/.test(navigator.userAgent) || (navigator.platform === "MacIntel" && navigator.maxTouchPoints > 1) ? "ios" : /Android/.test(navigator.userAgent) ? "android" : "other";

/** A random name that is nobody's. */
function randomId(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(9)), (b) => b.toString(36).padStart(2, "0")).join("");
}

/** Storage can be forbidden (private windows): then the value lives as long as the page. */
function kept(key: string, make: () => string): string {
  try {
    const value = localStorage.getItem(key) ?? make();
    localStorage.setItem(key, value);
    return value;
  } catch {
    return make();
  }
}

// The same phone in a new tab is the same device; where two tabs are open, the lab tells them apart.
const device = kept("northing-device", randomId);
const session = randomId();
// Known to this page and the lab alone: who has it steers this phone's part of the lab.
const secret = kept("northing-secret", () => randomId() + randomId());
const nameField = byId<HTMLInputElement>("name");
nameField.value = kept("northing-name", () => (platform === "ios" ? "iPhone" : platform === "android" ? "Android phone" : "Phone"));
nameField.addEventListener("change", () => {
  try {
    localStorage.setItem("northing-name", nameField.value);
  } catch {
    // The name is then asked for again next time.
  }
});

const rows: Record<Channel, Row[]> = { a: [], g: [], m: [], q: [], dm: [], do: [] };
let events: { t_ms: number; kind: string; text: string }[] = [];
let started = false;
let lastBatchMs = 0;

function note(kind: string, text: string): void {
  events.push({ t_ms: performance.now(), kind, text });
}

const SAY_AT_LEAST_MS = 3000;
let saidMs = -SAY_AT_LEAST_MS;

/** Shows what the lab wants of this phone's person; an empty answer ends it after a moment. */
function showSaid(texts: string[], otherwise = t("nothing")): void {
  const now = performance.now();
  if (!texts.length && now - saidMs < SAY_AT_LEAST_MS) return;
  if (texts.length) saidMs = now;
  say(byId("say"), texts.join(" ") || otherwise);
  byId("say").className = texts.length ? "say asks" : "say";
}

/** What the lab says, in this page's language where it has the words. */
function inWords(command: Command): string {
  if (command.under_way) return sentence(command.under_way as UnderWay);
  return command.shared ? t("shared") : (command.say ?? "");
}

const mine = new Mine(token, { device, session, secret });
let wasUnderWay = false;
const uplink = new Uplink(token, (reply) => {
  const isUnderWay = (reply.commands ?? []).some((command) => command.under_way);
  // What has ended is not asked for a moment longer.
  if (wasUnderWay && !isUnderWay) saidMs = -SAY_AT_LEAST_MS;
  wasUnderWay = isUnderWay;
  showSaid((reply.commands ?? []).map(inWords).filter((text) => text));
  mine.is(reply.device);
});

/** Puts what has gathered into a batch; an empty one each second keeps the connection known. */
function flush(): void {
  const count = Object.values(rows).reduce((sum, list) => sum + list.length, 0);
  const now = performance.now();
  if (!started || (!count && !events.length && now - lastBatchMs < 1000)) return uplink.pump();
  lastBatchMs = now;
  const take = (channel: Channel): Row[] => rows[channel].splice(0, MOST_ROWS);
  const said = events;
  events = [];
  const body = { dm: take("dm"), gs: { a: take("a"), g: take("g"), m: take("m"), q: take("q") }, do: take("do"), events: said };
  uplink.add((seq) => ({ v: 1, device, name: nameField.value.trim() || "Phone", session, seq, ua: navigator.userAgent, platform, sent_ms: now, ...body }));
}

async function stayAwake(): Promise<void> {
  try {
    await navigator.wakeLock?.request("screen");
  } catch {
    note("wake-lock", "refused: the screen may switch off");
  }
}

async function start(): Promise<void> {
  const button = byId<HTMLButtonElement>("go");
  button.disabled = true;
  const refused = await askPermission();
  note("permission", refused.length ? refused.join("; ") : "granted");
  if (refused.length) {
    show("bad", t("refused"), t("refused.detail", { why: refused.join("; ") }));
    button.disabled = false;
    return;
  }
  started = true;
  button.hidden = true;
  byId("say").hidden = false;
  showSaid([]);
  startSensors((channel, row) => rows[channel].push(row), (text) => note("sensor", text));
  uplink.trySocket();
  void stayAwake();
}

function show(tone: string, text: string, detail: string): void {
  const state = byId("state");
  state.dataset["tone"] = tone;
  say(state, text);
  say(byId("detail"), detail);
}

function showState(): void {
  if (!started) return;
  const link = uplink.state;
  const slow = meters.g.count > 0 && meters.g.rateHz > 0 && meters.g.rateHz < 20;
  byId("say").hidden = link.tone === "bad";
  if (link.tone === "bad") show("bad", t("notConnected"), link.text + ".");
  else if (document.visibilityState === "hidden") show("warn", t("paused"), t("paused.detail"));
  else if (link.tone === "warn") {
    show("warn", t(link.waiting > 20 ? "notReached" : "connecting"), `${link.text}.`);
    if (link.waiting > 20) showSaid([], t("kept"));
  }
  else if (!meters.a.count && !meters.g.count) show("warn", t("noReadings"), t("noReadings.detail"));
  else show(slow ? "warn" : "good", t(slow ? "slowly" : "sending"), t(slow ? "slowly.detail" : "sending.detail"));
}

/** Browsers round to 0.1: whoever looks at the numbers should know. */
function showMode(): void {
  const coarse = (m: { step: number; count: number }): boolean => m.count > 20 && m.step > 0.05;
  say(byId("foot"), t(coarse(meters.a) || coarse(meters.g) ? "coarse" : "exact"));
}

/** Steps of a converter or of the browser's rounding, in words. */
function stepText(step: number, unit: string): string {
  return step > 0 && step < 100 ? ` · ${t("steps", { step: `${step < 0.001 ? step.toExponential(0) : step.toPrecision(1)} ${unit}` })}` : "";
}

function showSensors(): void {
  byId("sensors").replaceChildren(
    ...Object.entries(meters).map(([key, m]) => {
      const line = element("li", "", m.tone);
      line.append(element("b", t(key as keyof typeof meters)), element("i", m.count && m.rateHz >= 0 ? `${m.rateHz.toFixed(0)} Hz` : "–"), element("span", m.text() + stepText(m.step, m.unit)));
      return line;
    }),
  );
  const link = uplink.state;
  const facts: [string, string][] = [[t("batches"), String(link.acknowledged)], [t("waiting"), String(link.waiting)], [link.by, link.roundTripMs ? `${link.roundTripMs.toFixed(0)} ms` : "–"]];
  if (link.dropped) facts.push([t("givenUp"), String(link.dropped)]);
  byId("link").replaceChildren(
    ...facts.map(([term, value]) => {
      const group = element("div", "");
      group.append(element("dt", term), element("dd", value));
      return group;
    }),
  );
}

document.addEventListener("visibilitychange", () => {
  if (!started) return;
  note(document.visibilityState, document.visibilityState === "hidden" ? "page hidden: no sensors" : "page visible again");
  flush();
  if (document.visibilityState === "visible") void stayAwake();
});

/** Everything that does not come again by itself. */
function write(): void {
  writeFixed();
  if (!started) show(token ? "idle" : "bad", t(token ? "ready" : "noCode"), t(token ? "ready.detail" : "noCode.detail"));
  showSaid([]);
  showMode();
  showSensors();
  mine.show();
}

// What the program itself says, in Spanish: a file of its own, for who reads Spanish.
followLanguage(async () => (await fetch("/assets/program.json")).json(), write);
byId("language").addEventListener("click", () => {
  setLanguage(language() === "en" ? "es" : "en");
  write();
});
write();
if (token) {
  byId("go").addEventListener("click", () => void start());
  window.setInterval(flush, BATCH_MS);
  window.setInterval(() => (showState(), showSensors(), showMode()), 500);
} else byId<HTMLButtonElement>("go").disabled = true;
