// The flat page's camera: drag a hand to move it, drag elsewhere to walk around, wheel for depth or distance.

import { add, cross, dot, lookAt, multiplyMatrices, normalize, perspective, scale, subtract } from "./math.js";

const FIELD_OF_VIEW = 0.62;
const GRAB_PX = 90;

export class Camera {
  yaw = 3.55; // radians about the person; pi stands face to face
  pitch = 0.2;
  distance = 2.35;
  target = [0, 1.2, -0.1];
  #canvas;
  #source;
  #drag = null;

  constructor(canvas, source) {
    this.#canvas = canvas;
    this.#source = source;
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", () => (this.#drag = null));
    canvas.addEventListener("pointercancel", () => (this.#drag = null));
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  get eye() {
    const flat = Math.cos(this.pitch);
    const out = [flat * Math.sin(this.yaw), Math.sin(this.pitch), flat * Math.cos(this.yaw)];
    return add(this.target, scale(this.distance, out));
  }

  view() {
    const { width, height } = this.#canvas;
    return {
      viewport: [0, 0, width, height],
      projection: perspective(FIELD_OF_VIEW, width / height, 0.05, 30),
      view: lookAt(this.eye, this.target),
      eye: this.eye,
    };
  }

  // Where a point of the room is on the page, in CSS pixels.
  project(point) {
    const { projection, view } = this.view();
    const m = multiplyMatrices(projection, view);
    const row = (k) => m[k] * point[0] + m[4 + k] * point[1] + m[8 + k] * point[2] + m[12 + k];
    const { clientWidth, clientHeight } = this.#canvas;
    return [((row(0) / row(3) + 1) / 2) * clientWidth, ((1 - row(1) / row(3)) / 2) * clientHeight];
  }

  #axes() {
    const out = normalize(subtract(this.eye, this.target));
    const right = normalize(cross([0, 1, 0], out));
    return { out, right, up: cross(out, right) };
  }

  #down(event) {
    const place = [event.offsetX, event.offsetY];
    const near = Object.entries(this.#source.hands)
      .map(([side, { position }]) => [side, Math.hypot(...this.project(position).map((value, k) => value - place[k]))])
      .sort((a, b) => a[1] - b[1])[0];
    const grabs = near[1] < GRAB_PX && event.button === 0;
    if (grabs) this.#source.active = near[0];
    this.#drag = { side: grabs ? near[0] : null, turns: event.shiftKey };
    this.#canvas.setPointerCapture(event.pointerId);
  }

  #move(event) {
    if (!this.#drag) return;
    const { side, turns } = this.#drag;
    if (side === null) {
      this.yaw -= 0.006 * event.movementX;
      this.pitch = Math.min(1.4, Math.max(-0.4, this.pitch + 0.006 * event.movementY));
      return;
    }
    const { right, up, out } = this.#axes();
    if (turns) return this.#source.turn(side, event.movementX, event.movementY, right);
    const depth = dot(subtract(this.eye, this.#source.hands[side].position), out);
    const metres = (2 * depth * Math.tan(FIELD_OF_VIEW / 2)) / this.#canvas.clientHeight;
    this.#source.move(side, add(scale(metres * event.movementX, right), scale(-metres * event.movementY, up)));
  }

  #wheel(event) {
    event.preventDefault();
    const step = Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 100) * 0.0006;
    if (event.ctrlKey || event.altKey || !this.#drag?.side) {
      this.distance = Math.min(6, Math.max(0.8, this.distance * (1 + 2 * step)));
    } else {
      const flat = this.#axes().out;
      this.#source.move(this.#drag.side, scale(step, normalize([flat[0], 0, flat[2]])));
    }
  }
}
