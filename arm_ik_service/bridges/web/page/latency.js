// How long motion takes to come back as arms, over the last few seconds.

const KEPT = 600; // five seconds at 120 Hz
const UNANSWERED = 240; // frames still waited for

export class Latency {
  #sent = new Map(); // seq -> page time [ms] at which its poses were read
  #tookMs = [];

  sent(seq, pageMs) {
    this.#sent.set(seq, pageMs);
    if (this.#sent.size > UNANSWERED) this.#sent.delete(this.#sent.keys().next().value);
  }

  // The answer to `seq` arrived; earlier frames were overtaken and are no longer waited for.
  answered(seq, pageMs) {
    const sentMs = this.#sent.get(seq);
    for (const other of this.#sent.keys()) if (other <= seq) this.#sent.delete(other);
    if (sentMs === undefined) return;
    this.#tookMs.push(pageMs - sentMs);
    if (this.#tookMs.length > KEPT) this.#tookMs.shift();
  }

  get count() {
    return this.#tookMs.length;
  }

  percentile(percent) {
    if (this.#tookMs.length === 0) return NaN;
    const sorted = [...this.#tookMs].sort((a, b) => a - b);
    return sorted[Math.floor((percent / 100) * (sorted.length - 1))];
  }

  forget() {
    this.#sent.clear();
    this.#tookMs = [];
  }
}
