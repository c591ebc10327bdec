// Turning, zooming and moving the figure: mouse, touch and keys.

import { part } from "./elements.js";
import { limited, poseOf } from "./framing.js";
import { clamp, startState } from "./state.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./state.js").Store} Store */
/** @typedef {import("./framing.js").Pose} Pose */

const DRAG_TURN = 220; // degrees that a drag over the stage's shorter side turns
const KEY_TURN = 5; // degrees
const KEY_PAN = 0.05; // of the stage's shorter side
const KEY_ZOOM = 1.15;
const WHEEL = 0.0015; // per pixel of a wheel's turn
const WHEEL_LINE = 16; // pixels, where a wheel counts lines
const SLOWER = 0.006; // per millisecond: how inertia ends
const STOPPED = 0.01; // degrees per millisecond
const SPIN = 0.05; // degrees per millisecond: a turn takes 7.2 s
const STALE = 80; // milliseconds without movement: then there is no swing left

/**
 * @param {HTMLElement} stage that is dragged
 * @param {Scene} scene
 * @param {Store} store
 */
export function createOrbit(stage, scene, store) {
  /** @type {Map<number, number[]>} pointers that are down, and where */
  const pointers = new Map();
  let speed = [0, 0];
  let movedAt = 0;
  let swing = 0;
  const spinning = part("spin", HTMLButtonElement);

  /** @param {(pose: Pose) => Partial<Pose>} change */
  function move(change) {
    const pose = poseOf(scene, store.state);
    store.set({ ...limited(scene, { ...pose, ...change(pose) }), snapped: -1 });
  }

  /** @param {number} yaw @param {number} elevation degrees */
  const turn = (yaw, elevation) =>
    move((pose) => ({ yaw: pose.yaw + yaw, elevation: pose.elevation + elevation }));

  /** @param {number} x @param {number} y shares of the shorter side */
  const pan = (x, y) => move((pose) => ({ pan: [pose.pan[0] + x, pose.pan[1] + y] }));

  /** @param {number} factor @param {number[]} [about] a place that stays, from the middle */
  const zoom = (factor, about = [0, 0]) =>
    move((pose) => {
      const { zoom } = limited(scene, { ...pose, zoom: pose.zoom * factor });
      const grown = zoom / pose.zoom;
      return { zoom, pan: pose.pan.map((v, i) => about[i] + (v - about[i]) * grown) };
    });

  function home() {
    stop();
    const { yaw, elevation, zoom, pan, snapped } = startState(scene);
    store.set({ yaw, elevation, zoom, pan, snapped });
  }

  const side = () => Math.min(stage.clientWidth, stage.clientHeight) || 1;

  /** @param {{clientX: number, clientY: number}} event @returns {number[]} from the middle */
  function place({ clientX, clientY }) {
    const box = stage.getBoundingClientRect();
    return [clientX - box.left - box.width / 2, clientY - box.top - box.height / 2].map((v) => v / side());
  }

  function stop() {
    cancelAnimationFrame(swing);
    speed = [0, 0];
    spinning.setAttribute("aria-pressed", "false");
  }

  /** Turn on at `speed`. @param {number} slower per millisecond */
  function swingOn(slower) {
    let last = performance.now();
    /** @param {number} now */
    function step(now) {
      const time = Math.max(0, now - last);
      last = now;
      turn(speed[0] * time, speed[1] * time);
      speed = speed.map((v) => v * Math.exp(-slower * time));
      if (Math.hypot(...speed) > STOPPED) swing = requestAnimationFrame(step);
    }
    if (Math.hypot(...speed) > STOPPED) swing = requestAnimationFrame(step);
  }

  function spin() {
    const on = spinning.getAttribute("aria-pressed") === "true";
    stop();
    if (on) return;
    spinning.setAttribute("aria-pressed", "true");
    speed = [SPIN, 0];
    swingOn(0);
  }

  /** @param {number} rings up */
  function climb(rings) {
    const { elevations } = scene.figure;
    move(({ elevation }) => {
      const off = elevations.map((one) => Math.abs(one - elevation));
      const next = off.indexOf(Math.min(...off)) + rings;
      return { elevation: elevations[clamp(next, 0, elevations.length - 1)] };
    });
  }

  /** @param {PointerEvent} event */
  function down(event) {
    if (event.button !== 0) return;
    stop();
    pointers.set(event.pointerId, place(event));
    movedAt = event.timeStamp;
    stage.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  function drag(event) {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = place(event);
    const [x, y] = now.map((v, i) => v - before[i]);
    if (!x && !y) return;
    const others = [...pointers].filter(([id]) => id !== event.pointerId);
    pointers.set(event.pointerId, now);
    if (others.length) pinch(others[0][1], before, now);
    else if (event.shiftKey) pan(x, y);
    else {
      const time = Math.max(1, event.timeStamp - movedAt);
      speed = [(-x * DRAG_TURN) / time, (y * DRAG_TURN) / time];
      turn(-x * DRAG_TURN, y * DRAG_TURN);
    }
    movedAt = event.timeStamp;
  }

  /** @param {number[]} other @param {number[]} before @param {number[]} now two fingers, one moves */
  function pinch(other, before, now) {
    speed = [0, 0];
    const far = (/** @type {number[]} */ a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
    const middle = now.map((v, i) => (v + other[i]) / 2);
    pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    zoom(far(now) / Math.max(1e-3, far(before)), middle);
  }

  /** @param {PointerEvent} event */
  function up(event) {
    if (!pointers.delete(event.pointerId) || pointers.size) return;
    if (event.timeStamp - movedAt < STALE && !event.shiftKey && !calm()) swingOn(SLOWER);
  }

  /** @type {Record<string, number[]>} right and down */
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

  /** @param {KeyboardEvent} event */
  function key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) pan(arrow[0] * KEY_PAN, arrow[1] * KEY_PAN);
    else if (arrow?.[0]) turn(-arrow[0] * KEY_TURN, 0);
    else if (arrow) climb(arrow[1]);
    else if ("+=".includes(event.key)) zoom(KEY_ZOOM);
    else if ("-_".includes(event.key)) zoom(1 / KEY_ZOOM);
    else if (event.key === "Home") home();
    else return;
    stop();
    event.preventDefault();
  }

  /** @param {WheelEvent} event */
  function wheel(event) {
    event.preventDefault();
    stop();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? WHEEL_LINE : 1;
    zoom(Math.exp(-event.deltaY * lines * WHEEL), place(event));
  }

  /** Turn by itself until something is touched. */
  function showOff() {
    if (calm()) return;
    spin();
    for (const touched of ["pointerdown", "keydown", "wheel"])
      addEventListener(touched, leave, { capture: true, passive: true });
  }

  /** @param {Event} event */
  function leave(event) {
    for (const touched of ["pointerdown", "keydown", "wheel"])
      removeEventListener(touched, leave, { capture: true });
    const { target } = event;
    if (!(target instanceof Node && spinning.contains(target))) stop(); // the button stops it itself
  }

  spinning.addEventListener("click", spin);
  stage.addEventListener("pointerdown", down);
  stage.addEventListener("pointermove", drag);
  for (const end of ["pointerup", "pointercancel"])
    stage.addEventListener(end, (event) => up(/** @type {PointerEvent} */ (event)));
  stage.addEventListener("keydown", key);
  stage.addEventListener("wheel", wheel, { passive: false });
  stage.addEventListener("dblclick", home);
  return { home, showOff, zoom: (/** @type {number} */ factor) => zoom(factor) };
}

/** @returns {boolean} whether less motion is wished for */
function calm() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}
