"""A sheet's held-out views in all looks, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from lab.bench.look.measure import LookResult
from toonset.nerf.score.evaluation_picture import TEXT_PX, TILE_PX, font_of, tile_of
from toonset.view import over_white

ROWS = 4


def look_sheet(results: Sequence[LookResult]) -> UInt8[np.ndarray, "height width 3"]:
    """Return a case's views that are seen most from the front: the truth, every look beside it."""
    frames = results[0].case.test.frames
    front = sorted(range(len(frames)), key=lambda i: frames[i].camera.rotation[2, 2])[:ROWS]
    rows = []
    for i in sorted(front):
        pictures = [frames[i].rgba, *(one.pictures[i] for one in results)]
        rows.append(np.hstack([tile_of(over_white(picture)) for picture in pictures]))
    sheet = np.vstack(rows)
    head = Image.new("RGB", (sheet.shape[1], TEXT_PX + 8), "white")
    pen = ImageDraw.Draw(head)
    for number, title in enumerate(["truth", *(one.look for one in results)]):
        pen.text((number * TILE_PX + 4, 3), title, "black", font=font_of(TEXT_PX - 3))
    return np.vstack([np.asarray(head), sheet])
