// Both hands without a headset: drag them with the mouse, or drive them with the keyboard.

import { about, add, multiply, rotate, scale } from "./math.js";

const SPEED_M_S = 0.6;
const TURN_RAD_S = 1.8;
const DRAG_TURN = 0.008; // radians a pixel
const HEAD = [0, 1.62, 0];
const REST = {
  left: { position: [-0.22, 1.12, -0.34], orientation: grip("left") },
  right: { position: [0.22, 1.12, -0.34], orientation: grip("right") },
};

// Which key moves which hand along x, y, z of the room, or turns it about the forearm.
const MOVES = {
  KeyA: ["left", 0, -1], KeyD: ["left", 0, 1], KeyW: ["left", 2, -1], KeyS: ["left", 2, 1], KeyE: ["left", 1, 1], KeyQ: ["left", 1, -1],
  KeyJ: ["right", 0, -1], KeyL: ["right", 0, 1], KeyI: ["right", 2, -1], KeyK: ["right", 2, 1], KeyO: ["right", 1, 1], KeyU: ["right", 1, -1],
};
const TURNS = { KeyZ: ["left", -1], KeyX: ["left", 1], KeyN: ["right", -1], KeyM: ["right", 1] };

// A relaxed fist before the body: thumb up and a little forward.
function grip(side) {
  const inwards = side === "left" ? -1 : 1;
  return multiply(about([0, 1, 0], 0.25 * inwards), multiply(about([0, 0, 1], 0.15 * inwards), about([1, 0, 0], 1.15)));
}

export class DesktopSource {
  hands = structuredClone(REST);
  active = "right"; // the hand dragged last: the wheel and shift-drag are for it
  #pressed = new Set();
  #beforeMs = 0;

  constructor(target = document) {
    const typing = () => document.activeElement?.tagName === "INPUT";
    target.addEventListener("keydown", (event) => {
      if (typing() || event.ctrlKey || event.metaKey) return;
      if (event.code === "KeyR") this.hands = structuredClone(REST);
      this.#pressed.add(event.code);
    });
    target.addEventListener("keyup", (event) => this.#pressed.delete(event.code));
    addEventListener("blur", () => this.#pressed.clear());
  }

  move(side, offset) {
    this.hands[side].position = add(this.hands[side].position, offset);
    this.active = side;
  }

  // Turn a hand by pixels dragged: sideways about the room's vertical, up and down about its horizontal across.
  turn(side, dx, dy, across) {
    const q = multiply(about([0, 1, 0], DRAG_TURN * dx), about(across, DRAG_TURN * dy));
    this.hands[side].orientation = multiply(q, this.hands[side].orientation);
  }

  sample(time) {
    const elapsedS = Math.min(0.1, Math.max(0, (time - this.#beforeMs) / 1000));
    this.#beforeMs = time;
    for (const code of this.#pressed) {
      if (MOVES[code]) {
        const [side, axis, sign] = MOVES[code];
        const step = [0, 0, 0];
        step[axis] = sign * SPEED_M_S * elapsedS;
        this.move(side, step);
      } else if (TURNS[code]) {
        const [side, sign] = TURNS[code];
        const forward = rotate(this.hands[side].orientation, [0, -1, 0]);
        const q = about(forward, sign * TURN_RAD_S * elapsedS);
        this.hands[side].orientation = multiply(q, this.hands[side].orientation);
      }
    }
    const pose = (hand) => ({ ...structuredClone(hand), flags: 15, joint: "grip" });
    const head = { position: HEAD, orientation: this.#glance(), flags: 15, joint: "grip" };
    return { space: "local_floor", devices: { head, left: pose(this.hands.left), right: pose(this.hands.right) }, aims: {}, sampleMs: time };
  }

  // The head follows the hands a little, as one looks at what one does.
  #glance() {
    const middle = scale(0.5, add(this.hands.left.position, this.hands.right.position));
    const yaw = Math.atan2(-middle[0], Math.max(0.25, -middle[2]));
    const pitch = Math.atan2(middle[1] - HEAD[1], Math.max(0.35, Math.hypot(middle[0], middle[2])));
    return multiply(about([0, 1, 0], 0.5 * yaw), about([1, 0, 0], 0.35 * pitch));
  }
}
