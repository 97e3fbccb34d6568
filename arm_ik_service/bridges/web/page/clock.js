// The bridge's wall clock as seen from the page's: asked for by pings, of which the quickest recent one is believed.

const KEPT = 16; // pings: at one a second a quarter of a minute, in which clocks drift apart by less than a millisecond
const SLEW = 0.0005; // a correction changes the pace of sample times by this at most, and velocities with it
const JUMP_NS = 50_000_000n; // beyond this the clock was set, or the headset slept: follow at once

const nanoseconds = (ms) => BigInt(Math.round(ms * 1e6));

export class BridgeClock {
  #pings = [];
  #offsetNs = null; // of sample times: slewed
  #slewedAtMs = 0;

  // A ping sent at `sentMs` came back at `receivedMs` of the page's clock with the bridge's time.
  add(sentMs, receivedMs, bridgeTimeNs) {
    const offsetNs = BigInt(bridgeTimeNs) - nanoseconds((sentMs + receivedMs) / 2);
    this.#pings.push({ roundTripMs: receivedMs - sentMs, offsetNs });
    if (this.#pings.length > KEPT) this.#pings.shift();
  }

  get known() {
    return this.#pings.length > 0;
  }

  // The quickest of the kept pings, or null: its offset is wrong by half its round trip at most.
  get best() {
    return this.#pings.reduce((a, b) => (a && a.roundTripMs <= b.roundTripMs ? a : b), null);
  }

  forget() {
    this.#pings = [];
  }

  // A moment of the page's clock [ms] on the bridge's [ns, BigInt]. Moments go forward, so does the answer.
  toBridgeNs(pageMs) {
    const wantedNs = this.best.offsetNs;
    const wrongNs = this.#offsetNs === null ? JUMP_NS + 1n : wantedNs - this.#offsetNs;
    if (wrongNs > JUMP_NS || wrongNs < -JUMP_NS) {
      this.#offsetNs = wantedNs;
    } else {
      const most = nanoseconds(SLEW * Math.max(0, pageMs - this.#slewedAtMs));
      this.#offsetNs += wrongNs > most ? most : wrongNs < -most ? -most : wrongNs;
    }
    this.#slewedAtMs = pageMs;
    return nanoseconds(pageMs) + this.#offsetNs;
  }
}
