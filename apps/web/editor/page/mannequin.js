// The mannequin as a camera sees it: its outline as a path, and the points of its surface.

import { rotationFromAngles } from "../../viewer/page/camera.js";

/** @typedef {import("./types.js").CameraSaid} CameraSaid */
/** @typedef {import("./types.js").Point} Point */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").ViewRecord} ViewRecord */
/** @typedef {CameraSaid & {k: number, aspect: number}} Pose a camera that looks at the mannequin's middle */
/** @typedef {{vertices: Float32Array, faces: Uint32Array, edges: Int32Array, middle: number[], height: number}} Body */

const DEGREE = Math.PI / 180;

/** @param {Scene} scene @returns {Body | null} */
export function bodyOf({ mannequin }) {
  if (!mannequin) return null;
  const { middle, height } = mannequin;
  const vertices = new Float32Array(bytesOf(mannequin.vertices));
  const faces = new Uint32Array(bytesOf(mannequin.faces));
  return { vertices, faces, edges: edgesOf(faces, vertices.length / 3), middle, height };
}

/**
 * @param {Uint32Array} faces
 * @param {number} count of vertices
 * @returns {Int32Array} two corners and two faces of every edge; -1 where there is no second face
 */
function edgesOf(faces, count) {
  /** @type {Map<number, number>} */
  const known = new Map();
  const edges = [];
  for (let face = 0; face < faces.length / 3; face++) {
    for (let i = 0; i < 3; i++) {
      const [a, b] = [faces[3 * face + i], faces[3 * face + ((i + 1) % 3)]];
      const key = Math.min(a, b) * count + Math.max(a, b);
      const at = known.get(key);
      if (at !== undefined && edges[at + 3] < 0) edges[at + 3] = face;
      else known.set(key, edges.push(a, b, face, -1) - 4);
    }
  }
  return Int32Array.from(edges);
}

/** @param {string} text base64 @returns {ArrayBuffer} */
function bytesOf(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

/**
 * @param {ViewRecord} view
 * @param {number[]} middle of the mannequin, or of the world where there is none
 * @returns {Pose} what the view's camera is, for that point
 */
export function poseOf(view, middle) {
  const { rotation: r, target, scale, center, k, aspect } = view.camera;
  const d = middle.map((v, i) => v - target[i]);
  const [x, y, z] = [0, 3, 6].map((i) => r[i] * d[0] + r[i + 1] * d[1] + r[i + 2] * d[2]);
  const near = 1 + k * z;
  return {
    yaw: view.yaw,
    elevation: view.elevation,
    roll: view.roll,
    scale: scale / near,
    middle: [center[0] + (scale * x) / near, center[1] + (scale * aspect * y) / near],
    k: k / near,
    aspect,
  };
}

/** @param {Pose} pose @returns {CameraSaid} as it is written down */
export function cameraSaid({ yaw, elevation, roll, scale, middle }) {
  const short = (/** @type {number} */ value) => Number(value.toFixed(3));
  return {
    yaw: short(yaw),
    elevation: short(elevation),
    roll: short(roll),
    scale: short(scale),
    middle: middle.map(short),
  };
}

/**
 * @param {Body} body
 * @param {Pose} pose
 * @returns {Float32Array} x, y in pixels of the sheet and depth of every vertex
 */
export function projected({ vertices, middle }, pose) {
  const r = rotationFromAngles(pose.yaw * DEGREE, pose.elevation * DEGREE, pose.roll * DEGREE);
  const out = new Float32Array(vertices.length);
  for (let i = 0; i < vertices.length; i += 3) {
    const [a, b, c] = [vertices[i] - middle[0], vertices[i + 1] - middle[1], vertices[i + 2] - middle[2]];
    const z = r[6] * a + r[7] * b + r[8] * c;
    const scale = pose.scale / (1 + pose.k * z);
    out[i] = pose.middle[0] + scale * (r[0] * a + r[1] * b + r[2] * c);
    out[i + 1] = pose.middle[1] + scale * pose.aspect * (r[3] * a + r[4] * b + r[5] * c);
    out[i + 2] = z;
  }
  return out;
}

/**
 * @param {Body} body
 * @param {Float32Array} points projected
 * @returns {Path2D} filled, what the mannequin covers: all triangles turn the same way
 */
export function silhouette({ faces }, points) {
  const path = new Path2D();
  for (let i = 0; i < faces.length; i += 3) {
    let [a, b, c] = [3 * faces[i], 3 * faces[i + 1], 3 * faces[i + 2]];
    if (areaOf(points, a, b, c) < 0) [b, c] = [c, b];
    path.moveTo(points[a], points[a + 1]);
    path.lineTo(points[b], points[b + 1]);
    path.lineTo(points[c], points[c + 1]);
    path.closePath();
  }
  return path;
}

/**
 * @param {Body} body
 * @param {Float32Array} points projected
 * @returns {Path2D} edges between faces that look here and faces that look away: the outline is of these
 */
export function contour({ faces, edges }, points) {
  const path = new Path2D();
  const side = (/** @type {number} */ face) =>
    areaOf(points, 3 * faces[3 * face], 3 * faces[3 * face + 1], 3 * faces[3 * face + 2]) > 0;
  for (let i = 0; i < edges.length; i += 4) {
    if (edges[i + 3] >= 0 && side(edges[i + 2]) === side(edges[i + 3])) continue;
    path.moveTo(points[3 * edges[i]], points[3 * edges[i] + 1]);
    path.lineTo(points[3 * edges[i + 1]], points[3 * edges[i + 1] + 1]);
  }
  return path;
}

/** @param {Float32Array} points @returns {number[]} left, top, right, bottom */
export function boundsOf(points) {
  const bounds = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 3) {
    bounds[0] = Math.min(bounds[0], points[i]);
    bounds[1] = Math.min(bounds[1], points[i + 1]);
    bounds[2] = Math.max(bounds[2], points[i]);
    bounds[3] = Math.max(bounds[3], points[i + 1]);
  }
  return bounds;
}

/**
 * @param {Body} body
 * @param {Float32Array} points projected
 * @param {Point} at
 * @returns {number[] | null} the point of the surface that is seen there, world
 */
export function surfacePoint({ vertices, faces }, points, [x, y]) {
  let nearest = Infinity;
  let found = null;
  for (let i = 0; i < faces.length; i += 3) {
    const corners = [3 * faces[i], 3 * faces[i + 1], 3 * faces[i + 2]];
    const [a, b, c] = corners;
    const area = areaOf(points, a, b, c);
    if (!area) continue;
    const side = (/** @type {number} */ p, /** @type {number} */ q) =>
      ((points[q] - points[p]) * (y - points[p + 1]) - (points[q + 1] - points[p + 1]) * (x - points[p])) /
      area;
    const shares = [side(b, c), side(c, a), side(a, b)];
    if (shares.some((share) => share < 0)) continue;
    const depth = shares.reduce((sum, share, j) => sum + share * points[corners[j] + 2], 0);
    if (depth >= nearest) continue;
    nearest = depth;
    found = [0, 1, 2].map((axis) =>
      shares.reduce((sum, share, j) => sum + share * vertices[corners[j] + axis], 0),
    );
  }
  return found;
}

/** @param {Float32Array} p @param {number} a @param {number} b @param {number} c @returns {number} */
function areaOf(p, a, b, c) {
  return (p[b] - p[a]) * (p[c + 1] - p[a + 1]) - (p[b + 1] - p[a + 1]) * (p[c] - p[a]);
}

/**
 * Draws it in light and shade, the farthest faces first, so that a person finds its arms.
 * @param {CanvasRenderingContext2D} context
 * @param {Body} body
 * @param {Float32Array} points projected
 * @param {number} scale pixels per world unit
 */
export function drawShaded(context, { faces }, points, scale) {
  const order = [];
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [3 * faces[i], 3 * faces[i + 1], 3 * faces[i + 2]];
    order.push({ a, b, c, depth: points[a + 2] + points[b + 2] + points[c + 2] });
  }
  order.sort((one, other) => other.depth - one.depth);
  for (const { a, b, c } of order) {
    const light = 80 + 150 * facing(points, a, b, c, scale);
    context.fillStyle = context.strokeStyle = `rgb(${light * 0.75} ${light * 0.9} ${light})`;
    context.beginPath();
    context.moveTo(points[a], points[a + 1]);
    context.lineTo(points[b], points[b + 1]);
    context.lineTo(points[c], points[c + 1]);
    context.fill();
  }
}

/** @param {Float32Array} p @param {number} a @param {number} b @param {number} c @param {number} scale @returns {number} 1 = towards the eye, 0 = aside */
function facing(p, a, b, c, scale) {
  const along = (/** @type {number} */ q) => [
    (p[q] - p[a]) / scale,
    (p[q + 1] - p[a + 1]) / scale,
    p[q + 2] - p[a + 2],
  ];
  const [u, v] = [along(b), along(c)];
  const normal = [0, 1, 2].map((i) => u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
  return Math.abs(normal[2]) / (Math.hypot(...normal) || 1);
}
