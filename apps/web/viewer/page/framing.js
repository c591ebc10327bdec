// The camera that the stage shows: of the nearest view on the turntable, or a drawing's own.

import { project, turntableCamera } from "./camera.js";
import { FARTHEST, ZOOMS, clamp } from "./state.js";

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
 * @returns {number} the view to show: a drawing's own, or the nearest that has the layer
 */
export function shownSight({ figure, sights, views }, { snapped, yaw, elevation, layer }) {
  if (views[snapped]) return views[snapped].sight;
  const off = figure.elevations.map((one) => Math.abs(one - elevation));
  const level = off.indexOf(Math.min(...off));
  const near = sights.map((sight) =>
    sight.level === level && layer in sight.layers ? Math.cos(sight.angles[0] - yaw * RADIAN) : -2,
  );
  return near.indexOf(Math.max(...near));
}

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {Camera} of the rendering
 */
export function shownCamera(scene, state) {
  const view = scene.views[state.snapped];
  if (!view) return sightCamera(scene, state, shownSight(scene, state));
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
 * @param {Pick<State, "zoom" | "pan" | "cameras" | "size">} state
 * @param {number} sight
 * @returns {Camera}
 */
function sightCamera({ figure, sights }, { zoom, pan, cameras, size }, sight) {
  return turntableCamera(figure, sights[sight].angles, size, zoom * (cameras ? CAMERAS_ZOOM : 1), pan);
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
  const view = scene.views[state.snapped];
  if (!view) return state;
  const camera = shownCamera(scene, state);
  const whole = sightCamera(scene, { ...state, zoom: 1, pan: [0, 0], cameras: false }, view.sight);
  const seen = project(camera, whole.target);
  const side = Math.min(...state.size);
  return limited(scene, {
    yaw: view.yaw,
    elevation: view.elevation,
    zoom: camera.scale / (1 + camera.k * seen[2]) / whole.scale,
    pan: [0, 1].map((i) => (seen[i] - whole.center[i]) / side),
  });
}

/**
 * @param {Scene} scene
 * @param {Pose} pose
 * @returns {Pose} within what the page allows
 */
export function limited({ figure: { elevations } }, pose) {
  return {
    yaw: pose.yaw,
    elevation: clamp(pose.elevation, elevations[0], elevations[elevations.length - 1]),
    zoom: clamp(pose.zoom, ZOOMS[0], ZOOMS[1]),
    pan: pose.pan.map((v) => clamp(v, -FARTHEST, FARTHEST)),
  };
}
