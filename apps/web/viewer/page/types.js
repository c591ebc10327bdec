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

/** @typedef {"drawn" | "rgb" | "palette" | "normal" | "depth" | "mannequin"} Layer */

/** @typedef {[number, number]} Range where something begins in the blob, and how many bytes it is */

/**
 * @typedef {object} LayeredRecord a picture in layers, in any colours
 * @property {number[]} box left, top, width and height in the view, its pixels
 * @property {number[]} size width and height of the layers
 * @property {Range} maps
 * @property {Range | null} light a WebP picture of how colours differ from their paints
 * @property {Range} [color] a WebP picture of the colours themselves, of drawings that are shaded throughout
 * @property {{size: number[], mirrored: number, guessed: number, map: Range} | null} [origins] what no
 *   drawing shows: a byte per pixel (0 drawn, 1 mirrored, 2 guessed) over the box; and their shares
 * @property {undefined} [picture]
 */

/** @typedef {{box: number[], picture: Range, maps?: any, light?: any, color?: any, size?: any}} PictureRecord a WebP picture */

/** @typedef {any} LayerRecord a `LayeredRecord` or a `PictureRecord` */

/**
 * @typedef {object} Coding how a `LayeredRecord` is to be read
 * @property {number} levels of alpha and ink, from nothing to all
 * @property {number} parts of a mixture
 * @property {number} middle the level of `light` that changes nothing: see nerf/layered_views/light.py
 * @property {number} darkest the level of black
 * @property {number} lightest the level of white
 * @property {number} brightest the largest gain
 * @property {number} tint levels of a colour for one of `light`
 */

/**
 * @typedef {object} Sight one of the views that the page holds
 * @property {number[]} angles yaw, elevation and roll, radians
 * @property {number} level which of the figure's elevations it belongs to; -1: only a drawing is seen so
 * @property {Partial<Record<Layer, LayerRecord | null>>} layers null: nothing is seen
 */

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
 * @property {number} sight the view from its camera
 * @property {Range} picture the drawing, a WebP picture
 */

/**
 * @typedef {object} Figure how the views see it: square pictures with the target in the middle
 * @property {number[]} target
 * @property {number} reach
 * @property {number} fill
 * @property {number} k
 * @property {number} size side of a view, pixels
 * @property {number[]} elevations of its rings of views, degrees, rising
 * @property {number} start the view that is shown first
 */

/**
 * @typedef {object} Scene all numbers of the page
 * @property {string} title
 * @property {{state: string, reasons: string[]} | null} verdict of the run
 * @property {Layer[]} layers that can be shown, the first at the start
 * @property {Figure} figure
 * @property {Paint[]} palette
 * @property {number[][]} paints of the drawn look: the palette's, the lines', if there are any
 * @property {Coding} coding
 * @property {{rgb: number[]} | null} pen that draws the lines
 * @property {ViewRecord[]} views
 * @property {Sight[]} sights
 */

/**
 * @typedef {object} Shot what the painter shows
 * @property {Camera} camera its size is the picture's
 * @property {number} sight the view that stands for it
 * @property {Layer} layer
 * @property {number[][]} colors of the palette, as shown: sRGB, 0 to 255
 * @property {number[] | null} pen colour of the lines; null: there are none
 * @property {boolean} lines whether the outline is shown
 * @property {boolean} origins whether it is shown what no drawing shows
 */

export {};
