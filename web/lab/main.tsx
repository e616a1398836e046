// The lab page: devices on the left, the device and its numbers in the middle, the step of the path on the right.

import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import "./style.css";
import { language, LANGUAGES, onLanguage, setLanguage } from "../words/language";
import { followLanguage } from "../words/program";
import { connect } from "./connection";
import { Lamps } from "./live";
import { LivePlots } from "./plots";
import { Angles, Device3d } from "./stage";
import { AllanPlot } from "./panels/allan";
import { Calibrate, Place } from "./panels/calibrate";
import { Connect } from "./panels/connect";
import { Devices } from "./panels/devices";
import { CoverageSphere } from "./panels/magnetometer";
import { Experiment, ExperimentTable, Result, Return } from "./panels/experiment";
import { DropZone } from "./panels/opened";
import { RecordingLight, Recordings } from "./panels/recordings";
import { Tune } from "./panels/tune";
import { Wall } from "./panels/wall";
import { WhatIf, WhatIfPlots } from "./panels/what_if";
import type { Device } from "./protocol";
import { goTo, isOld, isStudent, type Lower, offers, onChange, selectedDevice, send, state, steps, update } from "./store";
import { t } from "./t";
import { said } from "./words";

const heading = (): string => t(state.step === "calibrate" && state.calibrating !== "rest" ? `heading.${state.calibrating}` : `heading.${state.step}`);

function App() {
  const [, again] = useState(0);
  useEffect(() => onChange(() => again((n) => n + 1)), []);
  useEffect(() => onLanguage(() => update(() => undefined)), []);
  useEffect(() => {
    const keys = (e: KeyboardEvent): void => {
      const typing = e.target instanceof HTMLElement && e.target.closest("input, select, textarea");
      const step = steps()[Number(e.key) - 1];
      if (!typing && step && !e.ctrlKey && !e.metaKey && !e.altKey) goTo(step);
    };
    window.addEventListener("keydown", keys);
    return () => window.removeEventListener("keydown", keys);
  }, []);
  return (
    <>
      <Header />
      <main class={`${state.view} ${isOld() ? "old" : ""}`}>
        {state.view === "wall" ? <Wall /> : <><Devices /><Centre /><Panel /></>}
      </main>
      <Notice />
      {!isStudent() && <DropZone />}
    </>
  );
}

function Header() {
  return (
    <header>
      <h1>Northing <span>lab</span></h1>
      <nav aria-label={t("steps")}>
        <ol>
          {steps().map((step, i) => (
            <li key={step}>
              <button type="button" aria-current={state.view === "lab" && state.step === step ? "step" : undefined} title={t("key", { key: i + 1 })} onClick={() => goTo(step)}>
                <span>{i + 1}</span>{t(`step.${step}`)}
              </button>
            </li>
          ))}
        </ol>
      </nav>
      <label class="rate">{t("display")}
        <select value={String(state.displayHz)} onChange={(e) => { const hz = Number(e.currentTarget.value); update((s) => (s.displayHz = hz)); send({ type: "display_rate", hz }); }}>
          {[5, 10, 20, 30, 60].map((hz) => <option key={hz} value={String(hz)}>{hz} Hz</option>)}
        </select>
      </label>
      <RecordingLight />
      {!isStudent() && <button type="button" aria-pressed={state.view === "wall"} onClick={() => update((s) => (s.view = s.view === "wall" ? "lab" : "wall"))}>{t("wall.short")}</button>}
      <OtherLanguage />
    </header>
  );
}

/** The page in the other language, named in that language. */
function OtherLanguage() {
  const other = language() === "en" ? "es" : "en";
  return <button type="button" class="language" lang={other} aria-label={`${other.toUpperCase()}, ${LANGUAGES[other]}`} title={t("language.other", { name: LANGUAGES[other] })} onClick={() => setLanguage(other)}>{other.toUpperCase()}</button>;
}

const LOWER: Lower[] = ["live", "experiments", "what-if", "allan", "recordings"];

function Centre() {
  const device = selectedDevice();
  const turning = state.step === "calibrate" && state.calibrating === "magnetometer" && offers("magnetometer");
  const tabs = LOWER.filter((key) => (key === "allan" ? offers("allan") : key === "recordings" ? state.recording : true));
  return (
    <section class={`centre ${device && !device.delivers ? "silent" : ""}`} aria-label={t("attitude")}>
      <div class="stage">
        {turning && device ? <CoverageSphere device={device.id} key={`sphere ${device.id}`} /> : <Device3d device={device?.id ?? null} />}
        {device && !turning && <Angles device={device.id} />}
        {!device && <p class="empty">{t("stage.empty")}</p>}
      </div>
      {device ? <Lamps device={device.id} key={device.id} /> : <div class="lamps" />}
      <div class="lower">
        <div class="tabs" role="tablist" aria-label={t("lower")}>
          {tabs.map((key) => (
            <button key={key} id={`tab-${key}`} type="button" role="tab" aria-controls="lower" aria-selected={state.lower === key} onClick={() => update((s) => (s.lower = key))}>{t(`lower.${key}`)}</button>
          ))}
        </div>
        <div class="page" id="lower" role="tabpanel" aria-labelledby={`tab-${state.lower}`}>
        {state.lower === "live" && (device ? <LivePlots device={device.id} key={device.id} /> : <p class="empty">{t("plots.empty")}</p>)}
        {state.lower === "experiments" && <ExperimentTable />}
        {state.lower === "what-if" && <WhatIfPlots />}
        {state.lower === "allan" && <AllanPlot />}
        {state.lower === "recordings" && <Recordings />}
        </div>
      </div>
    </section>
  );
}

function Panel() {
  const device = selectedDevice();
  return (
    <section class="panel" aria-label={t(`heading.${state.step}`)}>
      <h2><span>{steps().indexOf(state.step) + 1}</span>{heading()}</h2>
      {state.step === "connect" ? <Connect /> : state.step === "result" && (device || state.shownAlone) ? <Result /> : state.step === "what-if" && state.rows.length ? <WhatIf key={`${state.selected} ${state.shownAlone}`} /> : device ? <StepOf device={device} key={`${state.step} ${device.id}`} /> : isStudent() ? <p>{t("student.noPhone")}</p> : (
        <p>{t("panel.first")} <button type="button" class="link" onClick={() => goTo("connect")}>{t("panel.connect")}</button>{t("panel.virtual")}</p>
      )}
    </section>
  );
}

function StepOf({ device }: { device: Device }) {
  switch (state.step) {
    case "place": return <Place device={device} />;
    case "calibrate": return <Calibrate device={device} />;
    case "tune": return <Tune device={device} />;
    case "experiment": return <Experiment device={device} />;
    case "return": return <Return device={device} />;
    case "result": case "what-if": case "connect": return null;
  }
}

/** What went wrong, over the page's foot so that nothing moves. */
function Notice() {
  const lost = isOld();
  const seconds = Math.max(0, Math.round((performance.now() - state.lostMs) / 1000));
  const text = lost ? t("lostSince", { seconds }) : state.error && said(state.error);
  if (!text) return null;
  return (
    // Read aloud once: the seconds change all the time.
    <div class="notice" role={lost ? "status" : "alert"} aria-live={lost ? "off" : "assertive"}>
      <span>{text}</span>
      {!lost && <button type="button" onClick={() => update((s) => (s.error = null))}>{t("close")}</button>}
    </div>
  );
}

followLanguage(async () => (await import("../words/program.json")).default, () => update(() => undefined));
render(<App />, document.getElementById("lab")!);
connect();
