// The sheet on the page: it moves and grows under the pointer, and hands what else happens to the
// tool of the mode.

import { part } from "../../viewer/page/elements.js";
import { clamp } from "../../viewer/page/state.js";

/** @typedef {import("./types.js").Drag} Drag */
/** @typedef {import("./types.js").Point} Point */
/** @typedef {import("./types.js").Tool} Tool */

const STEP = 1.25;
const DEEPEST = 40; // times
const AROUND = 12; // pixels about the sheet
const BELOW = 44; // pixels, for the buttons
const STILL = 3; // pixels: a click that moves less drags nothing
const STRIP = 0.5; // of the stage's height: a sheet that is lower opens enlarged, about one figure

/**
 * @param {import("./model.js").Model} model
 * @param {HTMLImageElement} picture the sheet
 * @param {() => Tool} tool of the mode
 */
export function createSheet(model, picture, tool) {
  const canvas = part("sheet", HTMLCanvasElement);
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser draws no pictures");
  const [width, height] = model.scene.sheet.size;
  let view = { zoom: 1, x: 0, y: 0 }; // pixels of the screen per pixel of the sheet, and its corner
  let frame = 0;
  /** @type {Map<number, Point>} */
  const pointers = new Map();
  /** @type {Drag | null} */
  let drag = null;
  /** @type {Point | null} where a press has not moved from yet */
  let pressed = null;

  /** @param {{clientX: number, clientY: number}} event @returns {Point} on the canvas */
  function spot(event) {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** @param {Point} at on the canvas @returns {Point} of the sheet */
  function onSheet([x, y]) {
    return [(x - view.x) / view.zoom, (y - view.y) / view.zoom];
  }

  /** @param {number} least zoom, whatever room the sheet needs then */
  function fit(least = 0) {
    const [wide, high] = [canvas.clientWidth - 2 * AROUND, canvas.clientHeight - AROUND - BELOW];
    const zoom = Math.max(least, Math.min(wide / width, high / height));
    const [x, , across] = model.figure?.box ?? [0, 0, 0];
    const spare = wide - zoom * width;
    const middled = spare < 0 ? clamp(wide / 2 - zoom * (x + across / 2), spare, 0) : spare / 2;
    view = { zoom, x: AROUND + middled, y: AROUND + (high - zoom * height) / 2 };
    draw();
  }

  const whole = () => fit();
  const enlarged = () => fit((STRIP * (canvas.clientHeight - AROUND - BELOW)) / height);
  let framed = model.mode === "cameras" ? enlarged : whole;

  /** @param {number} factor @param {Point} about on the canvas */
  function zoomBy(factor, about) {
    const least = Math.min(canvas.clientWidth / width, canvas.clientHeight / height) / 2;
    const zoom = clamp(view.zoom * factor, least, DEEPEST);
    const by = zoom / view.zoom;
    view = { zoom, x: about[0] - by * (about[0] - view.x), y: about[1] - by * (about[1] - view.y) };
    draw();
  }

  function paint() {
    frame = 0;
    if (!context) return;
    const dense = devicePixelRatio || 1;
    const size = [canvas.clientWidth, canvas.clientHeight].map((v) => Math.max(1, Math.round(v * dense)));
    if (size[0] !== canvas.width || size[1] !== canvas.height) [canvas.width, canvas.height] = size;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, size[0], size[1]);
    context.setTransform(view.zoom * dense, 0, 0, view.zoom * dense, view.x * dense, view.y * dense);
    context.imageSmoothingEnabled = view.zoom < 3;
    context.drawImage(picture, 0, 0, width, height);
    tool().draw(context, 1 / view.zoom);
  }

  function draw() {
    frame ||= requestAnimationFrame(paint);
  }

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, spot(event));
    if (pointers.size > 1) drag?.end();
    [drag, pressed] = [null, null];
    if (pointers.size > 1 || event.button === 1) return;
    drag = tool().down(onSheet(spot(event)), event, 1 / view.zoom);
    pressed = spot(event);
    draw();
  });
  canvas.addEventListener("pointermove", (event) => {
    const [now, before] = [spot(event), pointers.get(event.pointerId)];
    if (!before) return void (canvas.style.cursor = tool().cursor(onSheet(now), 1 / view.zoom));
    if (pressed && Math.hypot(now[0] - pressed[0], now[1] - pressed[1]) < STILL) return;
    pressed = null;
    if (drag) drag.move(onSheet(now), event);
    else moveAll(event.pointerId, before, now);
    pointers.set(event.pointerId, now);
    draw();
  });
  const end = (/** @type {PointerEvent} */ event) => {
    if (!pointers.delete(event.pointerId) || !drag) return;
    const ended = drag;
    drag = null;
    ended.end();
    draw();
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);

  /** One pointer moves the sheet, two move and zoom it. @param {number} id @param {Point} before @param {Point} now */
  function moveAll(id, before, now) {
    const other = [...pointers].find(([one]) => one !== id)?.[1];
    const share = other ? 0.5 : 1;
    view = { ...view, x: view.x + share * (now[0] - before[0]), y: view.y + share * (now[1] - before[1]) };
    if (!other) return;
    const apart = (/** @type {Point} */ at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
    zoomBy(apart(now) / apart(before), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
  }

  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoomBy(Math.exp(-event.deltaY / 400), spot(event));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || !tool().key(event)) return;
    event.preventDefault();
    draw();
  });
  const middle = () => [canvas.clientWidth / 2, canvas.clientHeight / 2];
  part("closer", HTMLElement).addEventListener("click", () => zoomBy(STEP, middle()));
  part("farther", HTMLElement).addEventListener("click", () => zoomBy(1 / STEP, middle()));
  part("home", HTMLElement).addEventListener("click", () => (framed = whole)());
  new ResizeObserver(() => framed()).observe(canvas);
  model.listen(draw);
  framed();
  return {
    draw,
    /** @param {import("./types.js").Box} box what is to be seen well */
    look([x, y, wide, high]) {
      const room = [canvas.clientWidth, canvas.clientHeight];
      const zoom = Math.min(room[0] / (1.4 * wide), room[1] / (1.25 * high));
      view = {
        zoom,
        x: room[0] / 2 - zoom * (x + wide / 2),
        y: room[1] / 2 - zoom * (y + high / 2),
      };
      draw();
    },
    /** @param {Point} at of the sheet @returns {Point} on the page: for tests */
    place([x, y]) {
      const box = canvas.getBoundingClientRect();
      return [box.left + view.x + view.zoom * x, box.top + view.y + view.zoom * y];
    },
  };
}
