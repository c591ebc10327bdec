// Where the browser cannot draw in 3D: the pictures of a whole turn, placed as the camera asks.

import { turntableCamera } from "./camera.js";
import { offsetOf } from "./framing.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */

/**
 * @param {HTMLImageElement} image
 * @param {Scene} scene
 * @param {string[]} pictures data URLs, in the order of the figure's turn
 */
export function createTurnPictures(image, scene, pictures) {
  return {
    /** @param {Shot} shot */
    draw({ camera }) {
      if (!pictures.length) return;
      const [x, , z] = camera.rotation.slice(6);
      const { turn } = scene.figure;
      const near = turn.map(([yaw]) => Math.cos(yaw - Math.atan2(-x, -z)));
      const i = near.indexOf(Math.max(...near));
      const shown = turntableCamera(scene.figure, turn[i][0], turn[i][1], camera.size);
      const factor = camera.scale / shown.scale;
      const target = offsetOf(camera, shown.target);
      const [moveX, moveY] = target.map((v, axis) => ((v - shown.center[axis]) / camera.size[axis]) * 100);
      if (image.src !== pictures[i]) image.src = pictures[i];
      image.style.transform = `translate(${moveX}%, ${moveY}%) scale(${factor})`;
    },
  };
}
