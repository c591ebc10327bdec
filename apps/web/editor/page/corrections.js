// What a person said, as corrections.json has it: reading it, and making the next one. Nothing is
// changed in place, so that every step can be undone.

/** @typedef {import("./types.js").Box} Box */
/** @typedef {import("./types.js").Corrections} Corrections */
/** @typedef {import("./types.js").Figure} Figure */
/** @typedef {import("./types.js").PaletteSaid} PaletteSaid */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").ViewSaid} ViewSaid */

const SAME = 0.5; // intersection over union of two boxes of one figure

/** @param {Box} a @param {Box} b @returns {number} intersection over union */
export function overlapOf(a, b) {
  const wide = Math.min(a[0] + a[2], b[0] + b[2]) - Math.max(a[0], b[0]);
  const high = Math.min(a[1] + a[3], b[1] + b[3]) - Math.max(a[1], b[1]);
  const both = Math.max(0, wide) * Math.max(0, high);
  return both / (a[2] * a[3] + b[2] * b[3] - both || 1);
}

/**
 * @template {{box: Box}} T
 * @param {T[] | undefined} entries
 * @param {Box} box
 * @returns {T | null} the one of the same figure
 */
export function matching(entries, box) {
  let best = null;
  let most = SAME;
  for (const entry of entries ?? []) {
    const overlap = overlapOf(entry.box, box);
    if (overlap >= most) [best, most] = [entry, overlap];
  }
  return best;
}

/**
 * @param {Scene} scene
 * @param {Corrections} said
 * @returns {Figure[]} in the order of the views
 */
export function figuresOf(scene, said) {
  const found = scene.views.map((view) => view.box);
  const excluded = (said.views ?? []).filter((view) => view.exclude).map((view) => view.box);
  const apart = excluded.filter((box) => !matching(scene.views, box));
  const { group = 1, outfit = "" } = said;
  const asFitted = group === scene.group && outfit === scene.outfit;
  const cut = asFitted ? [...found, ...apart] : boxesOf(scene, group, outfit);
  return (said.boxes ?? cut).map((box) => ({
    box,
    view: matching(scene.views, box),
    said: matching(said.views, box),
  }));
}

/** @param {Scene} scene @param {number} group from 1 @param {string} outfit letter of a row, "" for all @returns {Box[]} */
function boxesOf(scene, group, outfit) {
  const rows = scene.groups[group - 1]?.rows ?? [];
  return (outfit ? [rows[outfit.charCodeAt(0) - 65] ?? []] : rows).flat();
}

/**
 * @param {Scene} scene
 * @param {Corrections} said
 * @param {number} group from 1, the likeliest
 * @param {string} outfit letter of a row, "" for all
 * @returns {Corrections} that takes those figures, and keeps what was said of them
 */
export function withGroup(scene, said, group, outfit) {
  const boxes = boxesOf(scene, group, outfit);
  const views = said.views?.filter((view) => boxes.some((box) => overlapOf(view.box, box) > 0));
  return without({
    ...said,
    boxes: undefined,
    group: group > 1 ? group : undefined,
    outfit: outfit || undefined,
    views: views?.length ? views : undefined,
  });
}

/**
 * @param {Corrections} said
 * @param {Box} box of the figure
 * @param {Partial<ViewSaid>} change undefined takes an entry away
 * @returns {Corrections}
 */
export function withView(said, box, change) {
  const old = matching(said.views, box);
  const whole = without(/** @type {ViewSaid} */ ({ box: rounded(box), ...old, ...change }));
  const others = (said.views ?? []).filter((view) => view !== old);
  const views = Object.keys(whole).length > 1 ? [...others, whole] : others;
  return without({ ...said, views: views.length ? views : undefined });
}

/**
 * @param {Corrections} said
 * @param {Box[]} boxes all figures
 * @param {Map<Box, Box>} moved old and new box of figures that keep what was said of them
 * @returns {Corrections}
 */
export function withBoxes(said, boxes, moved = new Map()) {
  /** @type {Corrections} */
  let next = without({ ...said, boxes: boxes.map(rounded), group: undefined, outfit: undefined });
  for (const [old, box] of moved) {
    if (matching(said.views, old)) next = withView(next, old, { box: rounded(box) });
  }
  return next;
}

/** @param {Corrections} said @param {PaletteSaid} change @returns {Corrections} */
export function withPalette(said, change) {
  const all = without({ ...said.palette, ...change });
  const kept = Object.entries(all).filter(([, value]) => Object.keys(value).length);
  return without({ ...said, palette: kept.length ? Object.fromEntries(kept) : undefined });
}

/**
 * @param {Corrections} said
 * @param {string[]} colors the first stays
 * @returns {Corrections} in which they are one
 */
export function merged(said, colors) {
  const [into, ...from] = colors;
  const old = said.palette ?? {};
  const isOf = (/** @type {string[]} */ group) => colors.includes(group[0]);
  const members = (old.merge ?? []).filter(isOf).flat();
  const group = [...new Set([into, ...from, ...members])];
  return withPalette(said, {
    merge: [...(old.merge ?? []).filter((one) => !isOf(one)), group],
    keep: old.keep?.filter((color) => !from.includes(color)),
    split: old.split?.filter((one) => !colors.includes(one.color)),
    strokes: old.strokes?.map((one) => (from.includes(one.color) ? { ...one, color: into } : one)),
  });
}

/** @param {Corrections} said @param {string} color @returns {Corrections} in which it is no paint */
export function dropped(said, color) {
  const old = said.palette ?? {};
  const group = (old.merge ?? []).find(([into]) => into === color) ?? [color];
  return withPalette(said, {
    drop: [...new Set([...(old.drop ?? []), ...group])],
    merge: old.merge?.filter(([into]) => into !== color),
    keep: old.keep?.filter((one) => one !== color),
    split: old.split?.filter((one) => one.color !== color),
    strokes: old.strokes?.filter((one) => one.color !== color),
  });
}

/** @param {Corrections} said @param {string} color @param {string[]} into @returns {Corrections} */
export function divided(said, color, into) {
  const old = said.palette ?? {};
  return withPalette(said, {
    split: [...(old.split ?? []).filter((one) => one.color !== color), { color, into }],
    merge: old.merge?.filter(([first]) => first !== color),
    strokes: old.strokes?.filter((one) => one.color !== color),
  });
}

/** @param {Box} box @returns {Box} whole pixels, outwards */
export function rounded([x, y, width, height]) {
  const [left, top] = [Math.floor(x), Math.floor(y)];
  return [left, top, Math.ceil(x + width) - left, Math.ceil(y + height) - top];
}

/** @template {object} T @param {T} entries @returns {T} without those that are undefined */
function without(entries) {
  const kept = Object.entries(entries).filter(([, value]) => value !== undefined);
  return /** @type {T} */ (Object.fromEntries(kept));
}
