// The words on the page: what is connected, how each hand is tracked, how long motion takes to come back.

import { STATES, css } from "./palette.js";

const GOOD = css(STATES.tracked);
const WORKING = css(STATES.inferred);
const BAD = css(STATES.held);
const OFF = css(STATES.lost);
const LINKS = { open: GOOD, connecting: WORKING, waiting: BAD, unpaired: OFF, stopped: BAD };
const LINK_WORDS = { open: "connected", connecting: "connecting", waiting: "reconnecting", unpaired: "not paired", stopped: "stopped" };

const element = (id) => document.getElementById(id);

function show(id, text, dot) {
  const shown = element(id);
  if (shown.textContent !== text) shown.textContent = text;
  if (dot) shown.style.setProperty("--dot", dot);
}

export class Panel {
  constructor({ pair, enter }) {
    this.dialog = element("pairing");
    this.button = element("enter");
    this.button.addEventListener("click", enter);
    this.dialog.addEventListener("close", () => element("code").value && pair(element("code").value));
    this.dialog.addEventListener("cancel", (event) => event.preventDefault());
  }

  link(state, detail) {
    show("bridge", LINK_WORDS[state] + (state === "waiting" || state === "stopped" ? `: ${detail}` : ""), LINKS[state]);
    if (state === "unpaired") {
      show("pairing-error", detail);
      if (!this.dialog.open) this.dialog.showModal();
      element("code").value = "";
    } else if (this.dialog.open && state === "open") {
      this.dialog.close();
    }
  }

  vr(supported, inside) {
    this.button.disabled = !supported;
    show("enter", inside ? "Leave VR" : "Enter VR");
    show("enter-hint", supported ? "" : "This browser offers no VR: open the page in the headset's own browser.");
  }

  update({ link, latency, state, stale, devices, rate }) {
    show("avatar", link.avatar ?? "");
    const silent = link.state === "open" && stale;
    const [service, dot] = link.state !== "open" ? ["unknown", OFF] : silent ? ["does not answer", BAD] : ["answering", GOOD];
    show("service", service, dot);
    for (const side of ["left", "right"]) {
      const device = devices?.[side];
      const sent = !device ? "no controller" : device.joint === "wrist" ? "hand" : "controller";
      const tracking = !stale && state ? state[side].tracking : "lost";
      show(side, `${tracking}, ${sent}`, css(STATES[tracking]));
    }
    const ms = (value) => (Number.isNaN(value) ? "-" : value.toFixed(1));
    show("latency", latency.count ? `${ms(latency.percentile(50))} ms, p99 ${ms(latency.percentile(99))} ms` : "-");
    const best = link.clock.best;
    show("clock", best ? `± ${(best.roundTripMs / 2).toFixed(1)} ms, ${offsetWords(best.offsetNs)}` : "-");
    show("frames", `${rate.toFixed(0)} Hz${link.dropped ? `, ${link.dropped} dropped` : ""}`);
  }
}

// The bridge's wall clock against this device's own.
function offsetWords(offsetNs) {
  const ms = Number(offsetNs) / 1e6 - performance.timeOrigin;
  const size = Math.abs(ms) < 1000 ? `${Math.abs(ms).toFixed(1)} ms` : `${(Math.abs(ms) / 1000).toFixed(1)} s`;
  return `${size} ${ms < 0 ? "behind" : "ahead"}`;
}
