// Draws a scene. (Stub: shows the drawing nearest to the camera.)

import { angleBetween } from "./camera.js";
import { arrayOf } from "./scene.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */

/**
 * @param {HTMLCanvasElement} canvas that pictures appear in
 * @param {Scene} scene
 * @param {ArrayBuffer} blob its arrays
 */
export async function createRenderer(canvas, scene, blob) {
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const whole = arrayOf(blob, scene.drawings.whole);
  const [, height, width] = scene.drawings.whole.shape;
  return {
    /** @param {Shot} shot */
    draw(shot) {
      [canvas.width, canvas.height] = shot.camera.size;
      const angles = scene.views.map((view) => angleBetween(view.camera, shot.camera));
      const best = angles.indexOf(Math.min(...angles));
      const size = width * height * 4;
      const pixels = new Uint8ClampedArray(whole.slice(best * size, (best + 1) * size));
      context.putImageData(new ImageData(pixels, width, height), 0, 0);
    },
    /**
     * @param {Shot} shot
     * @returns {ImageData} straight alpha
     */
    read(shot) {
      this.draw(shot);
      return context.getImageData(0, 0, canvas.width, canvas.height);
    },
  };
}
