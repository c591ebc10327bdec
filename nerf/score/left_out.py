"""Measure how well drawings predict each other: each is left out, and drawn from the others.

A drawing's own camera is a new view to the others. What they make of it is compared with the
drawing as it was drawn, D, both at one size and a little blurred, in CIELAB:

    off = sum |view - D| / sum |D moved by a pixel - D|                 pixels, over the height

so that a drawing error of a hundredth of the height is off by about that, whatever is drawn. The
drawings beside it are twice as far apart as beside any other view: of few drawings it says too
much. Cameras that are wrong count, and poses, colours and sides that only one drawing has.
Where the mannequin gives the shape, D is the drawing as it was bent to show it: how it was drawn
does not reach new views then.

Source: Geisser 1975, "The predictive sample reuse method" (leave one out).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import has_figure
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.look.asked import flanking
from toonset.nerf.look.blend import blend_view
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import SOLID, Geometry
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.views import render
from toonset.palette.color_names import name_of
from toonset.view import over_white

TALL_PX = 120.0  # of the figure where pictures are compared
SOFT_PX = 1.0  # sigma: what is finer nobody misses
FEWEST = 3  # drawings: of two, one predicts nothing
PLAIN = 20.0  # of CIELAB: a difference that anybody sees
HALF = 127  # of alpha
ROWS, COLUMNS = ("upper", "middle", "lower"), ("left", "middle", "right")

Picture = Float[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class LeftOut:
    """A drawing, and what the others make of its side.

    Attributes:
        name: of the drawing.
        beside: the drawings that its side was made of.
        off: how far both are apart, in shares of the figure's height.
        differs: share of the figure's pixels whose colours plainly differ.
        place: of most of it, as one sees it in the picture, e.g. "upper left".
        paint: that the drawing has there, e.g. "dark red"; "" where it has none.
    """

    name: str
    beside: tuple[str, ...]
    off: float
    differs: float
    place: str
    paint: str


def left_out(baked: Baked, seen: Scene, drawn: Scene) -> list[LeftOut]:
    """Return every drawing as the others predict it; empty for fewer than FEWEST drawings.

    Where drawings have no outline, the drawing counts as far off as the field's own colours, if
    that is farther: nothing but paint tells how far the field has come.

    Args:
        baked: a field with its drawings.
        seen: the drawings as they were trained on, mirrored ones behind them.
        drawn: those that somebody drew, as they were drawn.
    """
    drawings = baked.trained.drawings
    if drawings is None:
        return []
    ready = [frame for frame in seen.frames if not frame.mirrored]
    compared = ready if drawings.shape is not None else drawn.frames
    frames = [own for frame, own in zip(ready, compared, strict=True) if has_figure(frame)]
    names = [frame.name for frame in seen.frames if has_figure(frame)]
    if len(frames) < FEWEST:
        return []
    drawings = drawings.fitting(TALL_PX / drawings.height)
    assert drawings.textures  # made here: two threads must not make them twice
    field = drawings.outline is None

    def one(number: int) -> LeftOut:
        camera = small_camera(drawings, number)
        view = render(baked, camera)
        colors = _over_white(view.rgb, view.alpha) if field else None
        return predicted(drawings, number, view.geometry, frames[number], names, colors)

    return side_by_side([partial(one, i) for i in range(len(frames))])


def small_camera(drawings: Drawings, number: int) -> Camera:
    """Return a drawing's camera, at the size at which pictures are compared."""
    own = drawings.views[number].camera
    return own.resized(TALL_PX / (drawings.height * own.scale))


def predicted(
    drawings: Drawings,
    number: int,
    view: Geometry,
    frame: Frame,
    names: Sequence[str],
    colors: Picture | None = None,
) -> LeftOut:
    """Return a drawing as the others predict it.

    Args:
        drawings: of about the size of the view.
        number: of the drawing.
        view: of the field, by `small_camera`.
        frame: what it is compared with.
        names: of all drawings, in their order.
        colors: the field's own, over white, which count, too; None: they do not.
    """
    others = drawings.without(number)
    beside = [name for i, name in enumerate(names) if i != number]
    first, second, _ = flanking([one.camera for one in others.views], view.camera)
    found = blend_view(others, view)
    size = view.camera.size_wh
    drawn = cv2.resize(over_white(frame.rgba), size, interpolation=cv2.INTER_AREA)
    apart = difference(_over_white(found.rgb, found.alpha), drawn)
    if colors is not None:
        own = difference(colors, drawn)
        apart = max(apart, own, key=lambda error: float(error.sum()))
    figure = cv2.resize(frame.rgba[..., 3], size, interpolation=cv2.INTER_AREA) > HALF
    figure |= found.alpha > SOLID
    place, at = _worst_ninth(apart, figure)
    labels = cv2.resize(drawings.textures[number].labels, size, interpolation=cv2.INTER_NEAREST)
    return LeftOut(
        frame.name,
        tuple(dict.fromkeys((beside[first], beside[second]))),
        float(apart.sum()) / max(by_pixel(drawn), 1e-9) / TALL_PX,
        float((apart > PLAIN)[figure].mean()),
        place,
        _paint(labels[at], apart[at], drawings),
    )


def difference(first: Picture, second: Picture) -> Float[np.ndarray, "height width"]:
    """Return the distance of colours in CIELAB, both pictures a little blurred."""
    soft = [cv2.GaussianBlur(_lab(picture), (0, 0), SOFT_PX) for picture in (first, second)]
    return np.linalg.norm(soft[0] - soft[1], axis=-1)


def by_pixel(drawn: Picture) -> float:
    """Return the summed difference of a drawing moved by a pixel, mean over both axes."""
    moved = [np.roll(np.pad(drawn, ((1, 1), (1, 1), (0, 0)), mode="edge"), 1, k) for k in (0, 1)]
    return float(sum(difference(each[1:-1, 1:-1], drawn).sum() for each in moved) / 2)


def _lab(picture: Picture) -> Picture:
    lab = cv2.cvtColor(picture.clip(0, 1).astype(np.float32), cv2.COLOR_RGB2LAB)
    return np.asarray(lab)


def _over_white(rgb: Picture, alpha: Float[np.ndarray, "height width"]) -> Picture:
    return rgb + 1 - alpha[..., None]


def _worst_ninth(
    apart: Float[np.ndarray, "height width"], figure: Bool[np.ndarray, "height width"]
) -> tuple[str, tuple[slice, slice]]:
    """Return the ninth of the figure's box that has most of a difference: in words, and it."""
    edges = []
    for axis in (1, 0):
        there = np.flatnonzero(figure.any(axis=axis))
        edges.append(np.linspace(there[0], there[-1] + 1, 4).astype(int))
    ninths = {
        (row, column): (slice(*edges[0][row : row + 2]), slice(*edges[1][column : column + 2]))
        for row in range(3)
        for column in range(3)
    }
    row, column = max(ninths, key=lambda ninth: float(apart[ninths[ninth]].sum()))
    return " ".join(dict.fromkeys((ROWS[row], COLUMNS[column]))), ninths[row, column]


def _paint(
    labels: UInt8[np.ndarray, "h w"], apart: Float[np.ndarray, "h w"], drawings: Drawings
) -> str:
    """Return the name of the palette colour in which most of a difference is."""
    weight = np.bincount(labels.ravel(), apart.ravel(), 256)[: len(drawings.palette)]
    if not weight.any():
        return ""
    red, green, blue = drawings.palette[int(weight.argmax())].tolist()
    return name_of((red, green, blue))
