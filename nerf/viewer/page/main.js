// Starts the page.

import { turntableCamera } from "./camera.js";
import { createRenderer } from "./renderer.js";
import { readBlob, readScene } from "./scene.js";

const scene = readScene();
const canvas = /** @type {HTMLCanvasElement} */ (document.getElementById("view"));
const renderer = await createRenderer(canvas, scene, await readBlob());

/**
 * @param {Partial<import("./types.js").Shot>} shot
 * @returns {import("./types.js").Shot}
 */
function filled(shot) {
  const camera = shot.camera ?? turntableCamera(scene.figure, 0, 0, [400, 400]);
  const colors = shot.colors ?? scene.palette.map((paint) => paint.rgb);
  return { camera, layer: shot.layer ?? scene.layers[0], colors, ink: shot.ink ?? null, still: shot.still ?? true };
}

renderer.draw(filled({}));
document.getElementById("poster")?.remove();
Object.assign(globalThis, {
  toonset: { scene, draw: (/** @type {any} */ s) => renderer.draw(filled(s)), read: (/** @type {any} */ s) => renderer.read(filled(s)) },
});
