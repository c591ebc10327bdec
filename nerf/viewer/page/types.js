// What the modules of the page hand to each other.

/**
 * A camera as in `toonset.camera`: u = cu + s x / (1 + k z), v = cv + s a y / (1 + k z).
 * @typedef {object} Camera
 * @property {number[]} rotation camera_from_world, nine numbers, row after row
 * @property {number[]} target world point on the optical axis
 * @property {number} scale pixels per world unit at the target's depth
 * @property {number[]} center pixel at which the target appears, the first pixel's centre at 0.5
 * @property {number[]} size width and height in pixels
 * @property {number} k 1 / distance; 0 = orthographic
 * @property {number} aspect fy / fx
 */

/** @typedef {"drawn" | "rgb" | "palette" | "normal" | "depth" | "labels" | "mannequin"} Layer */

/** @typedef {{at: number, type: string, shape: number[]}} ArrayRecord where an array lies in the blob */

/** @typedef {{name: string, rgb: number[], share: number}} Paint a share of 0 is not known */

/**
 * @typedef {object} ViewRecord one drawing of the sheet
 * @property {string} name file name
 * @property {"ok" | "weak" | "ambiguous" | "failed" | ""} verdict "" where no calibration says
 * @property {string} reason in words, "" where there is nothing to say
 * @property {number} yaw degrees
 * @property {number} elevation degrees
 * @property {{yaw: number, elevation: number} | null} sigma degrees
 * @property {Camera} camera
 * @property {number} drawing its layer in `drawings`; -1: it shows no figure
 */

/**
 * @typedef {object} Figure how turntable cameras see it
 * @property {number[]} target
 * @property {number} reach
 * @property {number} fill
 * @property {number} k
 * @property {number[][]} turn yaw, elevation and roll of the pictures of a turn, radians, the first at the start
 */

/**
 * @typedef {object} Scene all numbers of the page
 * @property {string} title
 * @property {{state: string, reasons: string[]} | null} verdict of the run
 * @property {Layer[]} layers that can be shown, the first at the start
 * @property {Figure} figure
 * @property {Paint[]} palette
 * @property {{rgb: number[], width_px: number} | null} pen that draws the outline
 * @property {ViewRecord[]} views
 * @property {any} field the trained field, see `scene.py`; null: nothing is trained yet
 * @property {any} drawings what the drawn look is made of, or null
 */

/**
 * @typedef {object} Shot what the renderer draws
 * @property {Camera} camera its size is the picture's
 * @property {Layer} layer
 * @property {number[][]} colors of the palette, as shown: sRGB, 0 to 255
 * @property {number[] | null} ink colour of the lines, as shown
 * @property {boolean} still full quality; else as fast as turning needs
 */

export {};
