"""A page in a real browser, and its pictures beside those of `render`."""

from __future__ import annotations

import shutil
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from jaxtyping import UInt8
from playwright.sync_api import Browser, Page, sync_playwright

from toonset.errors import SetupError
from toonset.nerf.score.metrics import psnr_of
from toonset.view import over_white

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
NO_BROWSER = "no browser to test the page in: apt-get install chromium"
READ = """async shot => {
  const canvas = await toonset.read(shot);
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let text = "";
  for (let i = 0; i < data.length; i += 1024)
    text += String.fromCharCode(...data.subarray(i, i + 1024));
  return [btoa(text), canvas.width, canvas.height];
}"""

Picture = UInt8[np.ndarray, "height width 4"]


@contextmanager
def chromium() -> Iterator[Browser]:
    """Yield a browser without a window.

    Raises:
        SetupError: there is none.
    """
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SetupError(NO_BROWSER)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


def shown(page: Page, sight: int, layer: str = "drawn", **more: Any) -> Picture:
    """Return a view as the page shows it, in its own pixels; `more` are entries of its shot."""
    data, width, height = page.evaluate(READ, {"sight": sight, "layer": layer, **more})
    return np.frombuffer(b64decode(data), np.uint8).reshape(height, width, 4)


def psnr(one: Picture, other: Picture) -> float:
    """Return the peak signal-to-noise ratio of two pictures over white, dB."""
    return psnr_of(float(np.mean((over_white(one) - over_white(other)) ** 2)))
