// Cameras: turning round the figure, and what a camera sees of a point.

/** @typedef {import("./types.js").Camera} Camera */

/**
 * @param {number} yaw radians, 0 = front, a quarter turn = its left side
 * @param {number} elevation radians, > 0 looks down
 * @param {number} [roll] radians, > 0 turns the figure clockwise
 * @returns {number[]} camera_from_world, row after row
 */
export function rotationFromAngles(yaw, elevation, roll = 0) {
  const [sy, cy, se, ce] = [Math.sin(yaw), Math.cos(yaw), Math.sin(elevation), Math.cos(elevation)];
  const right = [cy, 0, -sy];
  const down = [se * sy, -ce, se * cy];
  const forward = [-ce * sy, -se, -ce * cy];
  const [sr, cr] = [Math.sin(roll), Math.cos(roll)];
  const turned = right.map((v, i) => cr * v - sr * down[i]);
  const turnedDown = right.map((v, i) => sr * v + cr * down[i]);
  return [...turned, ...turnedDown, ...forward];
}

/**
 * The camera of a square turntable picture that shows all of the figure at zoom 1.
 * @param {{target: number[], reach: number, fill: number, k: number}} figure
 * @param {number[]} angles yaw, elevation and roll, radians
 * @param {number[]} size width and height, pixels
 * @param {number} [zoom]
 * @param {number[]} [pan] how far the figure is moved, of the picture's shorter side
 * @returns {Camera}
 */
export function turntableCamera(figure, [yaw, elevation, roll], size, zoom = 1, pan = [0, 0]) {
  const side = Math.min(size[0], size[1]);
  return {
    rotation: rotationFromAngles(yaw, elevation, roll),
    target: figure.target,
    scale: (zoom * figure.fill * side) / 2 / figure.reach,
    center: [size[0] / 2 + pan[0] * side, size[1] / 2 + pan[1] * side],
    size,
    k: figure.k,
    aspect: 1,
  };
}

/**
 * @param {Camera} camera
 * @param {number[]} point world
 * @returns {number[]} u, v, and depth past the target's plane
 */
export function project(camera, point) {
  const d = point.map((v, i) => v - camera.target[i]);
  const r = camera.rotation;
  const [x, y, z] = [0, 3, 6].map((i) => r[i] * d[0] + r[i + 1] * d[1] + r[i + 2] * d[2]);
  const near = 1 + camera.k * z;
  return [
    camera.center[0] + (camera.scale * x) / near,
    camera.center[1] + (camera.scale * camera.aspect * y) / near,
    z,
  ];
}

/**
 * @param {Camera} camera
 * @param {number} factor
 * @returns {Camera} of the picture at another size
 */
export function resized(camera, factor) {
  return {
    ...camera,
    scale: camera.scale * factor,
    center: camera.center.map((v) => v * factor),
    size: camera.size.map((v) => Math.max(1, Math.round(v * factor))),
  };
}
