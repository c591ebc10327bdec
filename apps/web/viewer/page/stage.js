// The stage: draws when something has changed.

import { part } from "./elements.js";
import { RADIAN, shownCamera, shownSight } from "./framing.js";
import { LAYER_NAMES } from "./layers.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */
/** @typedef {import("./state.js").State} State */
/** @typedef {import("./state.js").Store} Store */
/** @typedef {{draw: (shot: Shot) => boolean}} Painter */

const REST = 150; // milliseconds without a change
const DENSEST = 2; // canvas pixels per CSS pixel
const SIDES = [
  "front",
  "front left",
  "left side",
  "back left",
  "back",
  "back right",
  "right side",
  "front right",
];

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {Shot}
 */
export function shotOf(scene, state) {
  const { layer, colors, lines, origins, ink: pen } = state;
  const [camera, sight] = [shownCamera(scene, state), shownSight(scene, state)];
  return { camera, sight, layer, colors, pen, lines, origins };
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Scene} scene
 * @param {Store} store
 */
export function createStage(canvas, scene, store) {
  const stage = part("stage", HTMLElement);
  /** @type {Painter | null} */
  let painter = null;
  /** @type {() => void} */
  let drawn = () => {};
  let [frame, timer] = [0, 0];

  function paint() {
    frame = 0;
    if (painter?.draw(shotOf(scene, store.state))) drawn();
  }

  function ask() {
    frame ||= requestAnimationFrame(paint);
  }

  const tell = () => canvas.setAttribute("aria-label", labelOf(scene, store.state));

  function fit() {
    const density = Math.min(DENSEST, devicePixelRatio || 1);
    const size = [stage.clientWidth, stage.clientHeight].map((v) => Math.max(1, Math.round(v * density)));
    if (size.some((v, i) => v !== store.state.size[i])) store.set({ size });
  }

  store.listen((state, old) => {
    if (!looksOther(state, old)) return;
    clearTimeout(timer);
    timer = setTimeout(tell, REST);
    ask();
  });
  new ResizeObserver(fit).observe(stage);
  addEventListener("resize", fit); // the page's zoom, too
  fit();
  tell();
  return {
    /**
     * @param {Painter} next that draws from now on
     * @param {() => void} whenDrawn after each picture
     */
    use(next, whenDrawn) {
      [painter, drawn] = [next, whenDrawn];
      ask();
    },
    ask,
  };
}

/**
 * @param {State} state
 * @param {State} old
 * @returns {boolean} whether the rendering changes
 */
function looksOther(state, old) {
  /** @type {(keyof State)[]} */
  const seen = [
    "yaw",
    "elevation",
    "zoom",
    "pan",
    "layer",
    "colors",
    "ink",
    "lines",
    "snapped",
    "comparison",
    "cameras",
    "origins",
    "size",
  ];
  return seen.some((name) => state[name] !== old[name]);
}

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {string} what is to be seen, in words
 */
function labelOf(scene, state) {
  const [yaw, elevation] = scene.sights[shownSight(scene, state)].angles.map((angle) => angle / RADIAN);
  const drawing = state.snapped < 0 ? "" : `, camera of drawing ${state.snapped + 1}`;
  const angles = `yaw ${((Math.round(yaw) % 360) + 360) % 360}°, elevation ${Math.round(elevation)}°`;
  return `The figure, ${sideOf(yaw)}, ${angles}${drawing}, layer ${LAYER_NAMES[state.layer]}`;
}

/**
 * @param {number} yaw degrees
 * @returns {string} the side that is seen
 */
function sideOf(yaw) {
  return SIDES[((Math.round(yaw / 45) % 8) + 8) % 8];
}
