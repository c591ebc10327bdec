// Starts the page.

import { createCamerasTool } from "./cameras_tool.js";
import { createCards } from "./cards.js";
import { createFiguresTool, nameOf } from "./figures_tool.js";
import { createGroups } from "./groups.js";
import { createKeeper } from "./keeper.js";
import { createModel } from "./model.js";
import { createPalettePanel } from "./palette_panel.js";
import { createPaletteTool } from "./palette_tool.js";
import { createPosePanel } from "./pose_panel.js";
import { createSheet } from "./sheet.js";
import { createStatus } from "./status.js";
import { pictureOf } from "./outline_error.js";
import { hexOf } from "../../viewer/page/colors.js";
import { part, radioGroup, say } from "../../viewer/page/elements.js";

/** @typedef {import("./keeper.js").News} News */
/** @typedef {import("./types.js").Mode} Mode */

const MODES = { figures: "Figures", cameras: "Cameras", palette: "Palette" };

/** @type {News | null} */
let first = null;
/** @type {import("./model.js").Model | null} */
let model = null;

/** @param {News} news */
function hear(news) {
  if (!model) first = { ...first, ...news };
  else if (news.other) (say("Another tab has changed this; both now show the same."), model.take(news));
  else model.take(news);
}

/** @param {string} trouble */
function warn(trouble) {
  say(trouble);
  if (!model) return;
  model.trouble = trouble;
  model.tell();
}

try {
  const data = JSON.parse(part("data", HTMLElement).textContent ?? "null");
  const keeper = await createKeeper(data, hear, warn);
  if (first) await start(/** @type {News} */ (first), keeper);
} catch (error) {
  part("trouble", HTMLElement).hidden = false;
  part("trouble", HTMLElement).textContent = error instanceof Error ? error.message : String(error);
}

/** @param {News} news @param {import("./keeper.js").Keeper} keeper */
async function start({ scene, corrections, busy, error }, keeper) {
  if (!scene) return;
  const shown = (model = createModel(scene, corrections));
  [shown.save, shown.busy, shown.error] = [keeper.save, busy || !keeper.fits, error];
  const picture = await pictureOf(scene.sheet.picture ?? "");
  part("work", HTMLElement).hidden = false;
  const colorAt = colorsOf(picture, scene.sheet.size);
  part("title", HTMLElement).textContent = document.title = scene.title;

  const cameras = createCamerasTool(shown, keeper.fits);
  const panel = createPalettePanel(shown);
  const palette = createPaletteTool(shown, colorAt, panel.paint, () => sheet.draw());
  panel.splitWith(palette.pick);
  const tools = { figures: createFiguresTool(shown, picture, colorAt), cameras: cameras.tool, palette: palette.tool };
  const sheet = createSheet(shown, picture, () => tools[shown.mode]);
  createGroups(shown, picture);
  createCards(shown, cameras.shownPose, sheet.look);
  createPosePanel(shown, cameras);
  createStatus(shown, keeper.fits);

  const modes = radioGroup("mode", MODES, (mode) => shown.show({ mode: /** @type {Mode} */ (mode) }));
  part("modes", HTMLElement).append(...modes.parts);
  const showMode = () => {
    modes.show(shown.mode);
    for (const one of document.querySelectorAll("[data-modes]")) {
      const modes = /** @type {HTMLElement} */ (one).dataset.modes ?? "";
      one.toggleAttribute("hidden", !modes.split(" ").includes(shown.mode));
    }
  };
  shown.listen(showMode);
  showMode();
  Object.assign(globalThis, { toonset: { model: shown, sheet, cameras, nameOf } });
}

/** @param {HTMLImageElement} picture @param {number[]} size @returns {(at: number[]) => string} */
function colorsOf(picture, [width, height]) {
  const context = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("this browser draws no pictures");
  [context.canvas.width, context.canvas.height] = [width, height];
  context.drawImage(picture, 0, 0, width, height);
  return ([x, y]) => {
    const { data } = context.getImageData(Math.floor(x), Math.floor(y), 1, 1);
    return hexOf([...data.slice(0, 3)]);
  };
}
