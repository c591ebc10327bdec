// The label maps over the drawings: a brush that gives pixels another paint, and colours to pick.

import { topmost } from "./figures_tool.js";
import { pictureOf } from "./outline_error.js";
import { withPalette } from "./corrections.js";
import { part, say } from "../../viewer/page/elements.js";

/** @typedef {import("./types.js").Point} Point */
/** @typedef {import("./types.js").Stroke} Stroke */
/** @typedef {import("./types.js").Tool} Tool */
/** @typedef {import("./types.js").ViewRecord} ViewRecord */

const APART = 0.4; // of the radius: points of a stroke that are nearer say nothing new

/**
 * @param {import("./model.js").Model} model
 * @param {(at: Point) => string} colorAt of the sheet, "#rrggbb"
 * @param {() => string | null} paint that the brush has
 * @param {() => void} redraw
 */
export function createPaletteTool(model, colorAt, paint, redraw) {
  const radius = part("radius", HTMLInputElement);
  const opacity = part("opacity", HTMLInputElement);
  /** @type {Map<ViewRecord, HTMLImageElement | null>} */
  const maps = new Map();
  /** @type {Stroke | null} */
  let stroke = null;
  /** @type {((color: string) => void) | null} who waits for a colour of the drawing */
  let picking = null;
  let scene = model.scene;

  /** @param {ViewRecord} view @returns {HTMLImageElement | null} */
  function mapOf(view) {
    const made = maps.get(view);
    if (made !== undefined || !view.labels) return made ?? null;
    maps.set(view, null);
    pictureOf(view.labels).then((picture) => {
      maps.set(view, picture);
      redraw();
    });
    return null;
  }

  model.listen(() => {
    if (scene !== model.scene) maps.clear();
    scene = model.scene;
  });
  opacity.addEventListener("input", redraw);

  /** @type {Tool} */
  const tool = {
    draw(context, px) {
      context.imageSmoothingEnabled = false;
      context.globalAlpha = Number(opacity.value) / 100;
      for (const view of model.scene.views) {
        const map = mapOf(view);
        const [x, y, wide, high] = view.crop;
        if (map) context.drawImage(map, x, y, wide, high);
      }
      context.globalAlpha = 1;
      for (const one of stroke ? [stroke] : model.busy ? (model.said.palette?.strokes ?? []) : []) {
        drawStroke(context, one);
      }
      const box = model.figure?.box;
      if (!box) return;
      context.strokeStyle = "#12639c";
      context.lineWidth = px;
      context.strokeRect(box[0], box[1], box[2], box[3]);
    },
    down(at) {
      if (picking) {
        picking(colorAt(at));
        return null;
      }
      const hit = topmost(model.figures.map((figure) => figure.box), at);
      if (hit < 0) return null;
      if (hit !== model.selected) model.show({ selected: hit, also: [] });
      const color = paint();
      if (!color) return (say("Choose the paint of the brush first."), null);
      const size = Number(radius.value);
      stroke = { box: model.figures[hit].box, color, radius: size, points: [short(at)] };
      return { move: paintOn, end: paintEnd };
    },
    key(event) {
      if (event.key !== "Escape" || !picking) return false;
      picking = null;
      say("");
      return true;
    },
    cursor: () => "crosshair",
  };

  /** @param {Point} at */
  function paintOn(at) {
    const last = stroke?.points.at(-1);
    if (!stroke || !last) return;
    const far = Math.hypot(at[0] - last[0], at[1] - last[1]) > APART * stroke.radius;
    if (far) stroke.points.push(short(at));
  }

  function paintEnd() {
    const done = stroke;
    stroke = null;
    if (!done) return;
    model.change(withPalette(model.said, { strokes: [...(model.said.palette?.strokes ?? []), done] }));
  }

  return {
    tool,
    /** @param {string} text what to do @param {((color: string) => void) | null} take */
    pick(text, take) {
      picking = take;
      say(text);
    },
  };
}

/** @param {Point} at @returns {Point} */
function short(at) {
  return at.map((v) => Number(v.toFixed(1)));
}

/** @param {CanvasRenderingContext2D} context @param {Stroke} stroke */
function drawStroke(context, { color, radius, points }) {
  [context.strokeStyle, context.lineWidth] = [color, 2 * radius];
  [context.lineCap, context.lineJoin] = ["round", "round"];
  context.beginPath();
  context.moveTo(points[0][0], points[0][1]);
  for (const [x, y] of points) context.lineTo(x, y + 1e-3);
  context.stroke();
  [context.lineCap, context.lineJoin] = ["butt", "miter"];
}
