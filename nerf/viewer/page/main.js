// Starts the page.

import { turntableCamera } from "./camera.js";
import { createCompare } from "./compare.js";
import { drawingPictures } from "./drawing_pictures.js";
import { part, say } from "./elements.js";
import { createFrusta } from "./frusta.js";
import { createLayers } from "./layers.js";
import { createLink } from "./link.js";
import { createOrbit } from "./orbit.js";
import { createPalettePanel } from "./palette_panel.js";
import { createRenderer } from "./renderer.js";
import { createSave } from "./save.js";
import { readBlob, readScene, readTurn } from "./scene.js";
import { createStage } from "./stage.js";
import { createStore, startState } from "./state.js";
import { createTimeline } from "./timeline.js";
import { createTurnPictures } from "./turn_pictures.js";
import { showVerdict } from "./verdict.js";

/** @typedef {import("./types.js").Shot} Shot */

const NEEDS_3D = ["layers", "recolor", "open_palette", "saving"];
const ZOOM_STEP = 1.25;

const scene = readScene();
const store = createStore(startState(scene));
const view = part("view", HTMLCanvasElement);
const poster = part("poster", HTMLImageElement);

part("title", HTMLElement).textContent = scene.title;
showVerdict(scene.verdict);
createLayers(scene, store);
const panel = createPalettePanel(scene, store);
createLink(scene, store, panel.forget);
const stage = createStage(view, scene, store);
const orbit = createOrbit(view, scene, store);
part("closer", HTMLElement).addEventListener("click", () => orbit.zoom(ZOOM_STEP));
part("farther", HTMLElement).addEventListener("click", () => orbit.zoom(1 / ZOOM_STEP));
part("home", HTMLElement).addEventListener("click", orbit.home);
addEventListener("pointerdown", ({ target }) => target !== part("message", HTMLElement) && say(""));

const pictures = readTurn();
const turnPictures = createTurnPictures(poster, scene, pictures);
stage.use(
  turnPictures,
  () => {},
  () => {},
); // until the renderer is ready, too

const blob = await readBlob().catch(() => null);
const drawings = drawingPictures(scene, blob);
createTimeline(scene, store, drawings);
createCompare(scene, store, drawings);
createFrusta(scene, store);

/** @type {Awaited<ReturnType<typeof createRenderer>>} */
let renderer;
createSave(scene, store, () => renderer, stage.ask);
view.addEventListener("webglcontextrestored", start);
view.addEventListener("webglcontextlost", (event) => {
  event.preventDefault(); // so that it may be restored
  fallBack();
});
await start();

async function start() {
  try {
    if (!blob) throw new Error("the page's data cannot be read");
    renderer = await createRenderer(view, scene, blob);
  } catch {
    return fallBack();
  }
  allow3d(true);
  stage.use(renderer, () => (poster.hidden = true), fallBack);
  const filled = (/** @type {Partial<Shot>} */ shot) => ({
    camera: turntableCamera(scene.figure, 0, 0, [400, 400]),
    layer: scene.layers[0],
    colors: scene.palette.map((paint) => paint.rgb),
    ink: null,
    still: true,
    ...shot,
  });
  const draw = (/** @type {Partial<Shot>} */ shot) => renderer.draw(filled(shot));
  const read = (/** @type {Partial<Shot>} */ shot) => renderer.read(filled(shot));
  Object.assign(globalThis, { toonset: { scene, store, draw, read } });
}

/** The browser cannot draw in 3D, or no longer: the fixed pictures turn instead. */
function fallBack() {
  allow3d(false);
  poster.hidden = !pictures.length;
  stage.use(
    turnPictures,
    () => {},
    () => {},
  );
}

/** @param {boolean} can */
function allow3d(can) {
  const note = part("fallback", HTMLElement);
  note.hidden = can;
  const instead = pictures.length
    ? `${pictures.length} fixed pictures turn instead, without layers, recolouring and saving.`
    : "the page holds no pictures of it to show instead.";
  note.textContent = `This browser cannot draw the figure in 3D (WebGL 2): ${instead}`;
  for (const id of NEEDS_3D) part(id, HTMLElement).toggleAttribute("disabled", !can);
  view.classList.toggle("blank", !can);
}
