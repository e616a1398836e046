// The WebSocket to the program: opens again by itself when the program was restarted.

import type { FromProgram, ToProgram } from "./protocol";
import { receive, setSender, state, update } from "./store";

const LONGEST_PAUSE_MS = 3000;

export function connect(): void {
  let pause = 250;
  const open = (): void => {
    const socket = new WebSocket(`ws://${location.host}/api/ws`);
    setSender((message: ToProgram) => {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
      else update((s) => (s.error = "The lab program does not answer: nothing was changed."));
    });
    socket.onopen = () => {
      pause = 250;
      update((s) => (s.connection = "open"));
      socket.send(JSON.stringify({ type: "display_rate", hz: state.displayHz }));
    };
    socket.onmessage = (event) => receive(JSON.parse(String(event.data)) as FromProgram);
    socket.onclose = () => {
      update((s) => (s.connection = "lost"));
      window.setTimeout(open, pause);
      pause = Math.min(LONGEST_PAUSE_MS, pause * 2);
    };
  };
  open();
}
