// The stage over the whole screen, where the browser lets it.

import { part, say } from "./elements.js";

export function createFullScreen() {
  const [button, stage] = [part("full", HTMLButtonElement), part("stage", HTMLElement)];
  button.hidden = !document.fullscreenEnabled;
  button.addEventListener("click", async () => {
    try {
      await (document.fullscreenElement ? document.exitFullscreen() : stage.requestFullscreen());
    } catch {
      say("The browser does not let the page fill the screen.");
    }
  });
  document.addEventListener("fullscreenchange", () => {
    button.setAttribute("aria-pressed", String(document.fullscreenElement === stage));
  });
}
