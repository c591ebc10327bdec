// The trained field: read once at the hull's voxels, then seen along rays.
//
// The samples are those of `toonset render` (nerf/render/cast.py): steps of one length from where a
// ray enters the hull's box, opacity 1 - exp(-softplus(density) min(1, support)), ended where it is
// opaque. Blocks of voxels that hold nothing are leapt over.

import { Program, makeTexture } from "./gl.js";
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
uniform sampler3D field, support, leaps;
uniform vec3 low, box_low, box_high;
uniform float voxel, step_length, block;
uniform vec2 grid; // pixels of the target per pixel of the camera's picture, and unused
layout(location = 0) out vec4 color;
layout(location = 1) out float depth;

void main() {
  vec2 plane = (gl_FragCoord.xy / grid.x - camera.center) / camera.scale;
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
  ivec3 most = textureSize(leaps, 0) - 1;
  vec4 seen = vec4(0.0);
  float left = 1.0, number = 0.0;
  for (int guard = 0; guard < 4096 && number < count && left > 0.001; guard++) {
    vec3 at = place + ahead * number;
    ivec3 cell = clamp(ivec3(floor(at / block)), ivec3(0), most);
    float leap = texelFetch(leaps, cell, 0).r;
    if (leap > 0.0) { number += round(leap * 255.0); continue; }
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
    this.leaps = makeTexture(gl, three, gl.R8, volume(hull.leaps), arrayOf(blob, hull.leaps), false);
    this.volume = makeTexture(gl, three, gl.RGBA8, this.size, null, true);
    this.table = record.table
      ? makeTexture(gl, three, gl.R8, volume(record.table), arrayOf(blob, record.table), false)
      : null;
    const [layers, height, width] = planes.texels.shape;
    this.planes = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.RGBA8, [width, height, layers], arrayOf(blob, planes.texels), true);
    this.reader = new Program(gl, readingShader(record, layers, [width, height]));
    this.march = new Program(gl, MARCH);
    this.slices = 0;
  }

  /**
   * Read some slices of the volume.
   * @param {number} most so many
   * @returns {boolean} whether all are read
   */
  read(most) {
    const { gl, size, record } = this;
    if (this.slices >= size[2]) return true;
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, size[0], size[1]);
    gl.disable(gl.SCISSOR_TEST);
    const { hull } = record;
    this.reader.use({ planes: this.planes, leaps: this.leaps, low: hull.low, voxel: hull.voxel });
    const end = Math.min(size[2], this.slices + most);
    for (; this.slices < end; this.slices++) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.volume.texture, 0, this.slices);
      this.reader.use({ slice: this.slices }).fill();
    }
    gl.deleteFramebuffer(frame);
    if (this.slices < size[2]) return false;
    gl.deleteTexture(this.planes.texture);
    return true;
  }

  /**
   * Fill the target that is bound: premultiplied colour and opacity, and depth.
   * @param {Camera} camera
   * @param {number} finer pixels of the target per pixel of the camera's picture
   */
  see(camera, finer) {
    const { hull, step } = this.record;
    this.march
      .use({
        ...cameraUniforms(camera),
        field: this.volume,
        support: this.support,
        leaps: this.leaps,
        low: hull.low,
        box_low: hull.box[0],
        box_high: hull.box[1],
        voxel: hull.voxel,
        step_length: step,
        block: hull.block,
        grid: [finer, 0],
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
uniform sampler3D leaps;
uniform vec3 low;
uniform float voxel;
uniform int slice;
layout(location = 0) out vec4 result;

void main() {
  ivec3 here = ivec3(gl_FragCoord.xy, slice);
  result = vec4(0.0);
  if (texelFetch(leaps, here / ${record.hull.block}, 0).r > 0.0) return;
  vec3 at = clamp((low + voxel * vec3(here) - ${vec(low)}) / ${cell.toExponential(7)}, vec3(0.0), ${vec(shape)} - 1.0);
  ${uv.join("\n  ")}
  ${lines.join("\n  ")}
  float x = raw.x + ${record.densityShift.toExponential(7)};
  float depth = (max(x, 0.0) + log(1.0 + exp(-abs(x)))) * ${record.stepsPerCell.toExponential(7)};
  float soft = depth > 15.0 ? depth : log(max(exp(depth) - 1.0, 1e-6));
  result = vec4(1.0 / (1.0 + exp(-raw.yzw)), (clamp(soft, ${LOW}.0, ${HIGH}.0) + ${-LOW}.0) / ${HIGH - LOW}.0);
}`;
}
