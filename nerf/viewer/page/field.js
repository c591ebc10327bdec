// The trained field: read once at the hull's voxels, then seen along rays.
//
// The samples are those of `toonset render` (nerf/render/cast.py): steps of one length from where a
// ray enters the hull's box, opacity 1 - exp(-softplus(density) min(1, support)), ended where it is
// opaque. Blocks of voxels that hold nothing are leapt over.

import { Program, freeTarget, makeTarget, makeTexture } from "./gl.js";
import { arrayOf } from "./scene.js";

/** @typedef {import("./types.js").Camera} Camera */

const LOW = -12; // before softplus: of what a byte of density stands for
const HIGH = 12;

export const CAMERA = `
struct Camera { mat3 turn; vec3 target; vec2 scale; vec2 center; float k; };
vec3 seen_by(Camera c, vec3 point) {
  vec3 at = c.turn * (point - c.target);
  return vec3(c.center + c.scale * at.xy / max(1.0 + c.k * at.z, 1e-6), at.z);
}
vec3 point_at(Camera c, vec2 pixel, float depth) {
  vec2 plane = (pixel - c.center) / c.scale;
  return c.target + vec3(plane * (1.0 + c.k * depth), depth) * c.turn;
}
`;

/**
 * @param {Camera} camera
 * @param {string} [name]
 * @returns {Record<string, number[] | number>} uniforms of a `Camera`
 */
export function cameraUniforms(camera, name = "camera") {
  return {
    [`${name}.turn`]: camera.rotation,
    [`${name}.target`]: camera.target,
    [`${name}.scale`]: [camera.scale, camera.scale * camera.aspect],
    [`${name}.center`]: camera.center,
    [`${name}.k`]: camera.k,
  };
}

const MARCH = `${CAMERA}
uniform Camera camera;
uniform sampler3D field, support, safe_steps;
uniform vec3 low, box_low, box_high;
uniform float voxel, step_length, block;
uniform float finer; // pixels of the target per pixel of the camera's picture
uniform sampler2D nearest; // depth of what may be met first, on a coarse picture
uniform float tile; // pixels of its pixels' sides; 0: it is not known
layout(location = 0) out vec4 color;
layout(location = 1) out float depth;

void main() {
  vec2 plane = (gl_FragCoord.xy / finer - camera.center) / camera.scale;
  vec3 start = (camera.target + vec3(plane, 0.0) * camera.turn - low) / voxel;
  vec3 slope = vec3(camera.k * plane, 1.0) * camera.turn / voxel;
  vec3 safe = mix(slope, vec3(1e-9), lessThan(abs(slope), vec3(1e-9)));
  vec3 a = (box_low - start) / safe, b = (box_high - start) / safe;
  vec3 first = min(a, b), last = max(a, b);
  float near = max(max(first.x, first.y), first.z), far = min(min(last.x, last.y), last.z);
  if (camera.k > 0.0) near = max(near, -1.0 / camera.k);
  float step_depth = step_length * inversesqrt(1.0 + camera.k * camera.k * dot(plane, plane));
  float begin = near + 0.5 * step_depth, count = (far - near) / step_depth;
  vec3 place = start + slope * begin + 0.5, ahead = slope * step_depth;
  vec3 texel = 1.0 / vec3(textureSize(field, 0));
  ivec3 most = textureSize(safe_steps, 0) - 1;
  vec4 seen = vec4(0.0);
  float left = 1.0, number = 0.0;
  if (tile > 0.0) {
    float met = 1e9;
    ivec2 here = ivec2(gl_FragCoord.xy / finer / tile) + 1, end = textureSize(nearest, 0) - 1;
    for (int y = -1; y <= 1; y++) for (int x = -1; x <= 1; x++) {
      met = min(met, texelFetch(nearest, clamp(here + ivec2(x, y), ivec2(0), end), 0).r);
    }
    number = max(0.0, floor((met - 0.87 * voxel - near) / step_depth - 0.5));
  }
  for (int guard = 0; guard < 4096 && number < count && left > 0.001; guard++) {
    vec3 at = place + ahead * number;
    ivec3 cell = clamp(ivec3(floor(at / block)), ivec3(0), most);
    float leap = floor(texelFetch(safe_steps, cell, 0).r * 255.0 / 3.0 + 0.01);
    if (leap > 0.0) { number += 3.0 * leap; continue; }
    float weight = 0.0, moment = 0.0; // of three steps, which share a colour
    for (int i = 0; i < 3; i++, number += 1.0) {
      at = (place + ahead * number) * texel;
      float held = textureLod(support, at, 0.0).r;
      if (held <= 0.02) continue;
      float raw = mix(${LOW}.0, ${HIGH}.0, textureLod(field, at, 0.0).a);
      float kept = exp(-(max(raw, 0.0) + log(1.0 + exp(-abs(raw)))) * held);
      weight += left * (1.0 - kept);
      moment += left * (1.0 - kept) * number;
      left *= kept;
    }
    if (weight > 0.0) {
      vec3 color = textureLod(field, (place + ahead * (moment / weight)) * texel, 0.0).rgb;
      seen += vec4(weight * color, moment);
    }
  }
  float alpha = 1.0 - left;
  float whole = alpha >= 0.98 ? 1.0 / alpha : 1.0;
  color = vec4(seen.rgb, alpha) * whole;
  depth = alpha > 0.0 ? seen.a / alpha * step_depth + begin : 0.0;
}`;

/** Voxels on the rim of what may hold a sample, as points of a coarse picture. */
const RIM_POINTS = `${CAMERA}
uniform Camera camera;
uniform vec3 low;
uniform float voxel, tile;
uniform vec2 size, range;
in vec3 place;
out float depth;
void main() {
  vec3 seen = seen_by(camera, low + voxel * place);
  vec2 at = clamp(floor(seen.xy / tile + 1.0), vec2(0.0), size - 1.0) + 0.5;
  depth = seen.z;
  gl_Position = vec4(2.0 * at / size - 1.0, 2.0 * (depth - range.x) / (range.y - range.x) - 1.0, 1.0);
  gl_PointSize = 1.0;
}`;

const POINT_DEPTH = `
in float depth;
layout(location = 0) out float result;
void main() { result = depth; }`;

/** A field, ready to be seen. */
export class Field {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {any} record
   * @param {ArrayBuffer} blob
   */
  constructor(gl, record, blob) {
    this.gl = gl;
    this.record = record;
    const { hull, planes } = record;
    const volume = (/** @type {any} */ one) => {
      const [depth, height, width] = one.shape;
      return [width, height, depth];
    };
    this.size = volume(hull.support);
    const three = gl.TEXTURE_3D;
    this.support = makeTexture(gl, three, gl.R8, this.size, arrayOf(blob, hull.support), true);
    this.safe_steps = makeTexture(gl, three, gl.R8, volume(hull.safe_steps), arrayOf(blob, hull.safe_steps), false);
    this.volume = makeTexture(gl, three, gl.RGBA8, this.size, null, true);
    this.table = record.table
      ? makeTexture(gl, three, gl.R8, volume(record.table), arrayOf(blob, record.table), false)
      : null;
    const [layers, height, width] = planes.texels.shape;
    this.planes = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.RGBA8, [width, height, layers], arrayOf(blob, planes.texels), true);
    this.none = makeTexture(gl, gl.TEXTURE_2D, gl.R32F, [1, 1], null, false);
    this.reader = new Program(gl, readingShader(record, layers, [width, height]));
    this.march = new Program(gl, MARCH);
    this.points = new Program(gl, POINT_DEPTH, RIM_POINTS);
    /** @type {{list: WebGLVertexArrayObject, places: Float32Array} | null} */
    this.rim = null;
    this.blob = blob;
    /** @type {import("./gl.js").Target | null} */
    this.near = null;
  }

  /**
   * Find where rays begin, so that their steps are those of `toonset render`; else they begin a few
   * steps earlier or later.
   * @param {Camera} camera
   */
  approach(camera) {
    const { gl, record } = this;
    const { low, voxel } = record.hull;
    this.rim ??= this.rimPoints();
    const { list, places } = this.rim;
    const away = depthsOf(places, camera, low, voxel);
    const relative = 1 + camera.k * away[0] - camera.k * voxel;
    const sides = Math.max(camera.scale, camera.scale * camera.aspect);
    if (relative <= 0) return 0;
    const tile = Math.max(1, (voxel * sides) / relative);
    const size = camera.size.map((v) => Math.floor(v / tile) + 3);
    if (this.near && (this.near.width !== size[0] || this.near.height !== size[1])) {
      freeTarget(gl, this.near);
      this.near = null;
    }
    this.near ??= makeTarget(gl, size[0], size[1], [gl.R32F], true);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.near.frame);
    gl.viewport(0, 0, size[0], size[1]);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearBufferfv(gl.COLOR, 0, [1e9, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.enable(gl.DEPTH_TEST);
    gl.bindVertexArray(list);
    const range = [away[0] - voxel, away[1] + voxel];
    this.points.use({ ...cameraUniforms(camera), low, voxel, tile, size, range });
    gl.drawArrays(gl.POINTS, 0, places.length / 3);
    gl.bindVertexArray(null);
    gl.disable(gl.DEPTH_TEST);
    return tile;
  }

  /** @returns {{list: WebGLVertexArrayObject, places: Float32Array}} voxels beside what is empty */
  rimPoints() {
    const { gl } = this;
    const places = rimOf(/** @type {Uint8Array} */ (arrayOf(this.blob, this.record.hull.support)), this.size);
    const list = gl.createVertexArray();
    gl.bindVertexArray(list);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
    const at = gl.getAttribLocation(this.points.program, "place");
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
    return { list, places };
  }

  /** Read the field at the hull's voxels, once. */
  read() {
    const { gl, size, record } = this;
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, size[0], size[1]);
    gl.disable(gl.SCISSOR_TEST);
    const { low, voxel } = record.hull;
    this.reader.use({ planes: this.planes, safe_steps: this.safe_steps, low, voxel });
    for (let slice = 0; slice < size[2]; slice++) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.volume.texture, 0, slice);
      this.reader.use({ slice }).fill();
    }
    gl.deleteFramebuffer(frame);
    gl.deleteTexture(this.planes.texture);
  }

  /**
   * Fill the target that is bound: premultiplied colour and opacity, and depth.
   * @param {Camera} camera
   * @param {number} finer pixels of the target per pixel of the camera's picture
   * @param {number} [tile] of `approach`
   */
  see(camera, finer, tile = 0) {
    const { hull, step } = this.record;
    this.march
      .use({
        ...cameraUniforms(camera),
        field: this.volume,
        support: this.support,
        safe_steps: this.safe_steps,
        low: hull.low,
        box_low: hull.box[0],
        box_high: hull.box[1],
        voxel: hull.voxel,
        step_length: step,
        block: hull.block,
        finer,
        nearest: this.near?.textures[0] ?? this.none,
        tile,
      })
      .fill();
  }
}

/**
 * The decoder's weights are part of the shader: no texture is read as fast.
 * @param {any} record
 * @param {number} layers
 * @param {number[]} size of the planes' texture
 * @returns {string}
 */
function readingShader(record, layers, size) {
  const { planes, hidden, out, shape, cell, low } = record;
  const per = layers / 3;
  const vec = (/** @type {number[]} */ v) => `vec${v.length}(${v.map((x) => x.toExponential(7)).join(", ")})`;
  const four = (/** @type {number[]} */ row, /** @type {number} */ i) =>
    vec([0, 1, 2, 3].map((j) => row[4 * i + j] ?? 0));
  const lines = [];
  for (let group = 0; group < per; group++) {
    const parts = [0, 1, 2].map((p) => {
      const lows = four(planes.low[p], group);
      const steps = four(planes.step[p].map((/** @type {number} */ v) => 255 * v), group);
      return `${lows} + ${steps} * textureLod(planes, vec3(uv${p}, ${p * per + group}.0), 0.0)`;
    });
    lines.push(`vec4 f${group} = ${parts.join("\n    + ")};`);
  }
  lines.push(`vec4 raw = ${vec(out.bias)};`);
  hidden.weight.forEach((/** @type {number[]} */ row, /** @type {number} */ j) => {
    const sum = Array.from({ length: per }, (_, i) => `dot(f${i}, ${four(row, i)})`);
    const column = out.weight.map((/** @type {number[]} */ weights) => weights[j]);
    lines.push(`raw += max(0.0, ${sum.join(" + ")} + ${hidden.bias[j].toExponential(7)}) * ${vec(column)};`);
  });
  const uv = planes.axes.map(
    (/** @type {number[]} */ [a, b], /** @type {number} */ p) =>
      `vec2 uv${p} = (vec2(at[${b}], at[${a}]) + 0.5) / ${vec(size)};`,
  );
  return `
uniform highp sampler2DArray planes;
uniform sampler3D safe_steps;
uniform vec3 low;
uniform float voxel;
uniform int slice;
layout(location = 0) out vec4 result;

void main() {
  ivec3 here = ivec3(gl_FragCoord.xy, slice);
  result = vec4(0.0);
  if (texelFetch(safe_steps, here / ${record.hull.block}, 0).r > 0.0) return;
  vec3 at = clamp((low + voxel * vec3(here) - ${vec(low)}) / ${cell.toExponential(7)}, vec3(0.0), ${vec(shape)} - 1.0);
  ${uv.join("\n  ")}
  ${lines.join("\n  ")}
  float x = raw.x + ${record.densityShift.toExponential(7)};
  float depth = (max(x, 0.0) + log(1.0 + exp(-abs(x)))) * ${record.stepsPerCell.toExponential(7)};
  float soft = depth > 15.0 ? depth : log(max(exp(depth) - 1.0, 1e-6));
  result = vec4(1.0 / (1.0 + exp(-raw.yzw)), (clamp(soft, ${LOW}.0, ${HIGH}.0) + ${-LOW}.0) / ${HIGH - LOW}.0);
}`;
}

/**
 * @param {Float32Array} places of voxels
 * @param {Camera} camera
 * @param {number[]} low
 * @param {number} voxel
 * @returns {[number, number]} the least and the most depth past the camera's target
 */
function depthsOf(places, camera, low, voxel) {
  const [a, b, c] = camera.rotation.slice(6);
  const start = [a, b, c].reduce((sum, v, i) => sum + v * (low[i] - camera.target[i]), 0);
  let [least, most] = [Infinity, -Infinity];
  for (let i = 0; i < places.length; i += 3) {
    const depth = start + voxel * (a * places[i] + b * places[i + 1] + c * places[i + 2]);
    if (depth < least) least = depth;
    if (depth > most) most = depth;
  }
  return [least, most];
}

/**
 * @param {Uint8Array} support
 * @param {number[]} size voxels along x, y, z
 * @returns {Float32Array} places of voxels that may hold a sample beside others that may not
 */
function rimOf(support, [wide, high, deep]) {
  const solid = support.map((v) => Number(v > 5)); // of 255: EDGE in nerf/hull/hull.py
  const near = grownBy(solid, wide, high, deep, Math.max);
  const inner = grownBy(near, wide, high, deep, Math.min);
  const found = [];
  for (let z = 0, i = 0; z < deep; z++) {
    for (let y = 0; y < high; y++) for (let x = 0; x < wide; x++, i++) if (near[i] && !inner[i]) found.push(x, y, z);
  }
  return new Float32Array(found);
}

/**
 * @param {Uint8Array} cells
 * @param {number} wide
 * @param {number} high
 * @param {number} deep
 * @param {(...values: number[]) => number} choose the most or the least of three
 * @returns {Uint8Array} of each cell and its 26 neighbours; beyond the volume lies 0
 */
function grownBy(cells, wide, high, deep, choose) {
  const strides = [1, wide, wide * high];
  const sizes = [wide, high, deep];
  let from = cells;
  for (let axis = 0; axis < 3; axis++) {
    const [stride, size] = [strides[axis], sizes[axis]];
    const to = new Uint8Array(from.length);
    for (let i = 0; i < from.length; i++) {
      const at = Math.floor(i / stride) % size;
      to[i] = choose(from[i], at > 0 ? from[i - stride] : 0, at < size - 1 ? from[i + stride] : 0);
    }
    from = to;
  }
  return from;
}
