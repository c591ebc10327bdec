"""A reader at an open page: what a hand does, and what the page did that it should not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, CDPSession, Page, Request

from toonset.html_page import base64_text

STARTED = "#poster[hidden], #fallback:not([hidden])"
REST = 600  # milliseconds until a picture at rest is drawn, on a slow machine, too
DROP = """([name, base64]) => {
  const bytes = Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([bytes], name));
  for (const kind of ["dragover", "drop"])
    document.body.dispatchEvent(new DragEvent(kind, { dataTransfer, bubbles: true }));
}"""


@dataclass
class Reader:
    """A reader at a page, and what the page did that it should not."""

    page: Page
    protocol: CDPSession
    noise: list[str] = field(default_factory=list)

    def wait(self, milliseconds: float = REST) -> None:
        """Wait."""
        self.page.wait_for_timeout(milliseconds)

    def click(self, name: str) -> None:
        """Click a button."""
        self.page.get_by_role("button", name=name, exact=True).click()

    def keys(self, *keys: str) -> None:
        """Press keys on the figure."""
        self.page.locator("#view").focus()
        for key in keys:
            self.page.keyboard.press(key)

    def middle(self) -> tuple[float, float]:
        """Return the figure's middle."""
        box = self.page.locator("#view").bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(self, x: float, y: float) -> None:
        """Drag the figure quickly, so that it swings on."""
        left, top = self.middle()
        self.page.mouse.move(left, top)
        self.page.mouse.down()
        self.page.mouse.move(left + x, top + y, steps=8)
        self.page.mouse.up()

    def drop(self, name: str, data: bytes) -> None:
        """Drop a file on the page."""
        self.page.evaluate(DROP, [name, base64_text(data)])
        self.page.wait_for_selector("#message:not(:empty)")

    def save(self, name: str) -> None:
        """Click a button that saves a file, and wait for the file."""
        with self.page.expect_download() as download:
            self.click(name)
        assert download.value.path().stat().st_size > 1000

    def touch(self, kind: str, *places: tuple[float, float]) -> None:
        """Put fingers down at these places, from the figure's middle, move or lift them."""
        left, top = self.middle()
        points = [{"x": left + x, "y": top + y, "id": i} for i, (x, y) in enumerate(places)]
        event = {"type": kind, "touchPoints": points}
        self.protocol.send("Input.dispatchTouchEvent", event)

    def metric(self, name: str) -> float:
        """Return one of the browser's own figures, after all garbage is gone."""
        self.protocol.send("HeapProfiler.collectGarbage")
        self.protocol.send("Performance.enable")
        found = self.protocol.send("Performance.getMetrics")["metrics"]
        return next(one["value"] for one in found if one["name"] == name)


@contextmanager
def reader_at(
    browser: Browser, file: Path, hash: str = "", before: str = "", **options: Any
) -> Iterator[Reader]:
    """Open a page in a browser of its own; `before` is a script that runs first."""
    context = browser.new_context(**{"viewport": {"width": 480, "height": 640}, **options})
    page = context.new_page()
    reader = Reader(page, context.new_cdp_session(page))
    page.set_default_timeout(300_000)  # a turntable takes long without a graphics card
    page.on("console", lambda message: reader.noise.append(f"console: {message.text}"))
    page.on("pageerror", lambda error: reader.noise.append(f"error: {error}"))

    def note(request: Request) -> None:
        if not request.url.startswith(("data:", "blob:", file.as_uri())):
            reader.noise.append(f"request: {request.url}")

    page.on("request", note)
    page.add_init_script(before)
    page.goto(file.as_uri() + hash)
    page.wait_for_selector(STARTED, state="attached")
    try:
        yield reader
    finally:
        context.close()
