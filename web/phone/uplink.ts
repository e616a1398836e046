// Brings batches to the lab: numbered, kept until acknowledged, sent again with growing pauses.
// Plain POST always works; a WebSocket is tried and silently given up (Safari refuses it on a self-made certificate).

import { t } from "./t";

const KEEP_MS = 60_000;
const IN_FLIGHT = 2;
const ANSWER_MS = 5_000;
const FIRST_PAUSE_MS = 250;
const LONGEST_PAUSE_MS = 4_000;

interface Batch {
  seq: number;
  body: string;
  madeMs: number;
  sentMs: number;
  flying: boolean;
}
/** What the lab wants of this phone's person: a sentence, or what it is about. */
export interface Command {
  say?: string;
  under_way?: object;
  shared?: boolean;
}
interface Reply {
  ack?: number;
  error?: string;
  commands?: Command[];
  /** What the lab calls this page's device. */
  device?: string;
}

/** How the link does, for display. */
export interface LinkState {
  tone: "good" | "warn" | "bad";
  text: string;
  acknowledged: number;
  waiting: number;
  dropped: number;
  roundTripMs: number;
  by: "POST" | "WebSocket";
}

export class Uplink {
  readonly state: LinkState = { tone: "warn", text: t("link.looking"), acknowledged: 0, waiting: 0, dropped: 0, roundTripMs: 0, by: "POST" };
  private queue: Batch[] = [];
  private seq = 0;
  private pauseMs = 0;
  private notBefore = 0;
  private refused = false;
  private socket: WebSocket | null = null;

  constructor(private readonly token: string, private readonly took: (reply: Reply) => void) {}

  /** Queues a batch; `fill` gets its number. */
  add(fill: (seq: number) => object): void {
    const seq = this.seq++;
    this.queue.push({ seq, body: JSON.stringify(fill(seq)), madeMs: performance.now(), sentMs: 0, flying: false });
    this.pump();
  }

  /** Sends what may be sent now. Called for every batch and by a timer. */
  pump(): void {
    const now = performance.now();
    while (this.queue[0] && now - this.queue[0].madeMs > KEEP_MS) {
      this.queue.shift();
      this.state.dropped++;
    }
    this.state.waiting = this.queue.length;
    if (this.refused) return;
    for (const batch of this.queue) {
      const flying = this.queue.filter((b) => b.flying);
      const stuck = flying.find((b) => now - b.sentMs > ANSWER_MS);
      if (stuck && this.socket) this.closeSocket();
      if (flying.length >= IN_FLIGHT || now < this.notBefore) return;
      if (!batch.flying) this.send(batch, now);
    }
  }

  private send(batch: Batch, now: number): void {
    batch.flying = true;
    batch.sentMs = now;
    if (this.socket) this.socket.send(batch.body);
    else void this.post(batch);
  }

  private async post(batch: Batch): Promise<void> {
    const abort = new AbortController();
    const timer = window.setTimeout(() => abort.abort(), ANSWER_MS);
    try {
      const response = await fetch("/in", {
        method: "POST",
        headers: { "content-type": "application/json", "x-northing-token": this.token },
        body: batch.body,
        keepalive: batch.body.length < 60_000 && document.visibilityState === "hidden",
        signal: abort.signal,
        cache: "no-store",
      });
      const reply = (await response.json().catch(() => ({}))) as Reply;
      this.answered(batch, response.status, reply);
    } catch {
      this.failed(batch, t("link.silent"));
    } finally {
      window.clearTimeout(timer);
    }
  }

  private answered(batch: Batch, status: number, reply: Reply): void {
    if (status === 200) return this.acknowledged(batch.seq, reply);
    if (status === 401 || status === 403) {
      this.refused = true;
      this.state.tone = "bad";
      this.state.text = t("link.unknown");
      return;
    }
    if (status === 400 || status === 413) {
      // Sending the same again cannot help.
      this.queue = this.queue.filter((b) => b !== batch);
      this.state.dropped++;
      this.state.tone = "warn";
      this.state.text = t("link.refused", { why: reply.error ?? t("link.tooLarge") });
      return;
    }
    if (status === 503 && reply.error) return this.failed(batch, t("link.notTaken", { why: reply.error }));
    this.failed(batch, status === 429 ? t("link.pause") : t("link.status", { status }));
  }

  private acknowledged(seq: number, reply: Reply): void {
    const batch = this.queue.find((b) => b.seq === seq);
    if (batch) {
      const took = performance.now() - batch.sentMs;
      this.state.roundTripMs = this.state.roundTripMs ? this.state.roundTripMs * 0.9 + took * 0.1 : took;
      this.queue = this.queue.filter((b) => b !== batch);
      this.state.acknowledged++;
    }
    this.pauseMs = 0;
    this.notBefore = 0;
    this.state.tone = "good";
    this.state.text = t("link.receives");
    this.took(reply);
    this.pump();
  }

  private failed(batch: Batch, text: string): void {
    batch.flying = false;
    this.pauseMs = Math.min(LONGEST_PAUSE_MS, Math.max(FIRST_PAUSE_MS, this.pauseMs * 2));
    this.notBefore = performance.now() + this.pauseMs;
    this.state.tone = "warn";
    this.state.text = text;
  }

  /** Tries the faster way once; whatever happens, nothing waits for it. */
  trySocket(): void {
    let socket: WebSocket;
    try {
      socket = new WebSocket(`wss://${location.host}/in/ws`);
    } catch {
      return;
    }
    const giveUp = window.setTimeout(() => socket.close(), 4000);
    socket.onopen = () => {
      window.clearTimeout(giveUp);
      socket.send(JSON.stringify({ token: this.token }));
      this.socket = socket;
      this.state.by = "WebSocket";
    };
    socket.onmessage = (e) => {
      const reply = JSON.parse(String(e.data)) as Reply;
      if (typeof reply.ack === "number") this.acknowledged(reply.ack, reply);
      else if (reply.error) this.closeSocket();
    };
    socket.onclose = socket.onerror = () => {
      if (this.socket === socket) this.closeSocket();
    };
  }

  private closeSocket(): void {
    this.socket?.close();
    this.socket = null;
    this.state.by = "POST";
    for (const batch of this.queue) batch.flying = false;
  }
}
