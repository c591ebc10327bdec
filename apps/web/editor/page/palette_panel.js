// The paints: which are one, which none, which several, what they are called; all can be taken back.

import { divided, dropped, merged, withPalette } from "./corrections.js";
import { element, part, say } from "../../viewer/page/elements.js";

/** @typedef {import("./types.js").Paint} Paint */
/** @typedef {import("./types.js").PaletteSaid} PaletteSaid */
/** @typedef {{item: HTMLElement, show: (paint: Paint) => void}} PaintRow */

const LONGEST = 200; // letters of a name

/** @param {import("./model.js").Model} model */
export function createPalettePanel(model) {
  /** @type {string[]} in the order in which they were chosen */
  let chosen = [];
  let shown = "";
  /** @type {Map<string, PaintRow>} by colour: who writes in one goes on, whatever is fitted meanwhile */
  const rows = new Map();

  const colors = () => model.scene.palette.colors;
  const said = () => model.said.palette ?? {};

  function show() {
    chosen = chosen.filter((color) => colors().some((paint) => paint.color === color));
    const now = JSON.stringify([model.scene.palette, said()]);
    if (now !== shown) build();
    shown = now;
    part("merge_paints", HTMLButtonElement).disabled = chosen.length < 2;
    part("drop_paints", HTMLButtonElement).disabled = !chosen.length || chosen.length >= colors().length;
    part("split_paint", HTMLButtonElement).disabled = chosen.length !== 1;
  }

  function build() {
    const items = colors().map((paint) => {
      const row = rows.get(paint.color) ?? paintRow(paint.color);
      rows.set(paint.color, row);
      row.show(paint);
      return row.item;
    });
    const list = part("swatches", HTMLElement);
    if (items.length !== list.children.length || items.some((item, i) => item !== list.children[i])) list.replaceChildren(...items);
    part("dropped", HTMLElement).replaceChildren(...model.scene.palette.dropped.map(droppedRow));
    part("dropped_row", HTMLElement).hidden = !model.scene.palette.dropped.length;
    const done = doneRows(said(), (change) => model.change(withPalette(model.said, change)));
    part("done", HTMLElement).replaceChildren(...done);
    part("done_row", HTMLElement).hidden = !done.length;
  }

  /** @param {string} color @returns {PaintRow} */
  function paintRow(color) {
    const check = element("input", { type: "checkbox", "aria-label": `Choose ${color}` });
    check.addEventListener("change", () => {
      chosen = check.checked ? [...chosen, color] : chosen.filter((one) => one !== color);
      show();
    });
    const input = element("input", { type: "text", maxlength: String(LONGEST), dir: "auto", "aria-label": `Name of ${color}` });
    input.addEventListener("change", () => rename(color, input.value.trim()));
    const percent = element("span", { class: "share" });
    return {
      item: element("li", {}, check, swatch(color), input, percent),
      show({ name, share }) {
        check.checked = chosen.includes(color);
        if (document.activeElement !== input) input.value = said().names?.[color] ?? name;
        percent.textContent = `${(100 * share).toFixed(0)} %`;
      },
    };
  }

  /** @param {string} color @param {string} name */
  function rename(color, name) {
    const { [color]: old, ...others } = said().names ?? {};
    model.change(withPalette(model.said, { names: name ? { ...others, [color]: name } : others }));
  }

  /** @param {Paint} paint */
  function droppedRow({ color, name, share }) {
    const button = element("button", { type: "button", "aria-label": `Keep ${color}` }, "Keep");
    button.addEventListener("click", () => {
      const gone = said().drop?.filter((one) => one !== color);
      model.change(withPalette(model.said, { keep: [...new Set([...(said().keep ?? []), color])], drop: gone }));
    });
    const word = element("bdi", { class: "name" }, name || color);
    return element("li", {}, swatch(color), word, element("span", { class: "share" }, `${(100 * share).toFixed(1)} %`), button);
  }

  /** @param {string} id @param {() => void} act */
  const on = (id, act) => part(id, HTMLElement).addEventListener("click", act);
  /** @param {import("./types.js").Corrections} next */
  function act(next) {
    [chosen, shown] = [[], ""];
    model.change(next);
  }

  on("merge_paints", () => act(merged(model.said, chosen)));
  on("drop_paints", () => act(chosen.reduce(dropped, model.said)));
  model.listen(show);
  show();
  return {
    /** @returns {string | null} the paint of the brush */
    paint: () => (chosen.length === 1 ? chosen[0] : null),
    /** @param {(text: string, take: ((color: string) => void) | null) => void} pick a colour of the drawing */
    splitWith(pick) {
      on("split_paint", () => {
        const color = chosen[0];
        pick("Click the first of its colours on a drawing.", (first) =>
          pick("Now click the second one.", (second) => {
            pick("", null);
            if (first === second) return say("Those two are the same colour.");
            act(divided(model.said, color, [first, second]));
          }),
        );
      });
    },
  };
}

/**
 * @param {PaletteSaid} said
 * @param {(change: PaletteSaid) => void} change
 * @returns {HTMLElement[]} what was done, each with a button that takes it back
 */
function doneRows(said, change) {
  /** @type {[string, string[], PaletteSaid][]} word, colours, what takes it back */
  const rows = [];
  for (const color of said.keep ?? []) rows.push(["kept", [color], { keep: lacking(said.keep, color) }]);
  for (const color of said.drop ?? []) rows.push(["dropped", [color], { drop: lacking(said.drop, color) }]);
  for (const group of said.merge ?? []) rows.push(["merged", group, { merge: lacking(said.merge, group) }]);
  for (const one of said.split ?? []) rows.push(["split", [one.color, ...one.into], { split: lacking(said.split, one) }]);
  const strokes = said.strokes?.length ?? 0;
  if (strokes) {
    const used = [...new Set(said.strokes?.map((stroke) => stroke.color))];
    rows.push([`${strokes} brush ${strokes === 1 ? "stroke" : "strokes"}`, used, { strokes: [] }]);
  }
  return rows.map(([word, colors, back]) => {
    const name = `Take back: ${word} ${colors.join(", ")}`;
    const button = element("button", { type: "button", "aria-label": name }, "Take back");
    button.addEventListener("click", () => change(back));
    return element("li", {}, ...colors.map(swatch), element("span", { class: "name" }, word), button);
  });
}

/** @template T @param {T[] | undefined} list @param {T} one @returns {T[]} */
function lacking(list, one) {
  return (list ?? []).filter((other) => other !== one);
}

/** @param {string} color @returns {HTMLElement} */
function swatch(color) {
  const made = element("span", { class: "swatch", title: color });
  made.style.backgroundColor = color;
  return made;
}
