"""`python -m bench.view.sessions RUN...`: twenty readers use a page; what it said and asked for.

Each opens the page of a run in a browser of its own, with the renderer that all readers get. A line
per session tells messages on the console, errors, and requests that leave the page; there should be
none. The last line is memory before and after 1,000 frames of turning.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from playwright.sync_api import Browser
from playwright.sync_api import Error as PlaywrightError

from bench.view import uses
from bench.view.compare import chromium
from bench.view.reader import Reader, reader_at
from toonset.html_page import json_text
from toonset.nerf.viewer.build import view_html

WARMING, FRAMES = 100, 1000
# Compositing as where there is a graphics card; without it the browser itself reads every WebGL
# canvas back, and warns on the console of what it does, whatever the page.
AS_WITH_CARD = ("--use-angle=swiftshader", "--ignore-gpu-blocklist", "--enable-gpu-rasterization")
PHONE: dict[str, Any] = {"viewport": {"width": 360, "height": 740}, "has_touch": True}
SCENE = re.compile(r'(?<=<script id="scene" type="application/json">).*?(?=</script>)')
NO_3D = """const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind === "webgl2" ? null : get.call(this, kind, ...more);
};"""
COUNT = """globalThis.living = {};
for (const kind of ["Texture", "Buffer", "Framebuffer", "Program", "VertexArray"]) {
  living[kind] = 0;
  for (const [act, one] of [["create", 1], ["delete", -1]]) {
    const name = act + kind, old = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...more) {
      living[kind] += one;
      return old.apply(this, more);
    };
  }
}"""
TURN = """frames => new Promise(done => {
  const turn = () => {
    toonset.store.set({ yaw: (toonset.store.state.yaw + 3) % 360 });
    frames-- > 0 ? requestAnimationFrame(turn) : done();
  };
  requestAnimationFrame(turn);
})"""
Session = tuple[Callable[[Reader], None], dict[str, Any]]
SESSIONS: tuple[Session, ...] = (
    (uses.drags, {}),
    (uses.drags, {"reduced_motion": "reduce", "color_scheme": "dark"}),
    (uses.touches, PHONE),
    (uses.pinches, PHONE),
    (uses.wheels, {"device_scale_factor": 3}),
    (uses.types, {}),
    (uses.sees_layers, {}),
    (uses.compares, {}),
    (uses.sees_cameras, {"color_scheme": "dark"}),
    (uses.recolours, {}),
    (uses.drops_palettes, {}),
    (uses.drops_rubbish, {}),
    (uses.saves, {}),
    (uses.saves_a_turn, {}),
    (uses.copies_links, {}),
    (uses.follows_links, {}),
    (uses.resizes, {}),
    (uses.reads_from_right_to_left, {**PHONE, "locale": "he-IL"}),
    (uses.loses_its_context, {}),
    (uses.does_all_it_can, {"before": NO_3D}),
)


def main(runs: Annotated[list[Path], typer.Argument(help="Run folders.")]) -> None:
    """Print what each session of each run's page heard."""
    with chromium(*AS_WITH_CARD) as browser, tempfile.TemporaryDirectory() as place:
        for run in runs:
            file, hostile = Path(place) / "page.html", Path(place) / "hostile.html"
            file.write_text(view_html(run), encoding="utf-8")
            hostile.write_text(SCENE.sub(_with_hostile_names, file.read_text("utf-8")), "utf-8")
            print(f"{run}: {file.stat().st_size / 1e6:.2f} MB")
            total = sum(_hold(browser, file, *session) for session in SESSIONS)
            total += _hold(browser, hostile, uses.reads_hostile_names, PHONE)
            print(f"  {len(SESSIONS) + 1} sessions: {total} messages, errors or requests")
            _weigh(browser, file)


def _hold(
    browser: Browser, file: Path, use: Callable[[Reader], None], options: dict[str, Any]
) -> int:
    with reader_at(browser, file, **options) as reader:
        try:
            use(reader)
        except (AssertionError, PlaywrightError) as error:
            reader.noise.append(f"stopped: {error}")
        reader.wait()
    told = {name: value for name, value in options.items() if name != "before"}
    print(f"  {use.__name__.replace('_', ' ')} {told or ''}: {reader.noise or 'quiet'}")
    return len(reader.noise)


def _with_hostile_names(found: re.Match[str]) -> str:
    scene = json.loads(found[0])
    scene["title"] = "".join(uses.HOSTILE)
    scene["verdict"] = {"state": uses.HOSTILE[0], "reasons": list(uses.HOSTILE)}
    for entries in (scene["palette"], scene["views"]):
        for i, entry in enumerate(entries):
            entry["name"] = entry["reason"] = uses.HOSTILE[i % len(uses.HOSTILE)]
    return json_text(scene)


def _weigh(browser: Browser, file: Path) -> None:
    with reader_at(browser, file, before=COUNT) as reader:
        found = []
        for frames in (WARMING, FRAMES):
            reader.page.evaluate(TURN, frames)
            reader.wait()
            found.append((reader.metric("JSHeapUsedSize") / 1e6, reader.page.evaluate("living")))
    for (heap, living), (later, still) in pairwise(found):
        print(f"  {FRAMES} frames: {heap:.2f} to {later:.2f} MB of JavaScript, {living} to {still}")


if __name__ == "__main__":
    typer.run(main)
