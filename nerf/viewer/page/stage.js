// The stage: draws when something has changed, roughly while it moves and well once it rests.

import { resized } from "./camera.js";
import { part } from "./elements.js";
import { poseOf, shownCamera } from "./framing.js";
import { LAYER_NAMES } from "./layers.js";
import { wrapped } from "./state.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */
/** @typedef {import("./state.js").State} State */
/** @typedef {import("./state.js").Store} Store */
/** @typedef {{draw: (shot: Shot) => void}} Painter */

const REST = 150; // milliseconds without a change
const SLOW = 36; // milliseconds from one moving picture to the next: more is not smooth
const QUICK = 20; // less leaves room for larger ones
const SIZES = [1, 0.84, 0.7, 0.6, 0.5, 0.4]; // of moving pictures, to those at rest
const ROUNDS = 20; // quick pictures in a row before larger ones are tried
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
 * @returns {Shot} in full quality
 */
export function shotOf(scene, state) {
  const { layer, colors, ink } = state;
  return { camera: shownCamera(scene, state), layer, colors, ink, still: true };
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
  /** @type {(error: unknown) => void} */
  let failed = () => {};
  let [frame, timer, still] = [0, 0, true];
  let [coarse, quick, last] = [0, 0, 0]; // of SIZES; quick pictures in a row; when the last one began

  /** @param {number} now milliseconds */
  function paint(now) {
    frame = 0;
    if (!painter) return;
    if (!still) suit(now - last);
    last = now;
    const shot = shotOf(scene, store.state);
    try {
      painter.draw(still ? shot : { ...shot, camera: resized(shot.camera, SIZES[coarse]), still });
    } catch (error) {
      painter = null;
      failed(error);
      return;
    }
    drawn();
  }

  /** @param {number} took milliseconds since the last picture: moving ones become as large as may be */
  function suit(took) {
    if (took > 4 * REST) return; // it has rested
    quick = took < QUICK ? quick + 1 : 0;
    if (took > SLOW) coarse = Math.min(SIZES.length - 1, coarse + 1);
    if (quick === ROUNDS) [coarse, quick] = [Math.max(0, coarse - 1), 0];
  }

  function ask() {
    frame ||= requestAnimationFrame(paint);
  }

  function rest() {
    still = true;
    canvas.setAttribute("aria-label", labelOf(scene, store.state));
    ask();
  }

  function fit() {
    const density = Math.min(DENSEST, devicePixelRatio || 1);
    const size = [stage.clientWidth, stage.clientHeight].map((v) => Math.max(1, Math.round(v * density)));
    if (size.some((v, i) => v !== store.state.size[i])) store.set({ size });
  }

  store.listen((state, old) => {
    if (!looksOther(state, old)) return;
    still = false;
    clearTimeout(timer);
    timer = setTimeout(rest, REST);
    ask();
  });
  new ResizeObserver(fit).observe(stage);
  addEventListener("resize", fit); // the page's zoom, too
  fit();
  canvas.setAttribute("aria-label", labelOf(scene, store.state));
  return {
    /**
     * @param {Painter | null} next that draws from now on
     * @param {() => void} whenDrawn after each picture
     * @param {(error: unknown) => void} whenFailed it is no longer asked then
     */
    use(next, whenDrawn, whenFailed) {
      [painter, drawn, failed] = [next, whenDrawn, whenFailed];
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
    "snapped",
    "comparison",
    "cameras",
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
  const pose = poseOf(scene, state);
  const drawing = state.snapped < 0 ? "" : `, camera of drawing ${state.snapped + 1}`;
  const [yaw, elevation] = [Math.round(wrapped(pose.yaw)), Math.round(pose.elevation)];
  const angles = `yaw ${yaw}°, elevation ${elevation}°`;
  return `The figure, ${sideOf(pose.yaw)}, ${angles}${drawing}, layer ${LAYER_NAMES[state.layer]}`;
}

/**
 * @param {number} yaw degrees
 * @returns {string} the side that is seen
 */
function sideOf(yaw) {
  return SIDES[((Math.round(yaw / 45) % 8) + 8) % 8];
}
