// Starts the page.

import { turntableCamera } from "./camera.js";
import { createCompare } from "./compare.js";
import { part, say } from "./elements.js";
import { createFrusta } from "./frusta.js";
import { createFullScreen } from "./full_screen.js";
import { createLayers } from "./layers.js";
import { createLink } from "./link.js";
import { createOrbit } from "./orbit.js";
import { createOrigins } from "./origins.js";
import { createPainter } from "./painter.js";
import { createPalettePanel } from "./palette_panel.js";
import { createSave } from "./save.js";
import { newCanvas, pictureAt, readBlob, readScene } from "./scene.js";
import { createStage, shotOf } from "./stage.js";
import { createStore, startState } from "./state.js";
import { createTimeline } from "./timeline.js";
import { showVerdict } from "./verdict.js";

/** @typedef {import("./types.js").Shot} Shot */

const NEEDS_PICTURES = ["layers", "recolor", "open_palette", "saving", "spin", "lines", "origins"];
const ZOOM_STEP = 1.25;

const scene = readScene();
const store = createStore(startState(scene));
const view = part("view", HTMLCanvasElement);

part("title", HTMLElement).textContent = scene.title;
showVerdict(scene.verdict);
createLayers(scene, store);
const panel = createPalettePanel(scene, store);
const linked = createLink(scene, store, panel.forget);
createFullScreen();
const stage = createStage(view, scene, store);
const orbit = createOrbit(view, scene, store);
part("closer", HTMLElement).addEventListener("click", () => orbit.zoom(ZOOM_STEP));
part("farther", HTMLElement).addEventListener("click", () => orbit.zoom(1 / ZOOM_STEP));
part("home", HTMLElement).addEventListener("click", orbit.home);
let touched = false;
for (const touch of ["pointerdown", "keydown", "wheel"])
  addEventListener(touch, () => (touched = true), { capture: true, once: true, passive: true });
addEventListener("pointerdown", ({ target }) => target !== part("message", HTMLElement) && say(""));

const blob = await readBlob().catch(() => null);
if (blob) start(blob);
else sayNothingMoves();
const drawings = await Promise.all(scene.views.map(({ picture }) => drawingAt(picture)));
createTimeline(scene, store, drawings);
createCompare(scene, store, drawings);
createFrusta(scene, store);

/** @param {Uint8Array} blob */
function start(blob) {
  const painter = createPainter(view, scene, blob, stage.ask);
  createSave(scene, store, painter);
  createOrigins(scene, store, painter.originsOf);
  stage.use(painter, () => {
    const poster = part("poster", HTMLElement);
    if (poster.hidden) return;
    poster.hidden = true;
    painter.readAll().then(() => linked || touched || orbit.showOff());
  });
  const filled = (/** @type {Partial<Shot> & {side?: number}} */ { side = scene.figure.size, ...shot }) => {
    const sight = shot.sight ?? scene.figure.start;
    const size = [side, side];
    return {
      camera: turntableCamera(scene.figure, scene.sights[sight].angles, size),
      sight,
      layer: scene.layers[0],
      colors: scene.palette.map((paint) => paint.rgb),
      pen: scene.pen && scene.pen.rgb,
      lines: true,
      origins: false,
      ...shot,
    };
  };
  const read = (/** @type {Partial<Shot> & {side?: number}} */ shot) => painter.read(filled(shot));
  const shot = () => shotOf(scene, store.state);
  Object.assign(globalThis, { toonset: { scene, store, shot, read } });
}

/** @param {import("./types.js").Range} range @returns {Promise<HTMLCanvasElement | null>} */
async function drawingAt(range) {
  if (!blob) return null;
  const picture = await pictureAt(blob, range).catch(() => null);
  return picture && newCanvas(picture.width, picture.height, (context) => context.drawImage(picture, 0, 0));
}

/** The page's data cannot be read: its first picture stays. */
function sayNothingMoves() {
  const note = part("fallback", HTMLElement);
  note.hidden = false;
  note.textContent = "This browser cannot read the page's pictures; it takes one of 2023 or later.";
  for (const id of NEEDS_PICTURES) part(id, HTMLElement).toggleAttribute("disabled", true);
}
