// The drawings' cameras as small pyramids round the figure, with an arc of one sigma of yaw.

import { project, rotationFromAngles } from "./camera.js";
import { part, svgElement } from "./elements.js";
import { RADIAN, shownCamera } from "./framing.js";
import { snap } from "./timeline.js";

/** @typedef {import("./types.js").Camera} Camera */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").ViewRecord} ViewRecord */
/** @typedef {import("./state.js").State} State */

const FRUSTUM_AWAY = 1.9; // from the figure's middle, in its reaches
const FRUSTUM_LENGTH = 0.42; // of a pyramid
const FRUSTUM_WIDTH = 0.2; // half of its base's longer side
const NEAREST_DEPTH = 0.15; // depth, in distances of the camera: what is nearer is left out
const ARC_STEPS = 8;

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 */
export function createFrusta(scene, store) {
  const layers = ["frusta_behind", "frusta_front"].map((id) => part(id, SVGSVGElement));
  const toggle = part("cameras", HTMLButtonElement);
  const lines = scene.views.map((view, i) => frustumLines(scene, view, i));
  const marks = scene.views.map((view, i) => {
    const paths = layers.map((layer) =>
      layer.appendChild(svgElement("path", { "data-verdict": view.verdict })),
    );
    const label = layers[1].appendChild(svgElement("text", { "data-verdict": view.verdict }));
    const target = layers[1].appendChild(svgElement("circle", { r: "16" }));
    label.textContent = String(i + 1);
    target.addEventListener("click", () => snap(scene, store, i));
    return { paths, label, target };
  });

  /** @param {State} state */
  function show(state) {
    const shown = state.cameras && state.snapped < 0;
    toggle.setAttribute("aria-pressed", String(shown));
    for (const layer of layers) {
      layer.toggleAttribute("hidden", !shown);
      layer.setAttribute("viewBox", `0 0 ${state.size.join(" ")}`);
    }
    if (!shown) return;
    const camera = shownCamera(scene, state);
    const unit = state.size[0] / (part("stage", HTMLElement).clientWidth || 1); // of a CSS pixel
    marks.forEach(({ paths, label, target }, i) => {
      const { path, eye } = drawnPath(camera, lines[i]);
      const front = eye[2] < 0 ? 1 : 0;
      paths[front].setAttribute("d", path);
      paths[1 - front].setAttribute("d", "");
      target.setAttribute("r", String(16 * unit));
      label.setAttribute("font-size", String(12 * unit));
      for (const [mark, moved] of /** @type {const} */ ([
        [target, 0],
        [label, 16 * unit],
      ])) {
        mark.setAttribute("transform", `translate(${eye[0]} ${eye[1] - moved})`);
        mark.toggleAttribute("hidden", !path);
      }
    });
  }

  toggle.hidden = !lines.length;
  toggle.addEventListener("click", () => {
    const cameras = !store.state.cameras || store.state.snapped >= 0;
    store.set({ cameras, snapped: -1 });
  });
  store.listen((state, old) => {
    if (state.cameras || old.cameras) show(state);
  });
  show(store.state);
}

/**
 * @param {Scene} scene
 * @param {ViewRecord} view
 * @param {number} i of the view: arcs of drawings that lie close are apart
 * @returns {number[][][]} polylines of world points; the first begins at the eye
 */
function frustumLines(scene, view, i) {
  const { target, reach } = scene.figure;
  const { rotation, size } = view.camera;
  const longer = Math.max(...size);
  const [w, h] = size.map((v) => (v / longer) * FRUSTUM_WIDTH * reach);
  /** @type {(axes: number[], right: number, down: number, forward: number) => number[]} */
  const point = (axes, right, down, forward) =>
    target.map((v, axis) => v + right * axes[axis] + down * axes[axis + 3] + forward * axes[axis + 6]);
  const eye = point(rotation, 0, 0, -FRUSTUM_AWAY * reach);
  const base = [
    [-w, -h],
    [w, -h],
    [w, h],
    [-w, h],
  ].map(([x, y]) => point(rotation, x, y, (FRUSTUM_LENGTH - FRUSTUM_AWAY) * reach));
  const sides = base.map((corner) => [eye, corner]);
  const spread = view.sigma ? Math.min(180, view.sigma.yaw) : 0;
  const steps = Array.from({ length: ARC_STEPS + 1 }, (_, step) => (step / ARC_STEPS) * 2 - 1);
  const away = -(FRUSTUM_AWAY + 0.06 + (i % 3) * 0.03) * reach;
  const arc = steps.map((t) =>
    point(rotationFromAngles((view.yaw + t * spread) * RADIAN, view.elevation * RADIAN), 0, 0, away),
  );
  return [...sides, [...base, base[0]], ...(spread ? [arc] : [])];
}

/**
 * @param {Camera} camera
 * @param {number[][][]} lines
 * @returns {{path: string, eye: number[]}} an empty path where a point is too near
 */
function drawnPath(camera, lines) {
  const seen = lines.map((line) => line.map((point) => project(camera, point)));
  const eye = seen[0][0];
  if (seen.flat().some(([, , z]) => 1 + camera.k * z < NEAREST_DEPTH)) return { path: "", eye };
  const path = seen
    .map((line) => "M" + line.map(([u, v]) => `${u.toFixed(1)} ${v.toFixed(1)}`).join("L"))
    .join("");
  return { path, eye };
}
