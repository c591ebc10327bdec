// Starts the page.

import { turntableCamera } from "./camera.js";
import { createCompare } from "./compare.js";
import { drawingPictures } from "./drawing_pictures.js";
import { part } from "./elements.js";
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

const blob = await readBlob().catch(() => null);
const drawings = drawingPictures(scene, blob);
createTimeline(scene, store, drawings);
createCompare(scene, store, drawings);
createFrusta(scene, store);
try {
  if (!blob) throw new Error("the page's data cannot be read");
  await draw(await createRenderer(view, scene, blob));
} catch (error) {
  turnPictures();
}

/** @param {Awaited<ReturnType<typeof createRenderer>>} renderer */
async function draw(renderer) {
  stage.use(renderer, () => (poster.hidden = true), turnPictures);
  view.addEventListener("webglcontextlost", turnPictures);
  createSave(scene, store, renderer, stage.ask);
  const filled = (/** @type {Partial<Shot>} */ shot) => ({
    camera: turntableCamera(scene.figure, 0, 0, [400, 400]),
    layer: scene.layers[0],
    colors: scene.palette.map((paint) => paint.rgb),
    ink: null,
    still: true,
    ...shot,
  });
  Object.assign(globalThis, {
    toonset: {
      scene,
      store,
      draw: (/** @type {Partial<Shot>} */ shot) => renderer.draw(filled(shot)),
      read: (/** @type {Partial<Shot>} */ shot) => renderer.read(filled(shot)),
    },
  });
}

/** The browser cannot draw in 3D, or no longer: fixed pictures turn instead. */
function turnPictures() {
  const pictures = readTurn();
  const note = part("fallback", HTMLElement);
  note.textContent = pictures.length
    ? `This browser cannot draw the figure in 3D (WebGL 2): ${pictures.length} fixed pictures turn instead, without layers, recolouring and saving.`
    : "This browser cannot draw the figure in 3D (WebGL 2), and the page holds no pictures of it.";
  note.hidden = false;
  for (const id of NEEDS_3D) part(id, HTMLElement).toggleAttribute("disabled", true);
  view.classList.add("blank");
  stage.use(createTurnPictures(poster, scene, pictures), () => {}, () => {});
}
