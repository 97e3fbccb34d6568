// The WebSocket to the bridge: pairing, clock, reconnecting by itself with backoff.

import { BridgeClock } from "./clock.js";
import { decode, encode } from "./msgpack.js";

const PROTOCOL = 1;
const TOKEN = "arm-ik token"; // in this browser's storage: it comes back as the same avatar
const BACKOFF_MS = [100, 200, 400, 800, 1000];
const PING_MS = 1000;
const FIRST_PINGS = 5; // quickly after one another, so that the first frames have a good clock
const SILENT_MS = 2500; // without a pong for so long the socket is dead, whatever it says
const UNSENT_BYTES = 16384; // more than this waiting in the socket: the frame is dropped, the next one is newer
const WRONG_CODE = 4401;
const TAKEN_OVER = 4409;
const TOO_MANY_TRIES = 4429;

// Calls `changed(state, detail)` with unpaired, connecting, open, waiting or stopped; `arms(state)`; `skeleton(skeleton)`.
export class Link {
  clock = new BridgeClock();
  state = "unpaired";
  detail = "";
  avatar = null;
  dropped = 0;
  #handlers;
  #socket = null;
  #code = null;
  #failures = 0;
  #pongMs = 0;
  #timer = 0;

  constructor(handlers) {
    this.#handlers = handlers;
    setInterval(() => this.#keepAlive(), PING_MS);
    addEventListener("online", () => this.#retryNow());
  }

  // Connect with what an earlier visit left, or wait for a code.
  start(code) {
    if (code) this.pair(code);
    else if (localStorage.getItem(TOKEN)) this.#connect();
    else this.#become("unpaired", "");
  }

  pair(code) {
    this.#code = code.replace(/\s/g, "");
    this.#failures = 0;
    this.#connect();
  }

  sendFrame(frame) {
    if (this.state !== "open" || !this.clock.known) return false;
    if (this.#socket.bufferedAmount > UNSENT_BYTES) {
      this.dropped += 1;
      return false;
    }
    this.#socket.send(encode({ type: "frame", ...frame }));
    return true;
  }

  #become(state, detail) {
    this.state = state;
    this.detail = detail;
    this.#handlers.changed(state, detail);
  }

  #connect() {
    clearTimeout(this.#timer);
    this.#socket?.close();
    const socket = new WebSocket(`wss://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#pongMs = performance.now();
    this.#become("connecting", "");
    socket.onopen = () => {
      const token = this.#code ? null : localStorage.getItem(TOKEN);
      socket.send(encode({ type: "hello", protocol: PROTOCOL, code: this.#code, token }));
    };
    socket.onmessage = ({ data }) => socket === this.#socket && this.#receive(decode(data));
    socket.onclose = ({ code, reason }) => socket === this.#socket && this.#closed(code, reason);
  }

  #receive(message) {
    const now = performance.now();
    if (message.type === "arms") this.#handlers.arms(message.state, now);
    else if (message.type === "skeleton") this.#handlers.skeleton(message.skeleton);
    else if (message.type === "pong") {
      this.#pongMs = now;
      this.clock.add(message.page_ms, now, message.bridge_time_ns);
    } else if (message.type === "welcome") {
      localStorage.setItem(TOKEN, message.token);
      this.#code = null;
      this.#failures = 0;
      this.avatar = message.avatar;
      this.clock.forget();
      for (let n = 0; n < FIRST_PINGS; n++) setTimeout(() => this.#ping(), 30 * n);
      this.#become("open", message.avatar);
    }
  }

  #closed(code, reason) {
    this.#socket = null;
    if (code === WRONG_CODE) {
      localStorage.removeItem(TOKEN);
      this.#code = null;
      this.#become("unpaired", reason);
    } else if (code === TAKEN_OVER || code === TOO_MANY_TRIES) {
      this.#become("stopped", reason);
    } else {
      const wait = BACKOFF_MS[Math.min(this.#failures++, BACKOFF_MS.length - 1)] * (0.75 + 0.25 * Math.random());
      this.#become("waiting", reason || "the bridge does not answer");
      this.#timer = setTimeout(() => this.#connect(), wait);
    }
  }

  #ping() {
    if (this.state === "open") this.#socket.send(encode({ type: "ping", page_ms: performance.now() }));
  }

  #keepAlive() {
    if (this.#socket && performance.now() - this.#pongMs > SILENT_MS) {
      const silent = this.#socket;
      this.#closed(1006, "the bridge has gone silent");
      silent.close();
    } else {
      this.#ping();
    }
  }

  #retryNow() {
    if (this.state === "waiting") this.#connect();
  }
}
