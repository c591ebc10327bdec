// Pictures to keep: the stage as PNG, and a turning figure as an animated one.

import { animatedPng } from "./apng.js";
import { resized } from "./camera.js";
import { part, say } from "./elements.js";
import { shotOf } from "./stage.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */

const TURN_FRAMES = 24;
const FRAME_TIME = 100; // milliseconds
const FRAME_SIZE = 480; // pixels

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 * @param {{read: (shot: Shot) => Promise<HTMLCanvasElement>}} painter
 */
export function createSave(scene, store, painter) {
  const [button, progress] = [part("save_turn", HTMLButtonElement), part("progress", HTMLProgressElement)];
  const words = part("progress_words", HTMLElement);
  let running = false;

  async function savePng() {
    const shot = shotOf(scene, { ...store.state, cameras: false, origins: false, comparison: "slider" });
    const css = part("stage", HTMLElement).clientWidth / shot.camera.size[0];
    const factor = Number(part("factor", HTMLSelectElement).value) * css;
    const camera = resized(shot.camera, factor);
    const file = await encoded(await painter.read({ ...shot, camera }));
    download(file, `${fileName(scene.title)}.png`);
    say(`Saved ${camera.size.join(" × ")} pixels.`);
  }

  async function saveTurn() {
    running = true;
    button.textContent = "Stop";
    progress.hidden = false;
    /** @type {Blob[]} */
    const files = [];
    const size = [FRAME_SIZE, FRAME_SIZE];
    const state = { ...store.state, snapped: -1, cameras: false, origins: false, zoom: 1, pan: [0, 0], size };
    for (let i = 0; i < TURN_FRAMES && running; i++) {
      progress.value = i;
      words.textContent = `${i + 1} of ${TURN_FRAMES}`;
      const shot = shotOf(scene, { ...state, yaw: state.yaw + (360 * i) / TURN_FRAMES });
      files.push(await encoded(await painter.read(shot)));
      await new Promise((resolve) => setTimeout(resolve)); // input comes in between
    }
    if (files.length < TURN_FRAMES) return say("The turntable was stopped.");
    const pictures = await Promise.all(files.map((file) => file.arrayBuffer()));
    download(animatedPng(pictures, FRAME_TIME), `${fileName(scene.title)}-turn.png`);
    say(`Saved a turn of ${TURN_FRAMES} pictures.`);
  }

  /** @param {() => Promise<void>} work */
  async function guarded(work) {
    try {
      await work();
    } catch (error) {
      say(`Could not save: ${error instanceof Error ? error.message : error}`);
    }
  }

  part("save_png", HTMLElement).addEventListener("click", () => guarded(savePng));
  button.addEventListener("click", async () => {
    if (running) return void (running = false);
    await guarded(saveTurn);
    running = false;
    progress.hidden = true;
    words.textContent = "";
    button.textContent = "Save turntable";
  });
}

/**
 * @param {HTMLCanvasElement} canvas
 * @returns {Promise<Blob>} PNG
 */
async function encoded(canvas) {
  const file = await new Promise((/** @type {(file: Blob | null) => void} */ done) => canvas.toBlob(done));
  if (!file) throw new Error("the picture is too large; choose a smaller size");
  return file;
}

/** @param {Blob} file @param {string} name */
function download(file, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** @param {string} title @returns {string} */
function fileName(title) {
  const words = title.replace(/[^\p{L}\p{M}\p{N}\p{Extended_Pictographic}]+/gu, "-").replace(/^-|-$/g, "");
  return Array.from(words).slice(0, 40).join("") || "figure";
}
