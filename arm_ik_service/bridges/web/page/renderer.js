// A small WebGL2 renderer: lit meshes, their shadows on the floor, a grid; as many views as a headset has.

import { multiplyMatrices } from "./math.js";
import { BACKGROUND } from "./palette.js";

const SUN = [-0.34, 0.81, -0.478]; // where light comes from, unit length

const SOLID = [`#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 clipFromWorld, worldFromMesh;
out vec3 worldPosition, worldNormal;
void main() {
  vec4 world = worldFromMesh * vec4(position, 1.0);
  worldPosition = world.xyz;
  worldNormal = inverse(transpose(mat3(worldFromMesh))) * normal;
  gl_Position = clipFromWorld * world;
}`, `#version 300 es
precision highp float;
in vec3 worldPosition, worldNormal;
uniform vec3 colour, eye, sun;
out vec4 shade;
void main() {
  vec3 n = normalize(worldNormal), v = normalize(eye - worldPosition), h = normalize(v + sun);
  float wrapped = max(0.0, (dot(n, sun) + 0.25) / 1.25);
  vec3 sky = mix(vec3(0.20, 0.19, 0.20), vec3(0.46, 0.50, 0.58), 0.5 + 0.5 * n.y);
  float gloss = 0.16 * pow(max(0.0, dot(n, h)), 36.0);
  float rim = 0.22 * pow(1.0 - max(0.0, dot(n, v)), 3.0) * (0.4 + 0.6 * n.y);
  vec3 linear = colour * colour * (sky + 0.78 * wrapped) + gloss + max(rim, 0.0);
  shade = vec4(sqrt(linear), 1.0);
}`];

const SHADOW = [`#version 300 es
layout(location = 0) in vec3 position;
uniform mat4 clipFromWorld, worldFromMesh;
uniform vec3 sun;
void main() {
  vec3 world = (worldFromMesh * vec4(position, 1.0)).xyz;
  gl_Position = clipFromWorld * vec4(world - sun * (world.y / sun.y) + vec3(0.0, 0.002, 0.0), 1.0);
}`, `#version 300 es
precision mediump float;
out vec4 shade;
void main() { shade = vec4(0.0, 0.0, 0.0, 0.34); }`];

const FLOOR = [`#version 300 es
uniform mat4 clipFromWorld;
out vec2 place;
const vec2 corners[4] = vec2[](vec2(-1, -1), vec2(-1, 1), vec2(1, -1), vec2(1, 1));
void main() {
  place = 7.0 * corners[gl_VertexID];
  gl_Position = clipFromWorld * vec4(place.x, 0.0, place.y, 1.0);
}`, `#version 300 es
precision highp float;
in vec2 place;
uniform vec3 background;
out vec4 shade;
float lines(float period, float width) {
  vec2 from = abs(fract(place / period - 0.5) - 0.5) * period;
  vec2 soft = fwidth(place) * 0.9;
  vec2 line = 1.0 - smoothstep(vec2(width), vec2(width) + soft, from);
  return max(line.x, line.y);
}
void main() {
  float far = smoothstep(1.0, 6.5, length(place));
  vec3 ground = mix(background * 1.75, background, far);
  vec3 marked = ground + vec3(0.10, 0.11, 0.13) * max(lines(1.0, 0.006), 0.35 * lines(0.25, 0.002)) * (1.0 - far);
  shade = vec4(marked, 1.0);
}`];

export class Renderer {
  #gl;
  #programs = {};
  #meshes = new Map();
  #sources = new Map();
  #nothing;

  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: true, stencil: true, alpha: false, xrCompatible: false });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.#gl = gl;
    this.#restore();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.#restore());
  }

  get gl() {
    return this.#gl;
  }

  setMeshes(meshes) {
    for (const [name, mesh] of Object.entries(meshes)) {
      this.#sources.set(name, mesh);
      this.#upload(name, mesh);
    }
  }

  // Draw into a framebuffer (null: the canvas) the views { viewport: [x, y, w, h], projection, view, eye }.
  draw(framebuffer, views, parts) {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.clearColor(...BACKGROUND, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    for (const { viewport, projection, view, eye } of views) {
      gl.viewport(...viewport);
      const clipFromWorld = multiplyMatrices(projection, view);
      this.#drawFloor(clipFromWorld);
      this.#drawShadows(clipFromWorld, parts);
      this.#drawSolids(clipFromWorld, eye, parts);
    }
  }

  #drawFloor(clipFromWorld) {
    const gl = this.#gl;
    const program = this.#use("floor");
    gl.disable(gl.CULL_FACE);
    gl.uniformMatrix4fv(program.clipFromWorld, false, clipFromWorld);
    gl.uniform3fv(program.background, BACKGROUND);
    gl.bindVertexArray(this.#nothing);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.enable(gl.CULL_FACE);
  }

  // The stencil lets each place be darkened once, however many parts shade it.
  #drawShadows(clipFromWorld, parts) {
    const gl = this.#gl;
    const program = this.#use("shadow");
    gl.disable(gl.CULL_FACE);
    gl.depthMask(false);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 0xff);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.uniformMatrix4fv(program.clipFromWorld, false, clipFromWorld);
    gl.uniform3fv(program.sun, SUN);
    for (const part of parts) if (part.mesh !== "ray") this.#drawMesh(program, part);
    gl.disable(gl.STENCIL_TEST);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    gl.enable(gl.CULL_FACE);
  }

  #drawSolids(clipFromWorld, eye, parts) {
    const gl = this.#gl;
    const program = this.#use("solid");
    gl.uniformMatrix4fv(program.clipFromWorld, false, clipFromWorld);
    gl.uniform3fv(program.eye, eye);
    gl.uniform3fv(program.sun, SUN);
    for (const part of parts) {
      gl.uniform3fv(program.colour, part.colour);
      this.#drawMesh(program, part);
    }
  }

  #drawMesh(program, { mesh, matrix }) {
    const gl = this.#gl;
    const { vertices, count } = this.#meshes.get(mesh);
    gl.uniformMatrix4fv(program.worldFromMesh, false, matrix);
    gl.bindVertexArray(vertices);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, 0);
  }

  #use(name) {
    this.#gl.useProgram(this.#programs[name].program);
    return this.#programs[name];
  }

  #restore() {
    const gl = this.#gl;
    this.#programs = {
      solid: this.#compile(SOLID, ["clipFromWorld", "worldFromMesh", "colour", "eye", "sun"]),
      shadow: this.#compile(SHADOW, ["clipFromWorld", "worldFromMesh", "sun"]),
      floor: this.#compile(FLOOR, ["clipFromWorld", "background"]),
    };
    this.#nothing = gl.createVertexArray();
    this.#meshes.clear();
    for (const [name, mesh] of this.#sources) this.#upload(name, mesh);
  }

  #compile([vertex, fragment], uniforms) {
    const gl = this.#gl;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
    }
    gl.linkProgram(program);
    return { program, ...Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(program, name)])) };
  }

  #upload(name, mesh) {
    const gl = this.#gl;
    const before = this.#meshes.get(name);
    if (before) {
      gl.deleteVertexArray(before.vertices);
      before.buffers.forEach((buffer) => gl.deleteBuffer(buffer));
    }
    const vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    const buffers = [mesh.positions, mesh.normals].map((values, location) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, 3, gl.FLOAT, false, 0, 0);
      return buffer;
    });
    const indices = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.#meshes.set(name, { vertices, count: mesh.indices.length, buffers: [...buffers, indices] });
  }
}
