// A mannequin that is the character's own body: its surface takes the place of the field's.
//
// As in nerf/hull/mannequin_shape.py: triangles at FINER samples per pixel and axis, their outline a
// little beyond; lines where one part hides another (nerf/look/step_lines.py); the sheet's shadow by
// smoothed normals (nerf/look/shade.py).

import { CAMERA, cameraUniforms } from "./field.js";
import { Program, freeTarget, makeTarget } from "./gl.js";
import { NOWHERE, RAYS } from "./field_layers.js";
import { arrayOf } from "./scene.js";

/** @typedef {import("./types.js").Camera} Camera */
/** @typedef {import("./gl.js").Target} Target */
/** @typedef {import("./gl.js").Texture} Texture */

const FINEST = 3; // samples per pixel and axis
const MOST_SAMPLES = 4096; // of a picture's side
const WIDEST = 40; // samples that a line reaches

const TRIANGLES = `${CAMERA}
uniform Camera camera;
uniform vec2 size, range;
uniform float beyond;
in vec3 position, normal;
out vec3 local, round_normal;
void main() {
  local = camera.turn * (position + beyond * normal - camera.target);
  round_normal = camera.turn * normal;
  float near = 1.0 + camera.k * local.z;
  vec2 pixel = camera.center * near + camera.scale * local.xy;
  float depth = 0.98 * (local.z - range.x) / (range.y - range.x) + (beyond > 0.0 ? 0.01 : -0.99);
  gl_Position = vec4(2.0 * pixel / size - near, depth * near, near);
}`;

const SURFACES = `
uniform bool still;
in vec3 local, round_normal;
layout(location = 0) out float depth;
layout(location = 1) out vec4 normal; // in camera axes, towards the viewer; whether there is one
void main() {
  depth = local.z;
  vec3 flat_normal = still ? cross(dFdx(local), dFdy(local)) : round_normal;
  flat_normal *= flat_normal.z > 0.0 && still ? -1.0 : 1.0;
  normal = vec4(normalize(flat_normal) * 0.5 + 0.5, 1.0);
}`;

/** As `SEEN`: coverage and depth of the shape, colour and label of the field. */
const COVERED = `${RAYS}
uniform sampler2D fine_surface;
uniform int finer;
layout(location = 0) out vec4 color;
layout(location = 1) out float depth;
layout(location = 2) out vec4 label;
layout(location = 3) out vec4 four;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float cover = 0.0;
  for (int y = 0; y < finer; y++) for (int x = 0; x < finer; x++) {
    cover += float(texelFetch(fine_surface, finer * at + ivec2(x, y), 0).r > ${NOWHERE});
  }
  cover /= float(finer * finer);
  depth = texelFetch(fine_surface, finer * at + finer / 2, 0).r;
  vec4 seen = ray(at);
  int own = labelled ? label_of(seen) : -1;
  color = vec4(clamp(seen.rgb / max(seen.a, 0.2), 0.0, 1.0) * cover, cover);
  label = vec4(own < 0 ? 1.0 : float(own) / 255.0, 0.0, 0.0, 1.0);
  four = label;
}`;

/** Which samples lie on the near, and which on the far side of a step. */
const STEPS = `
uniform sampler2D fine_surface;
uniform float least;
layout(location = 0) out vec4 result;
float depth_at(ivec2 at) {
  return texelFetch(fine_surface, clamp(at, ivec2(0), textureSize(fine_surface, 0) - 1), 0).r;
}
float slope(float a, float b) { return a <= ${NOWHERE} || b <= ${NOWHERE} ? 1e9 : b - a; }
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec2 found = vec2(0.0);
  for (int axis = 0; axis < 2; axis++) {
    ivec2 way = axis == 0 ? ivec2(1, 0) : ivec2(0, 1);
    float v[5];
    for (int i = 0; i < 5; i++) v[i] = depth_at(at + (i - 2) * way);
    float s[4];
    for (int i = 0; i < 4; i++) s[i] = slope(v[i], v[i + 1]);
    for (int side = 1; side < 3; side++) { // the step before this sample, and the one after it
      if (abs(s[side]) > 1e8) continue;
      float flatter = min(abs(s[side - 1]), abs(s[side + 1]));
      if (flatter > 1e8) flatter = 0.0;
      float toward = side == 2 ? s[side] : -s[side]; // > 0: the other sample is farther
      if (toward - flatter > least) found.x = 1.0;
      if (-toward - flatter > least) found.y = 1.0;
    }
  }
  result = vec4(found, float(depth_at(at) > ${NOWHERE}), 1.0);
}`;

/** Distance to the nearest marked sample, first along rows, then along columns. */
const DISTANCES = `
uniform sampler2D marks;
uniform int reach;
uniform bool rows;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(marks, 0) - 1;
  vec2 least = vec2(255.0);
  for (int i = -reach; i <= reach; i++) {
    vec4 other = texelFetch(marks, clamp(at + (rows ? ivec2(i, 0) : ivec2(0, i)), ivec2(0), most), 0);
    if (rows) least = min(least, mix(vec2(255.0), vec2(abs(i)), step(0.5, other.rg)));
    else least = min(least, sqrt(other.rg * other.rg * 65025.0 + float(i * i)));
  }
  result = vec4(min(least, 255.0) / 255.0, texelFetch(marks, at, 0).b, 1.0);
}`;

/** Lines at steps, and the shadow's tone. */
const STYLE = `
uniform sampler2D distances, normals;
uniform int finer;
uniform vec2 reaches; // of lines, onto the near and the far side, samples
uniform vec3 slope, factor;
uniform float level;
uniform bool lined, shaded;
layout(location = 0) out vec4 result; // tone; line
float logit(ivec2 at) {
  vec4 n = texelFetch(normals, clamp(at, ivec2(0), textureSize(normals, 0) - 1), 0);
  return n.a > 0.0 ? dot(normalize(n.rgb), slope) + level : level;
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float line = 0.0;
  if (lined) {
    for (int y = 0; y < finer; y++) for (int x = 0; x < finer; x++) {
      vec4 d = texelFetch(distances, finer * at + ivec2(x, y), 0) * 255.0;
      float reach = d.x < d.y ? reaches.x : reaches.y;
      line += clamp(reach - min(d.x, d.y), 0.0, 1.0) * step(0.5, d.z);
    }
    line /= float(finer * finer);
  }
  vec3 tone = vec3(1.0);
  if (shaded) {
    float here = logit(at);
    vec2 way = 0.5 * vec2(logit(at + ivec2(1, 0)) - logit(at - ivec2(1, 0)), logit(at + ivec2(0, 1)) - logit(at - ivec2(0, 1)));
    float dark = clamp(here / max(length(way), 1e-4) + 0.5, 0.0, 1.0);
    tone = 1.0 - dark * (1.0 - factor);
  }
  result = vec4(tone, line);
}`;

/** A plain body in the light, for bundles without a field. */
const LIT = `
uniform sampler2D fine_surface, normals;
uniform int finer;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  result = vec4(0.0);
  for (int y = 0; y < finer; y++) for (int x = 0; x < finer; x++) {
    ivec2 place = finer * at + ivec2(x, y);
    if (texelFetch(fine_surface, place, 0).r <= ${NOWHERE}) continue;
    vec3 n = texelFetch(normals, place, 0).rgb * 2.0 - 1.0;
    float light = 0.55 + 0.45 * clamp(dot(n, normalize(vec3(-0.4, -0.6, -0.7))), 0.0, 1.0);
    result += vec4(light * vec3(0.62, 0.70, 0.80), 1.0);
  }
  result /= float(finer * finer);
}`;

/** Normals smoothed along one axis. */
const SMOOTH = `
uniform sampler2D normals;
uniform int finer;
uniform bool rows;
uniform float sigma;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 sum = vec4(0.0);
  int reach = int(ceil(3.0 * sigma));
  for (int i = -reach; i <= reach; i++) {
    ivec2 place = finer * (at + (rows ? ivec2(i, 0) : ivec2(0, i))) + finer / 2;
    if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, textureSize(normals, 0)))) continue;
    vec4 n = texelFetch(normals, place, 0);
    if (finer > 0 && rows) n = vec4((n.rgb * 2.0 - 1.0) * n.a, n.a);
    sum += exp(-float(i * i) / (2.0 * sigma * sigma)) * n;
  }
  result = sum / (sigma * 2.5066);
}`;

/** The mannequin's surface, ready to be drawn. */
export class Shape {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {any} record of the drawings
   * @param {ArrayBuffer} blob
   */
  constructor(gl, record, blob) {
    this.gl = gl;
    this.record = record;
    const vertices = /** @type {Float32Array} */ (arrayOf(blob, record.shape.vertices));
    const faces = /** @type {Uint32Array} */ (arrayOf(blob, record.shape.faces));
    this.triangles = new Program(gl, SURFACES, TRIANGLES);
    this.covered = new Program(gl, COVERED);
    this.steps = new Program(gl, STEPS);
    this.distances = new Program(gl, DISTANCES);
    this.smooth = new Program(gl, SMOOTH);
    this.style = new Program(gl, STYLE);
    this.lit = new Program(gl, LIT);
    this.count = faces.length;
    this.range = rangeOf(vertices);
    this.lines = gl.createVertexArray();
    gl.bindVertexArray(this.lines);
    const parts = /** @type {[string, Float32Array][]} */ ([
      ["position", vertices],
      ["normal", normalsOf(vertices, faces)],
    ]);
    for (const [name, values] of parts) {
      const place = gl.getAttribLocation(this.triangles.program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    /** @type {Record<string, Target>} */
    this.targets = {};
  }

  /**
   * @param {number[]} size of the picture
   * @param {boolean} still
   * @returns {number} samples per pixel and axis
   */
  sized([width, height], still) {
    const { gl } = this;
    const finer = still ? Math.max(1, Math.min(FINEST, Math.floor(MOST_SAMPLES / Math.max(width, height)))) : 1;
    const { surface, style } = this.targets;
    const fits = surface && surface.width === finer * width && style.width === width && style.height === height;
    if (fits) return finer;
    for (const target of Object.values(this.targets)) freeTarget(gl, target);
    const fine = (/** @type {number[]} */ formats, solid = false) =>
      makeTarget(gl, finer * width, finer * height, formats, solid, solid);
    this.targets = {
      surface: fine([gl.R32F, gl.RGBA8], true),
      steps: fine([gl.RGBA8]),
      rows: fine([gl.RGBA8]),
      smooth_rows: makeTarget(gl, width, height, [gl.RGBA16F]),
      smooth: makeTarget(gl, width, height, [gl.RGBA16F]),
      style: makeTarget(gl, width, height, [gl.RGBA8]),
    };
    return finer;
  }

  /**
   * Draw the triangles.
   * @param {Camera} camera
   * @param {boolean} still
   * @param {(target: Target, finer?: number) => void} bind
   * @returns {{finer: number, depth: Texture, normal: Texture}}
   */
  see(camera, still, bind) {
    const { gl } = this;
    const finer = this.sized(camera.size, still);
    bind(this.targets.surface, finer);
    gl.clearBufferfv(gl.COLOR, 0, [Number(NOWHERE), 0, 0, 0]);
    gl.clearBufferfv(gl.COLOR, 1, [0.5, 0.5, 0.5, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.enable(gl.DEPTH_TEST);
    gl.bindVertexArray(this.lines);
    const at = camera.rotation.slice(6).reduce((sum, v, i) => sum + v * (this.range.middle[i] - camera.target[i]), 0);
    const range = [at - this.range.radius, at + this.range.radius];
    const size = camera.size;
    const { beyond } = this.record.shape;
    for (const by of beyond > 0 ? [0, beyond] : [0]) {
      this.triangles.use({ ...cameraUniforms(camera), size, range, beyond: by, still });
      gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_INT, 0);
    }
    gl.bindVertexArray(null);
    gl.disable(gl.DEPTH_TEST);
    const [depth, normal] = this.targets.surface.textures;
    return { finer, depth, normal };
  }

  /**
   * Draw a plain body.
   * @param {Camera} camera
   * @param {boolean} still
   * @param {(target: Target, finer?: number) => void} bind
   * @param {Target} into
   */
  body(camera, still, bind, into) {
    const { finer, depth, normal } = this.see(camera, still, bind);
    bind(into);
    this.lit.use({ fine_surface: depth, normals: normal, finer }).fill();
  }

  /** @returns {number[][]} corners of a box that holds it, world */
  corners() {
    const { middle, radius } = this.range;
    return Array.from({ length: 8 }, (_, i) => middle.map((v, axis) => v + ((i >> axis) & 1 ? radius : -radius)));
  }

  /**
   * Fill a target like that of `SEEN`, and find lines and tones.
   * @param {Camera} camera
   * @param {Record<string, any>} rays
   * @param {Target} seen
   * @param {(target: Target, finer?: number) => void} bind
   * @param {number} lineScale pixels of the view per pixel of the drawings, for lines
   * @returns {Texture} tone, and how far lines cover a pixel
   */
  cover(camera, rays, seen, bind, lineScale) {
    const { finer, depth, normal } = this.see(camera, true, bind);
    const { record, targets } = this;
    bind(seen);
    this.covered.use({ ...rays, fine_surface: depth, finer }).fill();
    const { steps, shade, height } = record;
    const reaches = steps ? [steps.near_px, steps.far_px].map((px) => px * finer * lineScale) : [0, 0];
    const lined = Boolean(steps && lineScale > 0);
    if (lined) {
      const reach = Math.min(WIDEST, Math.ceil(Math.max(...reaches)) + 1);
      bind(targets.steps, finer);
      this.steps.use({ fine_surface: depth, least: steps.least * height }).fill();
      bind(targets.rows, finer);
      this.distances.use({ marks: targets.steps.textures[0], reach, rows: true }).fill();
      bind(targets.steps, finer);
      this.distances.use({ marks: targets.rows.textures[0], reach, rows: false }).fill();
    }
    if (shade) {
      const sigma = Math.max(0.5, record.softNormals * height * camera.scale);
      bind(targets.smooth_rows);
      this.smooth.use({ normals: normal, finer, rows: true, sigma }).fill();
      bind(targets.smooth);
      this.smooth.use({ normals: targets.smooth_rows.textures[0], finer: 1, rows: false, sigma }).fill();
    }
    bind(targets.style);
    this.style
      .use({
        distances: targets.steps.textures[0],
        normals: targets.smooth.textures[0],
        finer,
        reaches,
        slope: shade?.slope ?? [0, 0, 0],
        factor: shade?.factor ?? [1, 1, 1],
        level: shade?.level ?? 0,
        lined,
        shaded: Boolean(shade),
      })
      .fill();
    return targets.style.textures[0];
  }
}

/**
 * @param {Float32Array} vertices
 * @returns {{middle: number[], radius: number}} a ball that holds all of them
 */
function rangeOf(vertices) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  vertices.forEach((v, i) => {
    low[i % 3] = Math.min(low[i % 3], v);
    high[i % 3] = Math.max(high[i % 3], v);
  });
  const middle = low.map((v, i) => (v + high[i]) / 2);
  return { middle, radius: 0.6 * Math.hypot(...low.map((v, i) => high[i] - v)) };
}

/**
 * @param {Float32Array} vertices
 * @param {Uint32Array} faces
 * @returns {Float32Array} unit normals, means of the faces around weighted with their areas
 */
function normalsOf(vertices, faces) {
  const sums = new Float32Array(vertices.length);
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [faces[f], faces[f + 1], faces[f + 2]].map((v) => vertices.subarray(3 * v, 3 * v + 3));
    const u = [0, 1, 2].map((i) => b[i] - a[i]);
    const v = [0, 1, 2].map((i) => c[i] - a[i]);
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (let corner = 0; corner < 3; corner++) for (let i = 0; i < 3; i++) sums[3 * faces[f + corner] + i] += normal[i];
  }
  for (let v = 0; v < sums.length; v += 3) {
    const size = Math.hypot(sums[v], sums[v + 1], sums[v + 2]) || 1;
    for (let i = 0; i < 3; i++) sums[v + i] /= size;
  }
  return sums;
}
