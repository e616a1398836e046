// The WebSocket to the program: opens again by itself when the program was restarted.

import type { FromProgram, ToProgram } from "./protocol";
import { receive, setSender, state, update, watchAgain } from "./store";
import { t } from "./t";

const LONGEST_PAUSE_MS = 3000;
/** The program says something every second; after so long without a word it is gone, or stands still. */
const SILENCE_MS = 4000;

/** Elsewhere than on the lab's own computer a page needs a cookie; without one it has to join. */
async function joinAgain(): Promise<void> {
  if (location.protocol !== "https:") return;
  const answer = await fetch("/api/role", { cache: "no-store" }).catch(() => null);
  if (answer?.status === 401) location.replace("/join");
}

export function connect(): void {
  let pause = 250;
  let heardMs = performance.now();
  const lost = (): void => {
    if (state.connection !== "lost") update((s) => { s.connection = "lost"; s.lostMs = heardMs; });
  };
  window.setInterval(() => {
    if (performance.now() - heardMs > SILENCE_MS) lost();
    // The seconds since then are counted on the page.
    if (state.connection === "lost") update(() => undefined);
  }, 1000);
  const open = (): void => {
    const socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/api/ws`);
    setSender((message: ToProgram) => {
      if (socket.readyState === WebSocket.OPEN && state.connection === "open") socket.send(JSON.stringify(message));
      else update((s) => (s.error = t("noAnswer")));
    });
    socket.onopen = () => {
      pause = 250;
      heardMs = performance.now();
      update((s) => (s.connection = "open"));
      socket.send(JSON.stringify({ type: "display_rate", hz: state.displayHz }));
      watchAgain();
    };
    socket.onmessage = (event) => {
      heardMs = performance.now();
      if (state.connection !== "open") update((s) => (s.connection = "open"));
      receive(JSON.parse(String(event.data)) as FromProgram);
    };
    socket.onclose = () => {
      lost();
      update((s) => s.closed++);
      window.setTimeout(open, pause);
      void joinAgain();
      pause = Math.min(LONGEST_PAUSE_MS, pause * 2);
    };
  };
  open();
}
