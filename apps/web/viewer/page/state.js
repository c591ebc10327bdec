// What the page shows now, and who wants to know when that changes.

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Layer} Layer */
/** @typedef {"slider" | "beside" | "onion" | "difference"} Comparison */

/**
 * @typedef {object} State
 * @property {number} yaw degrees, 0 = front
 * @property {number} elevation degrees, > 0 looks down: the nearest ring of views is shown
 * @property {number} zoom 1 = all of the figure
 * @property {number[]} pan of the figure, in shares of the stage's shorter side
 * @property {Layer} layer
 * @property {number[][]} colors of the palette
 * @property {number[] | null} ink colour of the lines
 * @property {boolean} lines whether there are any
 * @property {number} snapped the drawing whose camera is used, -1 = none
 * @property {Comparison} comparison of that drawing with the rendering
 * @property {number} split share of the stage that shows the drawing
 * @property {number} onion opacity of the drawing
 * @property {boolean} cameras whether they are drawn round the figure
 * @property {boolean} origins whether it is shown what no drawing shows
 * @property {number[]} size of the stage, canvas pixels
 */

/**
 * @typedef {object} Store
 * @property {State} state
 * @property {(change: Partial<State>) => void} set
 * @property {(listener: (state: State, old: State) => void) => void} listen from now on
 */

export const ZOOMS = [0.25, 12];
export const FARTHEST = 3;

/** @type {Comparison[]} */
export const COMPARISONS = ["slider", "beside", "onion", "difference"];

/**
 * @param {Scene} scene
 * @returns {State} at the start
 */
export function startState(scene) {
  const { start, elevations } = scene.figure;
  const { angles, level } = scene.sights[start];
  return {
    yaw: (angles[0] * 180) / Math.PI,
    elevation: elevations[level],
    zoom: 1,
    pan: [0, 0],
    layer: scene.layers[0],
    colors: scene.palette.map((paint) => paint.rgb),
    ink: scene.pen && scene.pen.rgb,
    lines: true,
    snapped: -1,
    comparison: "slider",
    split: 0.5,
    onion: 0.5,
    cameras: false,
    origins: false,
    size: [400, 400],
  };
}

/**
 * @param {State} state at the start
 * @returns {Store}
 */
export function createStore(state) {
  /** @type {((state: State, old: State) => void)[]} */
  const listeners = [];
  return {
    get state() {
      return state;
    },
    set(change) {
      const old = state;
      state = { ...state, ...change };
      const now = state;
      for (const listener of listeners) listener(now, old);
    },
    listen(listener) {
      listeners.push(listener);
    },
  };
}

/**
 * @param {number} value
 * @param {number} low
 * @param {number} high
 * @returns {number}
 */
export function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

/**
 * @param {number} degrees
 * @returns {number} the same direction, above -180 and up to 180
 */
export function wrapped(degrees) {
  return 180 - ((((180 - degrees) % 360) + 360) % 360);
}

/**
 * @param {number[] | null} a
 * @param {number[] | null} b
 * @returns {boolean} whether they are one colour
 */
export function sameColor(a, b) {
  return a === b || (!!a && !!b && a.every((v, i) => v === b[i]));
}
