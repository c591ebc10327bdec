// What the modules of the page hand to each other.

/** @typedef {number[]} Box x, y, width, height in pixels of the sheet */
/** @typedef {number[]} Point x, y in pixels of the sheet */
/** @typedef {"figures" | "cameras" | "palette"} Mode */

/**
 * @typedef {object} ViewRecord one drawing, as it was fitted
 * @property {string} name file name
 * @property {Box} box of what the figure covers
 * @property {Box} crop of its picture
 * @property {string} caption what the sheet itself calls it; empty where it does not
 * @property {"ok" | "weak" | "ambiguous" | "failed" | ""} verdict
 * @property {string} reason in words
 * @property {{yaw: number, elevation: number}} sigma degrees
 * @property {number} yaw degrees
 * @property {number} elevation degrees
 * @property {number} roll degrees
 * @property {any} camera see `toonset.camera`, in pixels of the sheet
 * @property {string} mask what the figure covers of the crop, as a small picture
 * @property {string | null} labels the label map of the crop, as a picture
 */

/** @typedef {{color: string, name: string, share: number}} Paint */

/**
 * @typedef {object} Scene the bundle
 * @property {string} title
 * @property {{name: string, sha256: string, size: number[], background: string | null, notes: string[], picture?: string}} sheet
 * @property {{rows: Box[][], why: string, outfits: boolean}[]} groups of equal figures, the likeliest turnaround first
 * @property {number} group that is fitted, from 1
 * @property {string} outfit letter of its row that is fitted, "" for all
 * @property {{box: Box, kind: string}[]} leftOut what the splitter saw besides
 * @property {{state: string, reason: string}} verdict of the sheet
 * @property {ViewRecord[]} views
 * @property {{vertices: string, faces: string, middle: number[], height: number} | null} mannequin
 * @property {{colors: Paint[], dropped: Paint[]}} palette
 */

/**
 * @typedef {object} CameraSaid a camera as a person placed it
 * @property {number} yaw degrees
 * @property {number} elevation degrees
 * @property {number} roll degrees
 * @property {number} scale pixels per world unit
 * @property {Point} middle where the middle of the mannequin's bounds appears
 */

/**
 * @typedef {object} ViewSaid what a person said of one view
 * @property {Box} box
 * @property {boolean} [exclude]
 * @property {string} [label]
 * @property {CameraSaid} [camera]
 * @property {boolean} [lock]
 * @property {{world: number[], pixel: Point}[]} [landmarks]
 */

/** @typedef {{box: Box, color: string, radius: number, points: Point[]}} Stroke */

/**
 * @typedef {object} PaletteSaid what a person said of the colours
 * @property {string[]} [keep]
 * @property {string[]} [drop]
 * @property {string[][]} [merge] the first of each stays
 * @property {{color: string, into: string[]}[]} [split]
 * @property {Record<string, string>} [names]
 * @property {Stroke[]} [strokes]
 */

/**
 * @typedef {object} Corrections corrections.json
 * @property {1} version
 * @property {{name: string, sha256: string, size: number[]}} [sheet]
 * @property {string} [background]
 * @property {Box[]} [boxes]
 * @property {number} [group] from 1, without boxes
 * @property {string} [outfit] letter of its row
 * @property {ViewSaid[]} [views]
 * @property {PaletteSaid} [palette]
 */

/**
 * @typedef {object} Figure a box on the sheet, and what is known of it
 * @property {Box} box
 * @property {ViewRecord | null} view null: not fitted (yet)
 * @property {ViewSaid | null} said
 */

/**
 * @typedef {object} Drag of a pointer on the sheet
 * @property {(at: Point, event: PointerEvent) => void} move
 * @property {() => void} end it is let go
 */

/**
 * @typedef {object} Tool what the sheet does in a mode
 * @property {(context: CanvasRenderingContext2D, px: number) => void} draw over the sheet, in its pixels; `px` is one of the screen's
 * @property {(at: Point, event: PointerEvent, px: number) => Drag | null} down null: the sheet moves
 * @property {(event: KeyboardEvent) => boolean} key whether it was for the tool
 * @property {(at: Point, px: number) => string} cursor
 */

export {};
