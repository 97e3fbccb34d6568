// Vectors [x, y, z], quaternions [x, y, z, w], column-major 4x4 matrices. Metres and radians.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (s, a) => [s * a[0], s * a[1], s * a[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const normalize = (a) => scale(1 / Math.max(length(a), 1e-12), a);
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// First b, then a.
export function multiply(a, b) {
  const [ax, ay, az, aw] = a;
  const [bx, by, bz, bw] = b;
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

export function rotate(q, v) {
  const xyz = [q[0], q[1], q[2]];
  const t = scale(2, cross(xyz, v));
  return add(add(v, scale(q[3], t)), cross(xyz, t));
}

export function about(axis, angle) {
  return [...scale(Math.sin(angle / 2), axis), Math.cos(angle / 2)];
}

// The shortest rotation that takes +Y to the direction d.
export function fromY(d) {
  const [x, y, z] = normalize(d);
  if (y < -1 + 1e-9) return [1, 0, 0, 0];
  const q = [z, 0, -x, 1 + y];
  const n = Math.hypot(...q);
  return q.map((part) => part / n);
}

// The matrix of a pose, its axes stretched by `stretch`.
export function poseMatrix(position, q, stretch = [1, 1, 1]) {
  const x = scale(stretch[0], rotate(q, [1, 0, 0]));
  const y = scale(stretch[1], rotate(q, [0, 1, 0]));
  const z = scale(stretch[2], rotate(q, [0, 0, 1]));
  return new Float32Array([...x, 0, ...y, 0, ...z, 0, ...position, 1]);
}

// What is built along +Y from the origin, `built` metres long, stretched from `start` to `end`.
export function spanMatrix(start, end, built) {
  const axis = subtract(end, start);
  return poseMatrix(start, fromY(axis), [1, Math.max(length(axis), 1e-6) / built, 1]);
}

export function multiplyMatrices(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      out[4 * column + row] = sum;
    }
  }
  return out;
}

export function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(fieldOfView / 2);
  const depth = 1 / (near - far);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * depth, -1, 0, 0, 2 * far * near * depth, 0]);
}

// The view matrix of a camera at `eye` that looks at `target`, +Y up.
export function lookAt(eye, target) {
  const z = normalize(subtract(eye, target));
  const x = normalize(cross([0, 1, 0], z));
  const y = cross(z, x);
  return new Float32Array([
    x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1,
  ]);
}
