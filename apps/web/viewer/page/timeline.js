// The sheet's drawings in a row, with what calibration says of each; a click takes its camera.

import { element, part } from "./elements.js";
import { VERDICTS, badge, reasonOf } from "./verdict.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").ViewRecord} ViewRecord */

const THUMB = 144; // canvas pixels, of the longer side
const HINT = "Choose a drawing to compare the figure with it.";

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 * @param {(HTMLCanvasElement | null)[]} pictures
 */
export function createTimeline(scene, store, pictures) {
  const [list, line] = [part("drawings", HTMLElement), part("reason", HTMLElement)];
  const buttons = scene.views.map((view, i) => drawingButton(view, i, pictures[i]));

  /** @param {number} i */
  function tell(i) {
    const view = scene.views[i];
    const text = view ? element("bdi", {}, reasonOf(view)) : "";
    line.replaceChildren(view ? `Drawing ${i + 1}: ` : HINT, text);
  }

  buttons.forEach((button, i) => {
    button.addEventListener("click", () => snap(scene, store, i));
    button.addEventListener("focus", () => tell(i));
    button.addEventListener("blur", () => tell(store.state.snapped));
  });
  list.append(...buttons.map((button) => element("li", {}, button)));
  store.listen(({ snapped }, old) => {
    if (snapped === old.snapped) return;
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === snapped)));
    if (!list.contains(document.activeElement)) tell(snapped);
  });
  buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === store.state.snapped)));
  tell(store.state.snapped);
  part("timeline", HTMLElement).hidden = !buttons.length;
}

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 * @param {number} i the drawing whose camera the stage takes
 */
export function snap(scene, store, i) {
  if (scene.views[i]) store.set({ snapped: i, cameras: false });
}

/**
 * @param {ViewRecord} view
 * @param {number} i
 * @param {HTMLCanvasElement | null} picture
 * @returns {HTMLButtonElement}
 */
function drawingButton(view, i, picture) {
  const verdict = VERDICTS[view.verdict] ?? VERDICTS[""];
  return element(
    "button",
    { type: "button", class: "drawing", "data-verdict": view.verdict },
    element("span", { class: "thumb" }, picture ? thumb(picture) : "∅"),
    element("bdi", { class: "name" }, view.name),
    element("span", { class: "angle" }, angleWords(view)),
    badge(view.verdict, verdict.word),
  );
}

/**
 * @param {ViewRecord} view
 * @returns {string}
 */
function angleWords({ yaw, sigma }) {
  const angle = `${((Math.round(yaw) % 360) + 360) % 360}°`;
  return sigma ? `${angle} ± ${sigma.yaw.toFixed(1)}°` : angle;
}

/**
 * @param {HTMLCanvasElement} picture
 * @returns {HTMLCanvasElement} smaller
 */
function thumb(picture) {
  const factor = THUMB / Math.max(picture.width, picture.height);
  const canvas = element("canvas", { "aria-hidden": "true" });
  canvas.width = Math.max(1, Math.round(picture.width * factor));
  canvas.height = Math.max(1, Math.round(picture.height * factor));
  const context = canvas.getContext("2d");
  if (!context) return canvas;
  context.imageSmoothingQuality = "high";
  context.drawImage(picture, 0, 0, canvas.width, canvas.height);
  return canvas;
}
