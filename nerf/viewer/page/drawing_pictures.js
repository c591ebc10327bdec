// The sheet's drawings as canvases.

import { arrayOf } from "./scene.js";

/**
 * @param {import("./types.js").Scene} scene
 * @param {ArrayBuffer | null} blob
 * @returns {(HTMLCanvasElement | null)[]} of each view; null where there is no drawing
 */
export function drawingPictures(scene, blob) {
  if (!blob || !scene.drawings) return scene.views.map(() => null);
  const whole = scene.drawings.whole;
  const texels = arrayOf(blob, whole);
  const [, height, width] = whole.shape;
  return scene.views.map((view) => {
    if (view.drawing < 0) return null;
    const start = view.drawing * height * width * 4;
    const straight = straightAlpha(texels.subarray(start, start + height * width * 4));
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = view.camera.size;
    canvas.getContext("2d")?.putImageData(new ImageData(straight, width, height), 0, 0);
    return canvas;
  });
}

/**
 * @param {ArrayLike<number>} texels premultiplied
 * @returns {Uint8ClampedArray<ArrayBuffer>}
 */
function straightAlpha(texels) {
  const pixels = new Uint8ClampedArray(texels.length);
  for (let i = 0; i < pixels.length; i += 4) {
    const alpha = texels[i + 3];
    for (let j = i; j < i + 3 && alpha; j++) pixels[j] = (texels[j] * 255) / alpha;
    pixels[i + 3] = alpha;
  }
  return pixels;
}
