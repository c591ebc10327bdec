// What the fit says of the whole sheet, undo and redo, the file.

import { element, part, say } from "../../viewer/page/elements.js";
import { badge } from "../../viewer/page/verdict.js";

/**
 * @param {import("./model.js").Model} model
 * @param {boolean} fits whether cameras and palette follow
 */
export function createStatus(model, fits) {
  const [undo, redo] = [part("undo", HTMLButtonElement), part("redo", HTMLButtonElement)];

  function show() {
    [undo.disabled, redo.disabled] = [!model.past.length, !model.future.length];
    const { state, reason } = model.scene.verdict;
    const notes = [reason, ...model.scene.sheet.notes].filter(Boolean);
    const list = element("ul", {}, ...notes.map((note) => element("li", { dir: "auto" }, note)));
    const place = part("verdict", HTMLElement);
    place.replaceChildren(badge(state, `Sheet ${state || "not rated"}`), ...(notes.length ? [list] : []));
    const at = part("state", HTMLElement);
    at.toggleAttribute("data-busy", fits && model.busy && !model.trouble);
    at.toggleAttribute("data-error", !!model.trouble || (!!model.error && !model.busy));
    at.textContent = stateText(model, fits);
  }

  undo.addEventListener("click", model.undo);
  redo.addEventListener("click", model.redo);
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || isWriting(event.target)) return;
    const key = event.key.toLowerCase();
    if (key === "z" && !event.shiftKey) model.undo();
    else if (key === "y" || key === "z") model.redo();
    else return;
    event.preventDefault();
  });
  addEventListener("pointerdown", ({ target }) => {
    if (target instanceof Element && !target.closest("#sheet, #message, button")) say("");
  });
  part("download", HTMLElement).addEventListener("click", () => {
    const text = `${JSON.stringify(model.said, null, 1)}\n`;
    const link = element("a", { download: "corrections.json" });
    link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  model.listen(show);
  show();
}

/** @param {EventTarget | null} target @returns {boolean} whether it is a field with an undo of its own */
function isWriting(target) {
  return target instanceof HTMLInputElement && ["text", "number"].includes(target.type);
}

/** @param {import("./model.js").Model} model @param {boolean} fits @returns {string} */
function stateText(model, fits) {
  if (!fits) return "This page is a file: save corrections.json, and give it to toonset calibrate --corrections.";
  if (model.trouble) return model.trouble;
  if (model.busy) return "Kept. Fitting…";
  if (model.error) return `Kept, but it cannot be fitted: ${model.error}`;
  const { version, sheet, ...said } = model.said;
  return Object.keys(said).length ? "Kept and fitted." : "Nothing is corrected yet.";
}
