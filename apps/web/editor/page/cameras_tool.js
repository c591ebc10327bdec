// The mannequin over the drawings: dragging it turns the camera, and says how well the outlines fit.

import { overlapOf, withView } from "./corrections.js";
import { nameOf, tag, topmost } from "./figures_tool.js";
import {
  bodyOf,
  boundsOf,
  cameraSaid,
  contour,
  drawShaded,
  poseOf,
  projected,
  silhouette,
  surfacePoint,
} from "./mannequin.js";
import { maskOf, outlineError } from "./outline_error.js";
import { part, say } from "../../viewer/page/elements.js";
import { clamp, wrapped } from "../../viewer/page/state.js";

/** @typedef {import("./types.js").Box} Box */
/** @typedef {import("./types.js").Figure} Figure */
/** @typedef {import("./types.js").Point} Point */
/** @typedef {import("./types.js").ViewRecord} ViewRecord */
/** @typedef {import("./types.js").Tool} Tool */
/** @typedef {import("./mannequin.js").Pose} Pose */
/** @typedef {"yaw" | "elevation" | "roll" | "scale" | "shift"} Way */
/** @typedef {{pose: Pose, points: Float32Array, path: Path2D, lines: Path2D}} Shape */

const TURN = 180; // degrees of yaw that a drag over the figure's width makes
const STEEP = 89;
const GRASP = 16; // pixels of the screen round a handle
const LOW = 110; // pixels of the screen: a lower figure has no room for handles
const STEPS = { yaw: 2, elevation: 2, roll: 1, scale: 1.01, shift: 1 };
const BLUE = "#1173bb";
const MARK = "#c2410c";

/** @type {Record<string, string>} */
const SHADE = { ok: "#1b6e45", weak: "#805200", ambiguous: "#73389c", failed: "#b02318", "": "#575b61" };

/**
 * @param {import("./model.js").Model} model
 * @param {boolean} fits whether cameras follow what is said
 */
export function createCamerasTool(model, fits) {
  let scene = model.scene;
  let body = bodyOf(scene);
  /** @type {Map<ViewRecord, Shape>} */
  const shapes = new Map();
  /** @type {{said: object, pose: Pose, view: ViewRecord} | null} while it is dragged, and until it is fitted */
  let draft = null;
  /** @type {Map<ViewRecord, import("./outline_error.js").Mask>} */
  const masks = new Map();
  /** @type {number[] | null | "mannequin"} landmark that is being clicked: next on the mannequin, or its point */
  let marking = null;
  let frame = 0;
  /** @type {Point} where the keyboard's cross is */
  let cross = [0, 0];

  function refresh() {
    if (model.scene !== scene) {
      scene = model.scene;
      body = bodyOf(scene);
      [draft, marking] = [null, null];
      shapes.clear();
      masks.clear();
    }
    if (draft && draft.said !== model.said) draft = null;
    measure();
  }

  const middle = () => body?.middle ?? [0, 0, 0];

  /** @param {Figure} figure @returns {Pose | null} what is shown of it */
  function shownPose({ view, said }) {
    if (!view) return null;
    if (draft?.view === view) return draft.pose;
    const pose = poseOf(view, middle());
    return said?.camera && !fits ? { ...pose, ...said.camera } : pose;
  }

  /** @param {Figure} figure @returns {Shape | null} */
  function shapeOf(figure) {
    const pose = shownPose(figure);
    if (!body || !pose || !figure.view) return null;
    const old = shapes.get(figure.view);
    if (old && samePose(old.pose, pose)) return old;
    const points = projected(body, pose);
    const made = { pose, points, path: silhouette(body, points), lines: contour(body, points) };
    shapes.set(figure.view, made);
    return made;
  }

  function measure() {
    frame ||= requestAnimationFrame(() => {
      frame = 0;
      measureNow();
    });
  }

  async function measureNow() {
    const figure = model.figure;
    const view = figure?.view;
    const place = part("fit_error", HTMLElement);
    if (!view || !body) return void (place.textContent = "");
    if (!masks.has(view)) masks.set(view, await maskOf(view));
    const [mask, shape] = [masks.get(view), figure && shapeOf(figure)];
    if (!mask || !shape || model.figure?.view !== view) return;
    const { iou, px } = outlineError(mask, view, shape.path);
    place.textContent = `Outlines overlap by ${(100 * iou).toFixed(1)} %, ${px.toFixed(1)} px apart.`;
  }

  /** @param {Figure} figure @param {Pose} pose */
  function place(figure, pose) {
    if (!figure.view) return;
    draft = { said: model.said, pose, view: figure.view };
    measure();
  }

  /** @param {Figure} figure keep what was dragged */
  function keep(figure) {
    if (!draft || draft.view !== figure.view) return;
    const pose = draft.pose;
    const next = withView(model.said, figure.box, { camera: cameraSaid(pose), label: undefined });
    draft = null;
    model.change(next);
    if (figure.view) draft = { said: model.said, pose, view: figure.view };
    measure();
    model.tell();
  }

  /** @param {Figure} figure @param {Way} way @param {number[]} by steps, or pixels of the sheet for a shift */
  function step(figure, way, by) {
    const pose = shownPose(figure);
    if (!pose) return;
    place(figure, changed(pose, way, by));
    keep(figure);
  }

  /** @param {Point} at */
  function mark(at) {
    const figure = model.figure;
    const shape = figure && shapeOf(figure);
    if (!figure || !shape || !body) return;
    if (marking === "mannequin") {
      marking = surfacePoint(body, shape.points, at);
      say(marking ? "Now click the same point on the drawing." : "Click a point on the mannequin.");
      marking ??= "mannequin";
    } else if (marking) {
      const pair = { world: marking.map((v) => Number(v.toFixed(4))), pixel: at.map((v) => Number(v.toFixed(1))) };
      marking = null;
      say("");
      model.change(withView(model.said, figure.box, { landmarks: [...(figure.said?.landmarks ?? []), pair] }));
    }
  }

  model.listen(refresh);
  measure();

  /** @type {Tool} */
  const tool = {
    draw(context, px) {
      model.figures.forEach((figure, i) => {
        const chosen = i === model.selected;
        const shape = figure.said?.exclude ? null : shapeOf(figure);
        const shade = SHADE[figure.view?.verdict ?? ""];
        if (shape) drawOutline(context, shape, chosen, px, chosen ? BLUE : shade);
        tag(context, figure.view?.crop ?? figure.box, px, chosen ? BLUE : shade, nameOf(figure, i));
        if (!chosen || !shape) return;
        if (marking === "mannequin" && body) drawShaded(context, body, shape.points, shape.pose.scale);
        if (!marking) drawHandles(context, shape, px);
        for (const { pixel } of figure.said?.landmarks ?? []) drawCross(context, pixel, px);
      });
      if (marking) drawCross(context, cross, px);
    },
    down(at, event, px) {
      if (marking) return (mark(at), null);
      const own = model.figure;
      const shape = own && shapeOf(own);
      const handle = shape && handleAt(shape, at, px);
      const hit = topmost(model.figures.map((figure) => figure.view?.crop ?? figure.box), at);
      if (!handle) {
        if (hit < 0) return null;
        if (hit !== model.selected) model.show({ selected: hit, also: [] });
      }
      const figure = model.figure;
      const from = figure && shownPose(figure);
      const bounds = figure && shapeOf(figure);
      if (!figure || !from || !bounds || figure.said?.exclude) return null;
      const way = handle ?? wayOf(event);
      return {
        move: (now) => place(figure, dragged(from, way, at, now, boundsOf(bounds.points))),
        end: () => keep(figure),
      };
    },
    key(event) {
      const figure = model.figure;
      if (!figure) return false;
      if (marking) return markByKey(event);
      const [way, by] = keyWay(event);
      if (!way) return false;
      step(figure, way, by);
      return true;
    },
    cursor(at, px) {
      if (marking) return "crosshair";
      const shape = model.figure && shapeOf(model.figure);
      const handle = shape && handleAt(shape, at, px);
      if (handle) return { yaw: "ew-resize", elevation: "ns-resize", roll: "alias", scale: "nwse-resize", shift: "move" }[handle];
      return topmost(model.figures.map((figure) => figure.view?.crop ?? figure.box), at) < 0 ? "grab" : "ew-resize";
    },
  };

  /** @param {KeyboardEvent} event @returns {boolean} */
  function markByKey(event) {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (move) cross = cross.map((v, i) => v + 2 * move[i]);
    else if (event.key === "Enter") mark(cross);
    else if (event.key === "Escape") marking = null;
    else return false;
    return true;
  }

  return {
    tool,
    shownPose,
    step,
    /** @param {Figure} figure @param {Partial<Pose>} change */
    set(figure, change) {
      const pose = shownPose(figure);
      if (!pose) return;
      place(figure, { ...pose, ...change });
      keep(figure);
    },
    startMark() {
      const shape = model.figure && shapeOf(model.figure);
      if (!shape) return say("This drawing has no mannequin to click.");
      marking = "mannequin";
      cross = shape.pose.middle;
      say("Click a point on the mannequin. (Keys: arrows move the cross, Enter takes it.)");
      model.tell();
    },
    get hasBody() {
      return !!body;
    },
  };
}

/** @param {PointerEvent} event @returns {Way} */
function wayOf(event) {
  if (event.shiftKey) return "shift";
  return event.altKey || event.ctrlKey || event.metaKey ? "elevation" : "yaw";
}

/** @param {KeyboardEvent} event @returns {[Way | null, number[]]} */
function keyWay({ key, shiftKey }) {
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
  if (arrow && shiftKey) return ["shift", arrow.map((v) => STEPS.shift * v)];
  if (arrow) return arrow[0] ? ["yaw", [-arrow[0]]] : ["elevation", [arrow[1]]];
  if (key === "[" || key === "]") return ["roll", [key === "]" ? 1 : -1]];
  if (key === "+" || key === "=" || key === "-") return ["scale", [key === "-" ? -1 : 1]];
  return [null, []];
}

/** @param {Pose} pose @param {Way} way @param {number[]} by @returns {Pose} */
function changed(pose, way, by) {
  if (way === "shift") return { ...pose, middle: pose.middle.map((v, i) => v + by[i]) };
  if (way === "scale") return { ...pose, scale: pose.scale * STEPS.scale ** by[0] };
  return turned(pose, way, pose[way] + STEPS[way] * by[0]);
}

/** @param {Pose} pose @param {"yaw" | "elevation" | "roll"} way @param {number} degrees @returns {Pose} */
function turned(pose, way, degrees) {
  return { ...pose, [way]: way === "elevation" ? clamp(degrees, -STEEP, STEEP) : wrapped(degrees) };
}

/**
 * @param {Pose} pose at the start
 * @param {Way} way
 * @param {Point} from
 * @param {Point} to
 * @param {number[]} bounds of the mannequin at the start
 * @returns {Pose}
 */
function dragged(pose, way, from, to, [left, top, right, bottom]) {
  const by = [to[0] - from[0], to[1] - from[1]];
  const span = Math.max(right - left, (bottom - top) / 3);
  if (way === "shift") return { ...pose, middle: pose.middle.map((v, i) => v + by[i]) };
  if (way === "yaw") return turned(pose, "yaw", pose.yaw - (TURN * by[0]) / span);
  if (way === "elevation") return turned(pose, way, pose.elevation + (90 * by[1]) / (bottom - top));
  const [a, b] = [from, to].map((at) => [at[0] - pose.middle[0], at[1] - pose.middle[1]]);
  if (way === "scale") {
    const factor = Math.hypot(b[0], b[1]) / (Math.hypot(a[0], a[1]) || 1);
    return { ...pose, scale: pose.scale * clamp(factor, 0.1, 10) };
  }
  const angle = Math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
  return turned(pose, "roll", pose.roll + (angle * 180) / Math.PI);
}

/** @param {Shape} shape @param {number} px @returns {Record<string, Point>} where each way of dragging is gripped */
function handlesOf({ points, pose }, px) {
  const [left, top, right, bottom] = boundsOf(points);
  if (bottom - top < LOW * px) return {};
  const away = 16 * px;
  return {
    roll: [pose.middle[0], top - away],
    scale: [right + away, bottom],
    elevation: [right + away, (top + bottom) / 2],
    shift: [(left + right) / 2, bottom + away],
  };
}

/** @param {Shape} shape @param {Point} at @param {number} px @returns {Way | null} */
function handleAt(shape, [x, y], px) {
  const near = GRASP * px;
  const hit = Object.entries(handlesOf(shape, px)).find(([, [u, v]]) => Math.hypot(u - x, v - y) < near);
  return hit ? /** @type {Way} */ (hit[0]) : null;
}

/** @param {CanvasRenderingContext2D} context @param {Shape} shape @param {number} px */
function drawHandles(context, shape, px) {
  const icons = /** @type {Record<string, string>} */ ({ roll: "↻", scale: "⤡", elevation: "↕", shift: "✥" });
  context.font = `${13 * px}px system-ui, sans-serif`;
  [context.textAlign, context.textBaseline] = ["center", "middle"];
  for (const [way, [x, y]] of Object.entries(handlesOf(shape, px))) {
    context.fillStyle = "white";
    context.strokeStyle = BLUE;
    context.lineWidth = 1.5 * px;
    context.beginPath();
    context.arc(x, y, 10 * px, 0, 7);
    context.fill();
    context.stroke();
    context.fillStyle = BLUE;
    context.fillText(icons[way], x, y);
  }
  context.textAlign = "start";
}

/** @param {CanvasRenderingContext2D} context @param {Point} at @param {number} px */
function drawCross(context, [x, y], px) {
  context.strokeStyle = MARK;
  context.lineWidth = 2 * px;
  context.beginPath();
  context.moveTo(x - 7 * px, y);
  context.lineTo(x + 7 * px, y);
  context.moveTo(x, y - 7 * px);
  context.lineTo(x, y + 7 * px);
  context.stroke();
}

/** @type {OffscreenCanvasRenderingContext2D | null} */
let lineContext = null;

/**
 * Strokes the contour and takes away what the mannequin covers: the outer outline is left.
 * @param {CanvasRenderingContext2D} context
 * @param {Shape} shape
 * @param {boolean} chosen
 * @param {number} px
 * @param {string} color
 */
function drawOutline(context, { path, lines }, chosen, px, color) {
  lineContext ??= new OffscreenCanvas(1, 1).getContext("2d");
  if (!lineContext) return;
  const { width, height } = context.canvas;
  if (lineContext.canvas.width !== width || lineContext.canvas.height !== height) {
    [lineContext.canvas.width, lineContext.canvas.height] = [width, height];
  }
  lineContext.globalCompositeOperation = "source-over";
  lineContext.setTransform(1, 0, 0, 1, 0, 0);
  lineContext.clearRect(0, 0, width, height);
  lineContext.setTransform(context.getTransform());
  lineContext.strokeStyle = color;
  lineContext.lineCap = "round";
  lineContext.lineWidth = (chosen ? 5 : 3.5) * px;
  lineContext.stroke(lines);
  lineContext.globalCompositeOperation = "destination-out";
  lineContext.fill(path);
  context.save();
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.drawImage(lineContext.canvas, 0, 0);
  context.restore();
  if (!chosen) return;
  context.fillStyle = `${color}38`;
  context.fill(path);
}

/** @param {Pose} a @param {Pose} b @returns {boolean} */
function samePose(a, b) {
  return JSON.stringify(a) === JSON.stringify(b);
}
