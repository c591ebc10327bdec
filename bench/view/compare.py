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

from toonset.camera import Camera
from toonset.errors import SetupError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.depth_levels import LEVELS, DepthLevels
from toonset.nerf.render.views import render
from toonset.nerf.score.metrics import psnr_of
from toonset.nerf.viewer.scene import camera_record
from toonset.palette.pixels.labels import UNLABELLED
from toonset.view import over_white

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
NO_BROWSER = "no browser to test the page in: apt-get install chromium"
READ = """async shot => {
  const { data } = await toonset.read(shot);
  let text = "";
  for (let i = 0; i < data.length; i += 1024)
    text += String.fromCharCode(...data.subarray(i, i + 1024));
  return btoa(text);
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


def shown(page: Page, camera: Camera, layer: str, **more: Any) -> Picture:
    """Return what the page draws; `more` are further entries of its shot."""
    width, height = camera.size_wh
    shot = {"camera": camera_record(camera), "layer": layer, **more}
    data = np.frombuffer(b64decode(page.evaluate(READ, shot)), np.uint8)
    return data.reshape(height, width, 4)


def rendered(trained: TrainedField, camera: Camera, layer: str) -> Picture:
    """Return what `render` draws; labels in the palette's colours, depth as grey of the hull."""
    view = render(trained, camera)
    if layer == "depth":
        scale = DepthLevels.of(trained.hull, [camera])
        near = 1 - (np.nan_to_num(view.depth) - scale.nearest) / (scale.unit * (LEVELS - 1))
        grey = np.rint(255 * near).clip(0, 255)
        return np.dstack([grey, grey, grey, 255 * np.isfinite(view.depth)]).astype(np.uint8)
    picture = view.picture(layer)
    if layer != "labels":
        return picture
    assert trained.palette is not None
    there = picture != UNLABELLED
    return np.dstack([trained.palette[np.where(there, picture, 0)], 255 * there]).astype(np.uint8)


def psnr(one: Picture, other: Picture) -> float:
    """Return the peak signal-to-noise ratio of two pictures over white, dB."""
    return psnr_of(float(np.mean((over_white(one) - over_white(other)) ** 2)))
