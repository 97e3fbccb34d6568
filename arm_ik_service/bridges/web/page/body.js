// The parts of a person as meshes. Arms are built in ISB axes (+X anterior, +Y to the proximal end, +Z to the right), the hand
// in the OpenXR wrist frame (-Z to the fingers, +Y out of its back), everything else in OpenXR axes. Girths are those of a
// person of average build (ANSUR II means, rounded).

import { add, fromY, length, rotate, subtract } from "./math.js";
import { capsule, join, mirrored, moved, ring, rotated, rounded, tube } from "./shapes.js";

export const DEFAULT_LENGTHS = { upper_arm_m: 0.326, forearm_m: 0.256, hand_m: 0.189, shoulder_width_m: 0.36 };

export const SPANS = { girdle: 0.15, neck: 0.12, ray: 1.5 }; // how long these are built: they are stretched between two points

// A capsule between two points, from the first radius to the second.
function bar(start, end, startRadius, endRadius) {
  const axis = subtract(end, start);
  const q = fromY(axis);
  return moved(rotated(capsule(0, length(axis), startRadius, endRadius), (v) => rotate(q, v)), start);
}

function upperArm(n) {
  return tube([
    [0.05, 0.03, 0.03, 0, 0.004], [0.02, 0.053, 0.051, 0, 0.006], [-0.16 * n, 0.056, 0.054, 0.002, 0.006],
    [-0.36 * n, 0.05, 0.048, 0.004, 0.002], [-0.6 * n, 0.049, 0.043, 0.004, 0], [-0.82 * n, 0.042, 0.04, 0, 0],
    [-n, 0.039, 0.041, 0, 0], [-n - 0.03, 0.026, 0.028, 0, 0],
  ]);
}

function forearm(n) {
  return tube([
    [0.03, 0.028, 0.03, 0, 0], [0, 0.041, 0.042, 0, 0], [-0.2 * n, 0.044, 0.046, 0, 0.004], [-0.4 * n, 0.041, 0.042, 0, 0.003],
    [-0.64 * n, 0.033, 0.036, 0, 0], [-0.86 * n, 0.026, 0.031, 0, 0], [-0.97 * n, 0.024, 0.029, 0, 0],
  ]);
}

const wristJoint = () => rounded([0.023, 0.023, 0.023]);

// A right hand closed around a grip, the thumb along it.
function hand(n) {
  const parts = [moved(rounded([0.041, 0.0155, 0.048], 0.55), [0, -0.002, -0.052])];
  const bend = [[-0.57, 0.82], [0.77, 0.64], [0.98, -0.17]]; // z and -y of the three phalanges
  const fingers = [[-0.032, -0.091, [0.042, 0.027, 0.02], 0.01], [-0.011, -0.095, [0.046, 0.03, 0.021], 0.0105],
    [0.01, -0.091, [0.042, 0.028, 0.02], 0.01], [0.03, -0.082, [0.034, 0.021, 0.018], 0.0088]];
  for (const [x, z, phalanges, radius] of fingers) {
    let point = [x, -0.004, z];
    phalanges.forEach((phalanx, k) => {
      const end = add(point, [0, -bend[k][1] * phalanx, bend[k][0] * phalanx]);
      parts.push(bar(point, end, radius, 0.95 * radius));
      point = end;
    });
  }
  const thumb = [[-0.022, -0.008, -0.022], [-0.05, -0.018, -0.05], [-0.062, -0.024, -0.08], [-0.058, -0.026, -0.106]];
  [0.015, 0.0125, 0.011].forEach((radius, k) => parts.push(bar(thumb[k], thumb[k + 1], radius, 0.9 * radius)));
  const whole = join(...parts);
  const size = n / DEFAULT_LENGTHS.hand_m;
  return { ...whole, positions: whole.positions.map((value) => size * value) };
}

// From the middle between the shoulders down to the waist, the back at +z.
function torso(width) {
  const w = width / 2;
  return tube([
    [0.07, 0.05, 0.048, 0, 0.004], [0.04, 0.6 * w, 0.07, 0, 0.004], [0, 0.84 * w, 0.092, 0, 0.002], [-0.06, 0.9 * w, 0.108, 0, -0.002],
    [-0.14, 0.9 * w, 0.116, 0, -0.006], [-0.24, 0.84 * w, 0.106, 0, -0.002], [-0.36, 0.76 * w, 0.096, 0, 0], [-0.45, 0.78 * w, 0.1, 0, 0],
  ], 2.5);
}

function neck() {
  return tube([[SPANS.neck, 0.05, 0.054, 0, 0], [0, 0.056, 0.058, 0, 0], [-0.02, 0.06, 0.06, 0, 0]]);
}

// In the VIEW frame: the origin between the eyes, -z forward.
function head() {
  return join(
    tube([
      [0.12, 0.03, 0.036, 0, 0.092], [0.105, 0.058, 0.072, 0, 0.09], [0.06, 0.077, 0.098, 0, 0.086], [0, 0.079, 0.1, 0, 0.084],
      [-0.06, 0.07, 0.088, 0, 0.074], [-0.1, 0.05, 0.064, 0, 0.058], [-0.118, 0.026, 0.034, 0, 0.044],
    ]),
    bar([0, -0.03, -0.016], [0, -0.046, -0.022], 0.01, 0.012),
  );
}

function headset() {
  const strap = tube([[0.034, 0.085, 0.106, 0, 0.086], [0.008, 0.085, 0.106, 0, 0.086]]);
  return join(moved(rounded([0.088, 0.047, 0.042], 0.45), [0, 0.004, -0.03]), strap);
}

// A handle along the grip's z with a ring at the thumb's end.
function controller() {
  return join(bar([0, 0, 0.062], [0, 0, -0.062], 0.0115, 0.0135), moved(ring(0.027, 0.005), [0, 0, -0.085]));
}

// Every mesh by name; sided ones are the right side's and, under `left `, their mirror images.
export function bodyMeshes(lengths) {
  const meshes = {
    torso: torso(lengths.shoulder_width_m), head: head(), headset: headset(), controller: controller(),
    visor: moved(rounded([0.074, 0.036, 0.01], 0.4), [0, 0.004, -0.068]),
    girdle: capsule(0, SPANS.girdle, 0.052, 0.043), neck: neck(), ray: capsule(0, SPANS.ray, 0.003, 0.001), wrist: wristJoint(),
  };
  const sided = { upper_arm: [upperArm(lengths.upper_arm_m), 2], forearm: [forearm(lengths.forearm_m), 2], hand: [hand(lengths.hand_m), 0] };
  for (const [name, [mesh, axis]] of Object.entries(sided)) {
    meshes[`right ${name}`] = mesh;
    meshes[`left ${name}`] = mirrored(mesh, axis);
  }
  return meshes;
}
