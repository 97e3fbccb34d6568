// Triangle meshes, built once in the axes of the bone that carries them: { positions, normals, indices }.

import { cross, subtract } from "./math.js";

const AROUND = 24;

// The surface over rings of points that run around +Y from the top down; the first and last rings are (nearly) points.
function skin(rings) {
  const around = rings[0].length;
  const points = rings.flat();
  const indices = [];
  for (let r = 0; r + 1 < rings.length; r++) {
    for (let k = 0; k < around; k++) {
      const a = r * around + k;
      const b = r * around + ((k + 1) % around);
      indices.push(a, a + around, b, b, a + around, b + around);
    }
  }
  const sums = points.map(() => [0, 0, 0]);
  for (let t = 0; t < indices.length; t += 3) {
    const corners = [indices[t], indices[t + 1], indices[t + 2]];
    const [a, b, c] = corners.map((corner) => points[corner]);
    const normal = cross(subtract(b, a), subtract(c, a));
    for (const corner of corners) for (let axis = 0; axis < 3; axis++) sums[corner][axis] += normal[axis];
  }
  const normals = sums.flatMap((n) => n.map((part) => part / Math.max(Math.hypot(...n), 1e-12)));
  return { positions: new Float32Array(points.flat()), normals: new Float32Array(normals), indices: new Uint16Array(indices) };
}

const circle = (count) => Array.from({ length: count }, (_, k) => (-2 * Math.PI * k) / count);

// Cut the corners of an outline of rows (Chaikin 1974); its ends stay.
function smooth(rows) {
  const mix = (a, b, s) => a.map((value, k) => (1 - s) * value + s * b[k]);
  const inner = rows.slice(0, -1).flatMap((row, k) => [mix(row, rows[k + 1], 0.25), mix(row, rows[k + 1], 0.75)]);
  return [rows[0], ...inner, rows.at(-1)];
}

// A lofted tube along Y from rows [y, half width in x, half width in z, centre x, centre z] that run downwards.
// `squareness` 2 gives ellipses, more gives rounded rectangles.
export function tube(sections, squareness = 2) {
  const closed = (row) => [row[0], 1e-4, 1e-4, row[3], row[4]];
  const rows = smooth(smooth([closed(sections[0]), ...sections, closed(sections.at(-1))]));
  const power = (x) => Math.sign(x) * Math.abs(x) ** (2 / squareness);
  const angles = circle(AROUND);
  return skin(rows.map(([y, wx, wz, cx, cz]) => angles.map((a) => [cx + wx * power(Math.cos(a)), y, cz + wz * power(Math.sin(a))])));
}

// A capsule along +Y between two heights, from the lower radius to the upper one.
export function capsule(lower, upper, lowerRadius, upperRadius) {
  const steps = [0, 1, 2, 3, 4, 5, 6];
  const cap = (y, radius, sign) => steps.map((n) => {
    const lift = (Math.PI / 2) * (1 - n / 6);
    return [y + sign * radius * Math.sin(lift), Math.max(radius * Math.cos(lift), 1e-5)];
  });
  const outline = [...cap(upper, upperRadius, 1), ...cap(lower, lowerRadius, -1).reverse()];
  return skin(outline.map(([y, radius]) => circle(AROUND).map((a) => [radius * Math.cos(a), y, radius * Math.sin(a)])));
}

// A superellipsoid of half sizes [x, y, z]: `roundness` 1 is an ellipsoid, towards 0 a box (Barr 1981).
export function rounded(half, roundness = 1) {
  const power = (x) => Math.sign(x) * Math.abs(x) ** roundness;
  const lifts = Array.from({ length: 17 }, (_, n) => Math.PI / 2 - (Math.PI * n) / 16);
  return skin(lifts.map((lift) => {
    const flat = Math.max(power(Math.cos(lift)), 1e-4);
    return circle(AROUND).map((a) => [half[0] * flat * power(Math.cos(a)), half[1] * power(Math.sin(lift)), half[2] * flat * power(Math.sin(a))]);
  }));
}

// A torus about Z.
export function ring(radius, thickness) {
  const around = [...circle(32), -2 * Math.PI];
  return skin(around.map((a) => circle(10).map((b) => {
    const out = radius + thickness * Math.cos(b);
    return [out * Math.cos(a), out * Math.sin(a), thickness * Math.sin(b)];
  })));
}

// The mesh with its points moved by `move`; reversed triangles where that is a reflection.
function transformed(mesh, move, turn, reflected) {
  const each = (values, change) => {
    const out = new Float32Array(values.length);
    for (let k = 0; k < values.length; k += 3) out.set(change([values[k], values[k + 1], values[k + 2]]), k);
    return out;
  };
  const indices = reflected ? mesh.indices.slice().reverse() : mesh.indices;
  return { positions: each(mesh.positions, move), normals: each(mesh.normals, turn), indices };
}

export const moved = (mesh, offset) =>
  transformed(mesh, (p) => p.map((value, k) => value + offset[k]), (n) => n, false);

export const rotated = (mesh, turn) => transformed(mesh, turn, turn, false);

// The mirror image across the plane through the origin whose normal is the axis of that number.
export function mirrored(mesh, axis) {
  const flip = (v) => v.map((value, k) => (k === axis ? -value : value));
  return transformed(mesh, flip, flip, true);
}

export function join(...meshes) {
  const joined = { positions: [], normals: [], indices: [] };
  for (const mesh of meshes) {
    const start = joined.positions.length / 3;
    for (const value of mesh.positions) joined.positions.push(value);
    for (const value of mesh.normals) joined.normals.push(value);
    for (const index of mesh.indices) joined.indices.push(index + start);
  }
  return {
    positions: new Float32Array(joined.positions),
    normals: new Float32Array(joined.normals),
    indices: new Uint16Array(joined.indices),
  };
}
