// The camera that the stage shows: on the turntable, or a drawing's own.

import { turntableCamera } from "./camera.js";
import { FARTHEST, STEEPEST, ZOOMS, clamp } from "./state.js";

/** @typedef {import("./types.js").Camera} Camera */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./state.js").State} State */
/** @typedef {Pick<State, "yaw" | "elevation" | "zoom" | "pan">} Pose */

const FILLED = 0.94; // of the stage, by a drawing
export const CAMERAS_ZOOM = 0.46; // where the cameras round the figure are to be seen
export const RADIAN = Math.PI / 180;

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {Camera} of the rendering
 */
export function shownCamera(scene, state) {
  const view = scene.views[state.snapped];
  if (!view) return orbitCamera(scene, state);
  const { x, y, factor } = drawingBox(view.camera.size, state);
  const moved = state.comparison === "beside" ? state.size[0] / 2 : 0;
  const [u, v] = view.camera.center;
  return {
    ...view.camera,
    scale: view.camera.scale * factor,
    center: [x + moved + u * factor, y + v * factor],
    size: state.size,
  };
}

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {Camera}
 */
function orbitCamera(scene, state) {
  const zoom = state.zoom * (state.cameras ? CAMERAS_ZOOM : 1);
  const [yaw, elevation] = [state.yaw * RADIAN, state.elevation * RADIAN];
  return turntableCamera(scene.figure, yaw, elevation, state.size, zoom, state.pan);
}

/**
 * @param {number[]} drawing its width and height, pixels
 * @param {State} state
 * @returns {{x: number, y: number, factor: number}} where it lies on the stage, and how enlarged
 */
export function drawingBox([width, height], { size, comparison }) {
  const room = comparison === "beside" ? size[0] / 2 : size[0];
  const factor = FILLED * Math.min(room / width, size[1] / height);
  return { x: (room - width * factor) / 2, y: (size[1] - height * factor) / 2, factor };
}

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {Pose} on the turntable: the same, or as near as can be to the drawing's camera
 */
export function poseOf(scene, state) {
  if (!scene.views[state.snapped]) return state;
  const camera = shownCamera(scene, state);
  const [x, y, z] = camera.rotation.slice(6);
  const whole = orbitCamera(scene, { ...state, zoom: 1, pan: [0, 0], cameras: false });
  const seen = offsetOf(camera, whole.target);
  const side = Math.min(...state.size);
  return limited({
    yaw: Math.atan2(-x, -z) / RADIAN,
    elevation: Math.asin(clamp(-y, -1, 1)) / RADIAN,
    zoom: camera.scale / whole.scale,
    pan: [0, 1].map((i) => (seen[i] - whole.center[i]) / side),
  });
}

/**
 * @param {Pose} pose
 * @returns {Pose} within what the page allows
 */
export function limited(pose) {
  return {
    yaw: pose.yaw,
    elevation: clamp(pose.elevation, -STEEPEST, STEEPEST),
    zoom: clamp(pose.zoom, ZOOMS[0], ZOOMS[1]),
    pan: pose.pan.map((v) => clamp(v, -FARTHEST, FARTHEST)),
  };
}

/**
 * @param {Camera} camera
 * @param {number[]} point world
 * @returns {number[]} its pixel, depth left out
 */
export function offsetOf(camera, point) {
  const d = point.map((v, i) => v - camera.target[i]);
  const [x, y] = [0, 3].map((row) => d.reduce((sum, v, i) => sum + v * camera.rotation[row + i], 0));
  return [camera.center[0] + camera.scale * x, camera.center[1] + camera.scale * camera.aspect * y];
}
