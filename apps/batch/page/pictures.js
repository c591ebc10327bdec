// The small pictures of a sheet. A turntable stands until a reader looks at its row, or turns all.

import { element, part } from "../../web/viewer/page/elements.js";

/** @typedef {import("./rows.js").Sheet} Sheet */
/** @typedef {{picture: HTMLElement, play: (plays: boolean) => void}} Turn */

const FOLDER_OF_PICTURES = "thumbs";

/** @returns {(sheet: Sheet, row: HTMLElement) => HTMLElement} makes a turntable that its row starts */
export function createTurns() {
  const button = part("turn", HTMLButtonElement);
  /** @type {Set<Turn>} */
  const turns = new Set();
  const all = () => button.getAttribute("aria-pressed") === "true";
  button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", String(!all()));
    for (const turn of turns) turn.play(all());
  });
  return (sheet, row) => {
    for (const turn of turns) if (!turn.picture.isConnected) turns.delete(turn);
    const turn = turnOf(sheet, all());
    const start = () => turn.play(true);
    const stop = () => turn.play(all() || row.matches(":hover, :focus-within"));
    row.addEventListener("pointerenter", start);
    row.addEventListener("focusin", start);
    row.addEventListener("pointerleave", stop);
    row.addEventListener("focusout", () => setTimeout(stop));
    setTimeout(() => turns.add(turn));
    return turn.picture;
  };
}

/**
 * @param {Sheet} sheet
 * @returns {HTMLElement}
 */
export function overlayOf(sheet) {
  const place = element("span", { class: "picture" });
  if (sheet.overlay) place.append(smallPicture(sheet, ".webp", place));
  return place;
}

/**
 * @param {Sheet} sheet
 * @param {boolean} plays
 * @returns {Turn}
 */
function turnOf(sheet, plays) {
  const picture = element("span", { class: "picture turn" });
  if (!sheet.turntable) return { picture, play: () => {} };
  const moving = smallPicture(sheet, ".turn.webp", picture);
  const still = element("canvas", { "aria-hidden": "true" });
  const show = () => {
    if (moving.complete && moving.naturalWidth) picture.replaceChildren(plays ? moving : still);
  };
  moving.addEventListener("load", () => {
    still.width = moving.naturalWidth;
    still.height = moving.naturalHeight;
    still.getContext("2d")?.drawImage(moving, 0, 0);
    show();
  });
  picture.append(moving);
  return {
    picture,
    play(now) {
      if (now === plays) return;
      plays = now;
      show();
    },
  };
}

/**
 * @param {Sheet} sheet
 * @param {string} end of the file's name
 * @param {HTMLElement} place that stays empty where there is no such file
 * @returns {HTMLImageElement}
 */
function smallPicture(sheet, end, place) {
  const src = `${FOLDER_OF_PICTURES}/${encodeURIComponent(sheet.name)}${end}`;
  const made = element("img", { loading: "lazy", decoding: "async", alt: "", src });
  made.addEventListener("error", () => place.replaceChildren());
  return made;
}
