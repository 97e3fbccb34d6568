// The page: poses of a headset, or of mouse and keyboard, go to the bridge; the arms that come back are drawn.

import { DEFAULT_LENGTHS, bodyMeshes } from "./body.js";
import { Camera } from "./camera.js";
import { DesktopSource } from "./desktop_source.js";
import { figureParts } from "./figure.js";
import { Latency } from "./latency.js";
import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { Renderer } from "./renderer.js";
import { XrSource } from "./xr_source.js";

const STALE_MS = 500; // arms older than this are drawn grey, and the panel says that nobody answers
const PANEL_MS = 200;

const canvas = document.getElementById("scene");
const renderer = new Renderer(canvas);
const desktop = new DesktopSource();
const camera = new Camera(canvas, desktop);
const xr = new XrSource();
const latency = new Latency();
const link = new Link({
  changed: (state, detail) => {
    panel.link(state, detail);
    if (state !== "open") latency.forget();
  },
  arms: receiveArms,
  skeleton: (skeleton) => renderer.setMeshes(bodyMeshes(skeleton)),
});
const panel = new Panel({ pair: (code) => link.pair(code), enter: enterOrLeave });

let arms = null; // the newest ArmsState
let armsAtMs = -Infinity;
let poses = null; // what was sampled last
let drawn = { seq: null, parts: [] }; // what was drawn last, and the answer it was drawn from
let seq = 0;
let lastSampleNs = 0n;
const sentAtMs = []; // of the last second

function receiveArms(state, nowMs) {
  arms = state;
  armsAtMs = nowMs;
  latency.answered(state.seq, nowMs);
}

// Send what was sampled. A moment that was sampled already (a browser that repeats a frame) is not sent again.
function send(sample) {
  poses = sample;
  if (link.state !== "open" || !link.clock.known) return;
  const sampleNs = link.clock.toBridgeNs(sample.sampleMs);
  if (sampleNs <= lastSampleNs) return;
  const nowMs = performance.now();
  if (link.sendFrame({ seq, sample_time_ns: sampleNs, space: sample.space, ...sample.devices })) {
    lastSampleNs = sampleNs;
    latency.sent(seq, nowMs);
    seq += 1;
    sentAtMs.push(nowMs);
    while (sentAtMs[0] < nowMs - 1000) sentAtMs.shift();
  }
}

const stale = () => performance.now() - armsAtMs > STALE_MS;

function figure(worn) {
  drawn = { seq: arms?.seq ?? null, parts: figureParts(arms, poses, { worn, stale: stale() }) };
  return drawn.parts;
}

function flatFrame(time) {
  if (xr.session) return;
  requestAnimationFrame(flatFrame);
  fitCanvas();
  send(desktop.sample(time));
  renderer.draw(null, [camera.view()], figure(false));
}

function xrFrame(time, frame) {
  frame.session.requestAnimationFrame(xrFrame);
  const sample = xr.sample(time, frame);
  send(sample);
  const layer = frame.session.renderState.baseLayer;
  const views = sample.views.map((view) => {
    const { x, y, width, height } = layer.getViewport(view);
    const { position, inverse } = view.transform;
    return { viewport: [x, y, width, height], projection: view.projectionMatrix, view: inverse.matrix, eye: [position.x, position.y, position.z] };
  });
  renderer.draw(layer.framebuffer, views, figure(true));
}

async function enterOrLeave() {
  if (xr.session) return xr.session.end();
  const session = await xr.enter(renderer.gl);
  session.addEventListener("end", () => {
    panel.vr(true, false);
    requestAnimationFrame(flatFrame);
  });
  panel.vr(true, true);
  session.requestAnimationFrame(xrFrame);
}

function fitCanvas() {
  const ratio = Math.min(devicePixelRatio, 2);
  const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

function updatePanel() {
  const recent = sentAtMs.filter((ms) => ms > performance.now() - 1000).length;
  panel.update({ link, latency, state: arms, stale: stale(), devices: poses?.devices, rate: recent });
}

async function offerVr() {
  panel.vr(await XrSource.supported(), Boolean(xr.session));
}

// For the console, and for the tests: what the page knows and drew.
globalThis.armIk = {
  link, latency, camera, desktop,
  get arms() { return arms; },
  get drawn() { return drawn; },
  get poses() { return poses; },
};

renderer.setMeshes(bodyMeshes(DEFAULT_LENGTHS));
link.start(new URLSearchParams(location.hash.slice(1)).get("code"));
history.replaceState(null, "", location.pathname); // the code in the address is for once
offerVr();
navigator.xr?.addEventListener("devicechange", offerVr);
setInterval(updatePanel, PANEL_MS);
requestAnimationFrame(flatFrame);
