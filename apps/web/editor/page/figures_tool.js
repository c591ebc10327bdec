// Boxes of the figures: drawn, moved, resized, merged, cut, left out and brought back; the paper.

import { matching, withBoxes, withView } from "./corrections.js";
import { thumbnail } from "./groups.js";
import { element, part, say } from "../../viewer/page/elements.js";
import { clamp } from "../../viewer/page/state.js";

/** @typedef {import("./types.js").Box} Box */
/** @typedef {import("./types.js").Point} Point */
/** @typedef {import("./types.js").Drag} Drag */
/** @typedef {import("./types.js").Tool} Tool */

const GRIP = 12; // pixels of the screen round a corner or an edge
const LOWEST = 17; // pixels of the screen: the letter of a lower patch would cover its neighbours
const LEAST = 8; // pixels of the sheet: smaller is no figure
const SHADES = { figure: "#12639c", off: "#b02318", left: "#575b61" };

/** @type {Record<string, string>} */
const KINDS = {
  text: "text",
  frame: "a frame",
  swatch: "a colour patch",
  study: "a smaller drawing",
  mark: "a stroke",
  speck: "a speck",
  dropped: "dropped",
};

/**
 * @param {import("./model.js").Model} model
 * @param {HTMLImageElement} picture the sheet
 * @param {(at: Point) => string} colorAt of the sheet, "#rrggbb"
 * @returns {Tool}
 */
export function createFiguresTool(model, picture, colorAt) {
  /** @type {"" | "paper" | "cut"} what the next click is for */
  let armed = "";
  /** @type {Box | null} that is being drawn or moved */
  let draft = null;

  const boxes = () => model.figures.map((figure) => figure.box);
  const limits = () => model.scene.sheet.size;

  /** @param {Box} old @param {Box} box */
  function replace(old, box) {
    const all = boxes().map((one) => (one === old ? box : one));
    model.change(withBoxes(model.said, all, new Map([[old, box]])));
  }

  /** @param {Box} box a further figure */
  function add(box) {
    model.change(withBoxes(model.said, [...boxes(), box]));
    model.show({ selected: model.figures.length - 1, also: [] });
  }

  /** @param {Point} [at] @param {boolean} [other] way than the box is long */
  function cut(at, other = false) {
    const box = model.figure?.box;
    if (!box) return;
    const [x, y, wide, high] = box;
    const [u, v] = at ?? [x + wide / 2, y + high / 2];
    if (Math.min(u - x, x + wide - u, v - y, y + high - v) < 1) return say("Click within the box.");
    const parts =
      wide >= high * 0.6 !== other
        ? [[x, y, u - x, high], [u, y, x + wide - u, high]]
        : [[x, y, wide, v - y], [x, v, wide, y + high - v]];
    const all = boxes().flatMap((one, i) => (i === model.selected ? parts : [one]));
    model.change(withBoxes(model.said, all));
    arm("");
  }

  function merge() {
    const own = model.figure?.box;
    if (!own) return;
    const others = model.also.length ? model.also : [nearestTo(own)];
    const chosen = [...new Set([model.selected, ...others])].filter((i) => boxes()[i]);
    if (chosen.length < 2) return say("There is no other box to merge with.");
    const whole = chosen.map((i) => boxes()[i]).reduce(around);
    const all = boxes().flatMap((box, i) => (i === Math.min(...chosen) ? [whole] : chosen.includes(i) ? [] : [box]));
    model.change(withBoxes(model.said, all));
    model.show({ selected: Math.min(...chosen), also: [] });
  }

  /** @param {Box} own @returns {number} */
  function nearestTo(own) {
    const gaps = boxes().map((box) => (box === own ? Infinity : gapOf(own, box)));
    return gaps.indexOf(Math.min(...gaps));
  }

  function drop() {
    const figure = model.figure;
    if (figure) model.change(withView(model.said, figure.box, { exclude: figure.said?.exclude ? undefined : true }));
  }

  /** @param {"" | "paper" | "cut"} next */
  function arm(next) {
    armed = next;
    part("pick_paper", HTMLElement).setAttribute("aria-pressed", String(armed === "paper"));
    part("cut_box", HTMLElement).setAttribute("aria-pressed", String(armed === "cut"));
    if (armed) say(armed === "paper" ? "Click the paper." : "Click where the box is to be cut, with Shift the other way; Enter cuts its middle.");
  }

  /** @returns {{box: Box, kind: string}[]} drawings first */
  function leftOut() {
    const left = model.scene.leftOut.filter((one) => !matching(model.figures, one.box));
    return [...left.filter(isDrawing), ...left.filter((one) => !isDrawing(one))];
  }

  /** @param {Point} at @returns {Box | undefined} of a drawing that was left out */
  function drawingAt(at) {
    const drawings = leftOut().filter(isDrawing).map((one) => one.box);
    return drawings[topmost(drawings, at)];
  }

  /** @param {string} id @param {() => void} act */
  const on = (id, act) => part(id, HTMLElement).addEventListener("click", act);
  on("add_box", () => add(middleOf(limits())));
  on("merge_boxes", merge);
  on("cut_box", () => arm(armed === "cut" ? "" : "cut"));
  on("drop_box", drop);
  on("pick_paper", () => arm(armed === "paper" ? "" : "paper"));
  on("find_paper", () => {
    const { background, ...rest } = model.said;
    model.change(rest);
  });

  on("find_boxes", () => {
    const { boxes, group, outfit, ...rest } = model.said;
    model.change(rest);
  });

  function showLeftOut() {
    const items = leftOut().map(({ box, kind }, i) => {
      const word = `Take “${letterOf(i)}”, ${KINDS[kind] ?? kind}, as a figure`;
      const shown = thumbnail(picture, [[box]]);
      const button = element("button", { type: "button", "aria-label": word, title: word }, shown, letterOf(i));
      button.addEventListener("click", () => add(box));
      return element("li", {}, button);
    });
    part("left_out", HTMLElement).replaceChildren(...items);
    part("left_out_row", HTMLElement).hidden = !items.length;
    const paper = model.said.background ?? model.scene.sheet.background;
    part("paper", HTMLElement).style.backgroundColor = paper ?? "transparent";
    part("paper_word", HTMLElement).textContent = paper ?? "transparent";
    part("find_paper", HTMLButtonElement).disabled = !model.said.background;
    part("find_boxes", HTMLButtonElement).disabled = !(model.said.boxes || model.said.group || model.said.outfit);
    const excluded = !!model.figure?.said?.exclude;
    part("drop_box", HTMLElement).textContent = excluded ? "Bring back" : "Drop";
    for (const id of ["merge_boxes", "cut_box", "drop_box"]) {
      part(id, HTMLButtonElement).disabled = !model.figure;
    }
  }

  model.listen(showLeftOut);
  showLeftOut();

  return {
    draw(context, px) {
      context.textBaseline = "top";
      leftOut().forEach(({ box }, i) => {
        outline(context, box, px, SHADES.left, [4, 3]);
        if (box[3] > LOWEST * px) tag(context, box, px, SHADES.left, letterOf(i));
      });
      model.figures.forEach((figure, i) => {
        const { box, said } = figure;
        const chosen = i === model.selected || model.also.includes(i);
        const shown = draft && i === model.selected ? draft : box;
        const shade = said?.exclude ? SHADES.off : SHADES.figure;
        outline(context, shown, chosen ? 2 * px : px, shade, said?.exclude ? [6, 4] : []);
        tag(context, shown, px, shade, nameOf(figure, i));
        if (i === model.selected) corners(context, shown, px, shade);
      });
      if (draft && !model.figure) outline(context, draft, px, SHADES.figure, []);
    },
    down(at, event, px) {
      if (armed === "paper") {
        model.change({ ...model.said, background: colorAt(at) });
        arm("");
        return null;
      }
      const own = model.figure?.box;
      const grip = own && gripAt(own, at, GRIP * px);
      if (armed === "cut" && own) return (cut(at, event.shiftKey), null);
      if (own && grip) return dragBox(own, (box, by) => resizedBox(box, grip, by), at);
      const hit = topmost(boxes(), at);
      if (hit < 0) return drawBox(at);
      if (event.shiftKey) return (model.show({ also: [...model.also, hit] }), null);
      model.show({ selected: hit, also: [] });
      return dragBox(boxes()[hit], (box, [dx, dy]) => [box[0] + dx, box[1] + dy, box[2], box[3]], at);
    },
    key(event) {
      if (armed && event.key === "Escape") return (arm(""), true);
      if (armed === "cut" && event.key === "Enter") return (cut(undefined, event.shiftKey), true);
      if (event.key === "Delete" || event.key === "Backspace") return (drop(), true);
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      const box = model.figure?.box;
      if (!step || !box) return false;
      const [dx, dy] = step.map((v) => 2 * v);
      const moved = event.shiftKey
        ? [box[0], box[1], Math.max(LEAST, box[2] + dx), Math.max(LEAST, box[3] + dy)]
        : [box[0] + dx, box[1] + dy, box[2], box[3]];
      replace(box, within(moved, limits()));
      return true;
    },
    cursor(at, px) {
      if (armed) return "crosshair";
      const own = model.figure?.box;
      if (own && gripAt(own, at, GRIP * px)) return "nwse-resize";
      if (topmost(boxes(), at) >= 0) return "move";
      return drawingAt(at) ? "pointer" : "crosshair";
    },
  };

  /** @param {Box} old @param {(box: Box, by: number[]) => Box} change @param {Point} from @returns {Drag} */
  function dragBox(old, change, from) {
    return {
      move: (at) => {
        draft = within(change(old, [at[0] - from[0], at[1] - from[1]]), limits());
      },
      end: () => {
        const box = draft;
        draft = null;
        if (box && box.some((v, i) => Math.abs(v - old[i]) >= 1)) replace(old, box);
      },
    };
  }

  /** @param {Point} from @returns {Drag} */
  function drawBox(from) {
    model.show({ selected: -1, also: [] });
    return {
      move: ([x, y]) => {
        const box = [Math.min(x, from[0]), Math.min(y, from[1]), Math.abs(x - from[0]), Math.abs(y - from[1])];
        draft = within(box, limits());
      },
      end: () => {
        const box = draft;
        draft = null;
        const left = drawingAt(from);
        if (!box && left) add(left);
        else if (box && Math.min(box[2], box[3]) >= LEAST) add(box);
      },
    };
  }
}

/** @param {{kind: string}} leftOut @returns {boolean} whether it may be a figure */
function isDrawing({ kind }) {
  return kind === "study" || kind === "dropped";
}

/** @param {import("./types.js").Figure} figure @param {number} index @returns {string} its number, and what it is called */
export function nameOf({ view, said }, index) {
  const label = said?.label || view?.caption || "";
  const word = said?.exclude ? "left out" : label && Number.isFinite(Number(label)) ? `${label}°` : label;
  return word ? `${index + 1} ${word}` : String(index + 1);
}

/** @param {Box[]} boxes @param {Point} at @returns {number} the smallest one there, -1 = none */
export function topmost(boxes, [x, y]) {
  let best = -1;
  boxes.forEach((box, i) => {
    if (x < box[0] || y < box[1] || x > box[0] + box[2] || y > box[1] + box[3]) return;
    if (best < 0 || box[2] * box[3] < boxes[best][2] * boxes[best][3]) best = i;
  });
  return best;
}

/** @param {Box} box @param {Point} at @param {number} near @returns {string | null} the sides that are gripped, as in "ne" */
function gripAt([x, y, wide, high], [u, v], near) {
  if (u < x - near || v < y - near || u > x + wide + near || v > y + high + near) return null;
  const reach = Math.min(near, wide / 3, high / 3);
  const across = Math.abs(u - x) < reach ? "w" : Math.abs(u - x - wide) < reach ? "e" : "";
  const along = Math.abs(v - y) < reach ? "n" : Math.abs(v - y - high) < reach ? "s" : "";
  return along + across || null;
}

/** @param {Box} box @param {string} grip @param {number[]} by @returns {Box} */
function resizedBox([x, y, wide, high], grip, [dx, dy]) {
  const [left, top] = [grip.includes("w") ? dx : 0, grip.includes("n") ? dy : 0];
  const right = grip.includes("e") ? dx : 0;
  const bottom = grip.includes("s") ? dy : 0;
  return [x + left, y + top, Math.max(LEAST, wide - left + right), Math.max(LEAST, high - top + bottom)];
}

/** @param {Box} box @param {number[]} size @returns {Box} on the sheet */
function within([x, y, wide, high], [width, height]) {
  const [left, top] = [clamp(x, 0, width - LEAST), clamp(y, 0, height - LEAST)];
  return [left, top, Math.min(wide, width - left), Math.min(high, height - top)];
}

/** @param {Box} a @param {Box} b @returns {Box} */
function around(a, b) {
  const [x, y] = [Math.min(a[0], b[0]), Math.min(a[1], b[1])];
  return [x, y, Math.max(a[0] + a[2], b[0] + b[2]) - x, Math.max(a[1] + a[3], b[1] + b[3]) - y];
}

/** @param {Box} a @param {Box} b @returns {number} */
function gapOf(a, b) {
  const [dx, dy] = [0, 1].map((i) => Math.max(a[i], b[i]) - Math.min(a[i] + a[i + 2], b[i] + b[i + 2]));
  return Math.hypot(Math.max(0, dx), Math.max(0, dy)) + 1e-3 * Math.hypot(dx, dy);
}

/** @param {number[]} size @returns {Box} */
function middleOf([width, height]) {
  return [width * 0.4, height * 0.25, width * 0.2, height * 0.5];
}

/** @param {number} index @returns {string} a, b, ... z, aa, ab, ...: figures have numbers */
function letterOf(index) {
  const before = Math.floor(index / 26);
  return (before ? letterOf(before - 1) : "") + String.fromCharCode(97 + (index % 26));
}

/** @param {CanvasRenderingContext2D} context @param {Box} box @param {number} px @param {string} shade @param {number[]} dash */
function outline(context, box, px, shade, dash) {
  context.setLineDash(dash.map((v) => v * px));
  context.strokeStyle = shade;
  context.lineWidth = 1.5 * px;
  context.strokeRect(box[0], box[1], box[2], box[3]);
  context.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} context @param {Box} box @param {number} px @param {string} shade */
function corners(context, [x, y, wide, high], px, shade) {
  context.fillStyle = shade;
  for (const [u, v] of [[x, y], [x + wide, y], [x, y + high], [x + wide, y + high]]) {
    context.fillRect(u - 4 * px, v - 4 * px, 8 * px, 8 * px);
  }
}

/** @param {CanvasRenderingContext2D} context @param {Box} box @param {number} px @param {string} shade @param {string} text */
export function tag(context, [x, y], px, shade, text) {
  context.font = `600 ${12 * px}px system-ui, sans-serif`;
  const wide = context.measureText(text).width;
  const top = Math.max(0, y - 17 * px); // over the box where there is room: it covers no face
  context.fillStyle = shade;
  context.fillRect(x, top, wide + 8 * px, 17 * px);
  context.fillStyle = "white";
  context.textBaseline = "top";
  context.fillText(text, x + 4 * px, top + 2.5 * px);
}
