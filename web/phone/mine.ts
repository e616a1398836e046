// The student's part of the phone page: attitude, lamps, calibration, Q and R, experiment and result of this phone.
// Plain requests: Safari refuses WebSockets on a self-made certificate.

import { inLanguage } from "../words/program";
import { byId, element, has, type Key, say, t } from "./t";

type Triple = [number, number, number];

/** What the lab says of this phone: `GET /api/mine`. */
interface State {
  device: string;
  delivers: boolean;
  silence: string;
  subject: string | null;
  angles_deg: Triple | null;
  std_deg: Triple | null;
  lamps: { sensor: string; tone: string; nis_mean: number | null; nis_expected: number | null }[];
  under_way: UnderWay | null;
  calibration: { tone: string; text: string } | null;
  gave_up: string | null;
  rest: Rest | null;
  profile: string;
  experiments: number;
  result: Result | null;
}
export interface UnderWay {
  what: "calibration" | "experiment";
  remaining_s: number;
}
interface Rest {
  gyroscope_bias_rad_s: Triple;
  gyroscope_std_rad_s: Triple;
  accelerometer_std_m_s2: Triple | null;
  magnetometer_std_ut: Triple | null;
}
interface Result {
  id: string;
  name: string;
  calculated_error_deg: number | null;
  estimated_error_deg: number | null;
  /** With two degrees of freedom the tilt alone is judged. */
  degrees_of_freedom?: number | null;
  calculated_tilt_deg?: number | null;
  estimated_tilt_deg?: number | null;
  verdict: string | null;
  integration_deg: number | null;
  device_deg: number | null;
  integration_tilt_deg?: number | null;
  device_tilt_deg?: number | null;
  duration_s: number;
  /** How long it was meant to be. */
  asked_s?: number | null;
  has_samples: boolean;
}

const POLL_MS = 250;
/** So long a request waits for a lab that does not hear this phone: a page that comes back has batches to send first. */
const NOT_HEARD_MS = 20_000;
/** A lab, or a phone, that has much to do is asked less often: for a third of the time, but no less than a hidden page asks. */
const PAUSES = 2;
const HIDDEN_POLL_MS = 2000;
const AGAIN_MS = 1000;
const REFUSED_MS = 10_000;
/** From here on the phone goes back where it lay. */
const GO_BACK_S = 8;
/** A result that does not come after so long is not waited for. */
const LONGEST_WAIT_MS = 30_000;

/** Shorter than asked by less than this is the last sample before the end. */
const EARLY_S = 0.5;

/** What is under way, in a sentence. */
export function sentence(under: UnderWay): string {
  const seconds = Math.ceil(under.remaining_s);
  return t(under.what === "calibration" ? "hold" : under.remaining_s > GO_BACK_S ? "move" : "back", { seconds });
}

/** A number as it is written: no sign before zero. */
function digits(v: number, n: number): string {
  const text = v.toFixed(n);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}
const degrees = (v: number | null): string => (v === null ? "–" : `${digits(v, 2)}°`);

export class Mine {
  /** The device that this page is, as the lab calls it. */
  private device = "";
  private joined = false;
  private joining = false;
  private notBefore = 0;
  private state: State | null = null;
  /** When an experiment ended whose result has not come yet. */
  private endedMs = 0;
  private busy = false;

  constructor(private readonly token: string, private readonly page: { device: string; session: string; secret: string }) {
    byId("calibrate").addEventListener("click", () => void this.ask({ type: "calibrate", seconds: 10 }));
    for (const b of this.profiles()) b.addEventListener("click", () => void this.ask({ type: "settings", profile: b.dataset["profile"] }));
    byId("run").addEventListener("click", () => void this.ask({ type: "experiment", seconds: Number(byId<HTMLSelectElement>("seconds").value), name: t("run.name", { number: (this.state?.experiments ?? 0) + 1 }) }));
    byId("stop").addEventListener("click", () => void this.ask({ type: "stop" }));
    byId("get-code").addEventListener("click", () => void this.code());
  }

  private profiles(): HTMLButtonElement[] {
    return Array.from(document.querySelectorAll<HTMLButtonElement>("[data-profile]"));
  }

  /** The lab has taken a batch and says which device this page is. */
  is(device: string | undefined): void {
    if (!device) return;
    if (device !== this.device) {
      this.device = device;
      this.joined = false;
      this.notBefore = 0;
      this.state = null;
      byId("mine").hidden = true;
    }
    void this.join();
  }

  /** Tells the lab this page's secret, once for each device that it is. */
  private async join(): Promise<void> {
    if (this.joined || this.joining || performance.now() < this.notBefore) return;
    this.joining = true;
    this.notBefore = performance.now() + AGAIN_MS;
    const of = this.device;
    const { status, reply } = await this.post("/join/phone", this.page, { "x-northing-token": this.token });
    this.joining = false;
    if (of !== this.device) return;
    if (status === 200) {
      this.joined = true;
      this.problem("");
      return this.poll();
    }
    // Nothing of it has been read yet, or the lab has just come back: again in a moment.
    if (status === 0 || status === 404) return;
    this.notBefore = performance.now() + REFUSED_MS;
    this.problem(t("notJoined", { why: inLanguage(reply.error ?? String(status)) }));
  }

  private async post(path: string, body: object, headers: Record<string, string> = {}): Promise<{ status: number; reply: { error?: string; code?: string } }> {
    try {
      const answer = await fetch(path, { method: "POST", headers: { "content-type": "application/json", ...headers }, body: JSON.stringify(body), cache: "no-store" });
      return { status: answer.status, reply: await answer.json().catch(() => ({})) };
    } catch {
      return { status: 0, reply: { error: t("unreachable") } };
    }
  }

  private async ask(request: object): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    let { status, reply } = await this.post("/api/ask", request);
    // A lab that has just started again knows this phone from the next batch on.
    const begunMs = performance.now();
    while (status === 503 && performance.now() - begunMs < NOT_HEARD_MS) {
      this.problem(t("failed", { why: inLanguage(reply.error ?? String(status)) }));
      await new Promise((done) => window.setTimeout(done, POLL_MS));
      ({ status, reply } = await this.post("/api/ask", request));
    }
    this.busy = false;
    this.problem(status === 200 ? "" : t("failed", { why: inLanguage(reply.error ?? String(status)) }));
  }

  private async code(): Promise<void> {
    const { status, reply } = await this.post("/join/code", {});
    if (status !== 200 || !reply.code) return this.problem(t("failed", { why: inLanguage(reply.error ?? String(status)) }));
    byId("code").hidden = byId("code-where").hidden = false;
    say(byId("code"), `${reply.code.slice(0, 4)} ${reply.code.slice(4)}`);
    say(byId("code-where"), t("laptop.open", { url: `${location.origin}/join` }));
  }

  private problem(text: string): void {
    byId("problem").hidden = !text;
    say(byId("problem"), text);
  }

  private async poll(): Promise<void> {
    while (this.joined) {
      const askedMs = performance.now();
      try {
        const answer = await fetch("/api/mine", { cache: "no-store" });
        // The lab does not know the cookie, or another phone's page has it: the next batch joins again.
        if (answer.status === 401) this.joined = false;
        else if (answer.ok) this.take((await answer.json()) as State);
      } catch {
        byId("mine").classList.add("old");
      }
      // An answer may have taken the minutes that the phone was locked.
      const slow = Math.min(PAUSES * (performance.now() - askedMs), HIDDEN_POLL_MS);
      const pauseMs = document.visibilityState === "hidden" ? HIDDEN_POLL_MS : Math.max(POLL_MS, slow);
      await new Promise((done) => window.setTimeout(done, pauseMs));
    }
  }

  private take(now: State): void {
    if (now.device !== this.device) {
      byId("mine").hidden = true;
      return this.problem(t("otherTab"));
    }
    if (this.state && this.state.under_way?.what === "experiment" && !now.under_way) this.endedMs = performance.now();
    if (now.result?.id !== this.state?.result?.id || now.under_way) this.endedMs = 0;
    if (now.gave_up && now.gave_up !== this.state?.gave_up) this.problem(now.gave_up);
    this.state = now;
    this.show();
  }

  /** Shows what is known, also in another language. */
  show(): void {
    const s = this.state;
    if (!s) return;
    byId("mine").hidden = false;
    byId("mine").classList.toggle("old", !s.delivers);
    this.showAttitude(s);
    this.showLamps(s);
    this.showRest(s);
    for (const b of this.profiles()) b.setAttribute("aria-pressed", String(b.dataset["profile"] === s.profile));
    const under = s.under_way, runs = under?.what === "experiment";
    byId("left").hidden = !runs;
    if (under && runs) say(byId("left"), t("left", { seconds: Math.ceil(under.remaining_s) }));
    byId("run").hidden = runs;
    byId("stop").hidden = !runs;
    byId<HTMLButtonElement>("run").disabled = byId<HTMLButtonElement>("calibrate").disabled = !!under || !s.delivers;
    byId<HTMLSelectElement>("seconds").disabled = runs;
    this.showResult(s);
  }

  private showAttitude(s: State): void {
    const angles = s.angles_deg;
    if (angles) {
      // Seen from above, north up: the page's y axis points down, so turns about x and z have the other sign.
      const [yaw, pitch, roll] = angles;
      byId("body").style.transform = `rotateZ(${-yaw}deg) rotateY(${pitch}deg) rotateX(${-roll}deg)`;
    }
    rows("angles", ["yaw", "pitch", "roll"].map((name, i) => [t(name as Key), angles ? `${digits(angles[i]!, 1)}°` : "–", s.std_deg ? `±${digits(3 * s.std_deg[i]!, 1)}° (3σ)` : ""]));
  }

  private showLamps(s: State): void {
    const list = s.lamps.map(({ sensor, tone, nis_mean, nis_expected }) => {
      const key = `sensor.${sensor}`;
      const nis = nis_mean === null || nis_expected === null ? "" : t("nis", { mean: digits(nis_mean, 1), expected: nis_expected });
      return [tone, has(key) ? t(key) : sensor, t(`lamp.${tone}` as Key), nis];
    });
    replace("lamps", list.map((l) => l.join()).join(";"), () => list.map(([tone, ...parts]) => {
      const line = element("li", "", tone);
      line.append(element("b", parts[0]!), element("i", parts[1]!), element("span", parts[2]!));
      return line;
    }));
  }

  private showRest(s: State): void {
    const { calibration, rest } = s;
    const bad = calibration?.tone === "bad";
    byId("rest-said").className = `verdict ${bad ? "bad" : rest ? "good" : "idle"}`;
    say(byId("rest-said"), calibration && bad ? `${t("calibrate.refused")}: ${inLanguage(calibration.text)}` : t(rest ? "calibrate.done" : "calibrate.none"));
    say(byId("calibrate"), s.under_way?.what === "calibration" ? t("left", { seconds: Math.ceil(s.under_way.remaining_s) }) : t(rest ? "calibrate.again" : "calibrate.start"));
    byId("rest").hidden = !rest;
    if (!rest) return;
    const deg = (v: Triple): Triple => v.map((x) => (x * 180) / Math.PI) as Triple;
    const table: [Key, Triple | null][] = [["bias", deg(rest.gyroscope_bias_rad_s)], ["noise.g", deg(rest.gyroscope_std_rad_s)], ["noise.a", rest.accelerometer_std_m_s2], ["noise.m", rest.magnetometer_std_ut]];
    const known = table.flatMap(([key, v]) => (v ? [[t(key), ...v.map((x) => digits(x, 3))]] : []));
    replace("rest", known.join(";"), () => [[t("axis"), "x", "y", "z"], ...known].map((cells, i) => {
      const row = element("tr", "");
      row.append(...cells.map((text, k) => element(i && k ? "td" : "th", text)));
      return row;
    }));
  }

  private showResult(s: State): void {
    const r = s.result;
    const waits = this.endedMs > 0 && performance.now() - this.endedMs < LONGEST_WAIT_MS;
    if (waits || !r) return replace("result", `${waits}${t("result.none")}`, () => [element("p", t(waits ? "result.computing" : "result.none"), "detail")]);
    replace("result", JSON.stringify([r, t("result.report")]), () => {
      const verdict = `verdict.${r.verdict}`;
      const list = element("dl", "", "results");
      const isTilt = r.degrees_of_freedom === 2;
      const values = isTilt ? [r.calculated_tilt_deg, r.estimated_tilt_deg, r.integration_tilt_deg, r.device_tilt_deg] : [r.calculated_error_deg, r.estimated_error_deg, r.integration_deg, r.device_deg];
      const lines: Key[] = ["result.calculated", "result.estimated", "result.integration", "result.device"];
      lines.forEach((key, i) => list.append(element("dt", t(key) + (isTilt ? `, ${t("tilt")}` : "")), element("dd", degrees(values[i] ?? null))));
      const shown = [element("h3", r.name), list];
      if (r.calculated_error_deg === null) shown.splice(1, 0, element("p", t("result.moved"), "verdict warn"));
      if (has(verdict)) shown.splice(1, 0, element("p", t(verdict), `verdict ${{ consistent: "good", conservative: "warn" }[r.verdict!] ?? "bad"}`));
      if (r.asked_s && r.duration_s < r.asked_s - EARLY_S) shown.splice(1, 0, element("p", t("result.early", { after: +r.duration_s.toFixed(1), asked: +r.asked_s.toFixed(1) }), "detail"));
      if (r.has_samples) shown.push(files(r.id));
      return shown;
    });
  }
}

/** Links to the files of an experiment. */
function files(id: string): HTMLElement {
  const links = element("p", "", "pair");
  for (const [file, key] of [["report.html", "result.report"], ["recording.csv", "result.recording"]] as [string, Key][]) {
    const link = element("a", t(key)) as HTMLAnchorElement;
    link.href = `/api/experiments/${encodeURIComponent(id)}/${file}`;
    link.target = "_blank";
    link.rel = "noopener";
    links.append(link);
  }
  return links;
}

/** Puts something in another one's place, where it is another one. */
function replace(id: string, what: string, make: () => HTMLElement[]): void {
  const place = byId(id);
  if (place.dataset["shown"] === what) return;
  place.dataset["shown"] = what;
  place.replaceChildren(...make());
}

/** Rows of term, value and remark; the texts of rows that are there are changed. */
function rows(id: string, all: string[][]): void {
  const place = byId(id);
  while (place.children.length < all.length) {
    const row = element("div", "");
    row.append(element("dt", ""), element("dd", ""), element("dd", "", "sigma"));
    place.append(row);
  }
  all.forEach((texts, i) => texts.forEach((text, k) => say(place.children[i]!.children[k] as HTMLElement, text)));
}
