// The lab page: devices on the left, the device and its numbers in the middle, the step of the path on the right.

import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import "./style.css";
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
import { goTo, isOld, isStudent, type Lower, offers, onChange, selectedDevice, send, state, type Step, steps, update } from "./store";
import { t } from "./t";

const TITLES: Record<Step, string> = {
  connect: "Connect", place: "Place", calibrate: "Calibrate", tune: "Q and R", experiment: "Experiment", return: "Return", result: "Result", "what-if": "What if?",
};
const HEADINGS: Record<Step, string> = {
  connect: "Connect a phone", place: "Place it at rest", calibrate: "Calibrate at rest", tune: "Set Q and R", experiment: "Move it", return: "Bring it back", result: "How far off?", "what-if": "What if?",
};

const CALIBRATIONS = { rest: "Calibrate at rest", magnetometer: "Turn it all over", allan: "Measure the noise" };

function App() {
  const [, again] = useState(0);
  useEffect(() => onChange(() => again((n) => n + 1)), []);
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
      <nav aria-label="Steps">
        <ol>
          {steps().map((step, i) => (
            <li key={step}>
              <button type="button" aria-current={state.view === "lab" && state.step === step ? "step" : undefined} title={`Key ${i + 1}`} onClick={() => goTo(step)}>
                <span>{i + 1}</span>{TITLES[step]}
              </button>
            </li>
          ))}
        </ol>
      </nav>
      <label class="rate">Display
        <select value={String(state.displayHz)} onChange={(e) => { const hz = Number(e.currentTarget.value); update((s) => (s.displayHz = hz)); send({ type: "display_rate", hz }); }}>
          {[5, 10, 20, 30, 60].map((hz) => <option key={hz} value={String(hz)}>{hz} Hz</option>)}
        </select>
      </label>
      <RecordingLight />
      {!isStudent() && <button type="button" aria-pressed={state.view === "wall"} onClick={() => update((s) => (s.view = s.view === "wall" ? "lab" : "wall"))}>Wall</button>}
    </header>
  );
}

const LOWER: [Lower, string][] = [["live", "Live"], ["experiments", "Experiments"], ["what-if", "What if"], ["allan", "Allan"], ["recordings", "Recordings"]];

function Centre() {
  const device = selectedDevice();
  const turning = state.step === "calibrate" && state.calibrating === "magnetometer" && offers("magnetometer");
  const tabs = LOWER.filter(([key]) => (key === "allan" ? offers("allan") : key === "recordings" ? state.recording : true));
  return (
    <section class={`centre ${device && !device.delivers ? "silent" : ""}`} aria-label="Attitude">
      <div class="stage">
        {turning && device ? <CoverageSphere device={device.id} key={`sphere ${device.id}`} /> : <Device3d device={device?.id ?? null} />}
        {device && !turning && <Angles device={device.id} />}
        {!device && <p class="empty">The device appears here once one is connected.</p>}
      </div>
      {device ? <Lamps device={device.id} key={device.id} /> : <div class="lamps" />}
      <div class="lower">
        <div class="tabs" role="tablist" aria-label="Lower half">
          {tabs.map(([key, text]) => (
            <button key={key} id={`tab-${key}`} type="button" role="tab" aria-controls="lower" aria-selected={state.lower === key} onClick={() => update((s) => (s.lower = key))}>{text}</button>
          ))}
        </div>
        <div class="page" id="lower" role="tabpanel" aria-labelledby={`tab-${state.lower}`}>
        {state.lower === "live" && (device ? <LivePlots device={device.id} key={device.id} /> : <p class="empty">Plots start with the first samples.</p>)}
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
    <section class="panel" aria-label={HEADINGS[state.step]}>
      <h2><span>{steps().indexOf(state.step) + 1}</span>{state.step === "calibrate" ? CALIBRATIONS[state.calibrating] : HEADINGS[state.step]}</h2>
      {state.step === "connect" ? <Connect /> : state.step === "result" && (device || state.shownAlone) ? <Result /> : state.step === "what-if" && state.rows.length ? <WhatIf key={`${state.selected} ${state.shownAlone}`} /> : device ? <StepOf device={device} key={`${state.step} ${device.id}`} /> : isStudent() ? <p>{t("student.noPhone")}</p> : (
        <p>First <button type="button" class="link" onClick={() => goTo("connect")}>connect a phone</button>, or add a virtual one.</p>
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
  const text = lost ? `Connection lost since ${seconds} s; what you see is old. This page connects again by itself.` : state.error;
  if (!text) return null;
  return (
    // Read aloud once: the seconds change all the time.
    <div class="notice" role={lost ? "status" : "alert"} aria-live={lost ? "off" : "assertive"}>
      <span>{text}</span>
      {!lost && <button type="button" onClick={() => update((s) => (s.error = null))}>Close</button>}
    </div>
  );
}

render(<App />, document.getElementById("lab")!);
connect();
