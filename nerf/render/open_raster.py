"""Write a view as an OpenRaster file for paint programs: lines, then a layer per paint.

A layer takes its share s of colour k off what a pixel shows, c with alpha A (c premultiplied):

    c = s k + (1 - s) c',   A = s + (1 - s) A',   with 0 <= c' <= A'

and the layers below share c' and A'. So all layers together show what the view shows. Paint goes on
under the lines. Where two paints meet, the soft edge is the upper one's alpha. The rarest paint,
the last of the palette, lies on top.

    mimetype, stack.xml, data/VIEW-LAYER.png, mergedimage.png, Thumbnails/thumbnail.png

Source: openraster.org, "File Layout Specification" and "Layer Stack Specification".
"""

from __future__ import annotations

import io
import itertools
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.images.picture import encode_png
from toonset.errors import PaletteError, UsageError
from toonset.nerf.fields.trained_field import NO_PALETTE
from toonset.nerf.render.animation import check_one_size
from toonset.nerf.render.layers import Rendering
from toonset.palette.color_names import distinct_names, with_codes
from toonset.raster import dilate, is_uniform, nearest
from toonset.view import premultiply, straight

PAINTED = ("drawn", "rgb", "palette")  # what can be seen in layers
LINES, INK = "lines", "ink"  # layers' names; ink: painted lines of no palette colour
MIMETYPE, VERSION = b"image/openraster", "0.0.3"
THUMBNAIL_PX = 256
STORED_TIME = (1980, 1, 1, 0, 0, 0)  # the same pictures, the same bytes
NEAR_PX = 2  # from where lines are drawn to where a drawing's own line may lie
CLEAR = 0.15  # of colours: lines of a colour nearer to the paint cannot be told from it
FAINT = 0.02  # of a pixel: less of a line is noise
UNSEEN = 3 / 255  # of what is shown: so much a pixel under others may be off, to be its paint's
PURE = 0.5  # of a pixel, that shows its paint's colour
BLEND = 0.08  # of colours, that a soft edge may be off a mixture of the paints beside it
PLAIN = 0.1  # of colours: a thin line, an eye, is its paint's
AROUND_PX, FEWEST, MOST = 5, 3, 3  # pixels in which paints are looked for, of one, how many of them

Picture = UInt8[np.ndarray, "height width 4"]
Color = Float[np.ndarray, "height width 3"]
Share = Float[np.ndarray, "height width"]
Labels = Int[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class PaintLayer:
    """One layer of a view.

    Attributes:
        name: for people.
        place: its left and top edge in the view, pixels.
        rgba: with straight alpha, cut to what it shows.
    """

    name: str
    place: tuple[int, int]
    rgba: Picture


@dataclass(frozen=True, eq=False)
class _Rest:
    """Colour and alpha that the layers above leave.

    Attributes:
        color: premultiplied.
        alpha: its coverage.
        weight: how much of the layers below is seen.
    """

    color: Color
    alpha: Share
    weight: Share

    def under(self, share: Share, over: Color) -> tuple[Share, _Rest]:
        """Return how much of a colour can be taken off, in steps of 1 / 255, and what is left."""
        with np.errstate(divide="ignore", invalid="ignore"):
            dark = np.where(over > 0, self.color / over, np.inf)
            light = np.where(over < 1, (self.alpha[..., None] - self.color) / (1 - over), np.inf)
        most = np.minimum(np.minimum(dark, light).min(axis=-1), self.alpha)
        share = np.floor(255 * np.clip(np.minimum(share, most), 0, 1) + 1e-6) / 255
        free = np.where(share < 1, 1 - share, 1)
        color = (self.color - share[..., None] * over) / free[..., None]
        alpha = np.where(share < 1, (self.alpha - share) / free, 1)
        weight = self.weight * (1 - share)
        return share, _Rest(color.clip(0, alpha[..., None]), alpha, weight)


@dataclass(frozen=True, eq=False)
class _Look:
    """Colour, labels and lines of a view.

    Attributes:
        shown: its picture.
        ink: share of every pixel that lines cover; 0 but in the drawn look.
        ink_rgb: their colour in [0, 1].
        paint: colour under the lines; None: there are none.
        labels: number of every pixel's paint.
        paints: colours of the paints, sRGB.
        inks: how many of them, the last, are no palette colours.
    """

    shown: _Rest
    ink: Share
    ink_rgb: Float[np.ndarray, " 3"]
    paint: Color | None
    labels: Labels
    paints: UInt8[np.ndarray, "paints 3"]
    inks: int = 0


def check_layered(layer: str) -> None:
    """Refuse, before any work, what has no layers of paint.

    Raises:
        UsageError: see above.
    """
    if layer not in PAINTED:
        raise UsageError(
            f"layer {layer!r}: has no paints for turntable.ora; let the first layer be one of "
            f"{', '.join(PAINTED)}"
        )


def layered(view: Rendering, layer: str, picture: Picture) -> list[PaintLayer]:
    """Return a view in layers, the uppermost first.

    Args:
        view: the view.
        layer: that is shown: one of PAINTED.
        picture: of this layer.

    Raises:
        PaletteError: the run was trained without palette.
    """
    look = _look(view, layer, picture)
    ink = np.broadcast_to(look.ink_rgb, look.shown.color.shape)
    lines, rest = look.shown.under(_lines(look), ink)
    pure = _pure(look, rest, lines)
    colors = _colors(look, rest, pure)
    upper, edge, lower, rest = _edges(look, rest, pure, colors)
    flat = _straight(rest, colors, lower)
    found = [_cut(LINES, ink, lines)]
    for number, name in reversed(list(enumerate(paint_names(look.paints, look.inks)))):
        share = np.where(upper == number, edge, np.where(lower == number, rest.alpha, 0))
        color = np.where((upper == number)[..., None], colors[number], flat)
        found.append(_cut(name, color, share))
    return [one for one in found if one is not None]


def paint_names(paints: UInt8[np.ndarray, "paints 3"], inks: int) -> tuple[str, ...]:
    """Return what to call the paints, each otherwise; of several inks each has its code, too.

    Args:
        paints: their colours.
        inks: how many of them, the last, are no palette colours.
    """
    codes = [(r, g, b) for r, g, b in paints.tolist()]
    plain = len(codes) - inks
    return with_codes([*distinct_names(codes[:plain]), *[INK] * inks], codes)


def _look(view: Rendering, layer: str, picture: Picture) -> _Look:
    """Return the view that is divided into layers."""
    alpha = picture[..., 3] / 255.0
    shown = _Rest(picture[..., :3] / 255.0 * alpha[..., None], alpha, np.ones_like(alpha))
    palette, shares = view.field.palette, view.shares
    if palette is None or shares is None:
        raise PaletteError(NO_PALETTE)
    if layer == "drawn":
        drawings, drawn = view.field.drawings, view.drawn
        assert drawings is not None  # view.drawn has refused a run without drawings
        ink_rgb = np.array(drawings.pen.rgb if drawings.pen else (0, 0, 0)) / 255.0
        labels, inks = drawn.labels.astype(np.int64), len(drawings.paints) - len(drawings.palette)
        return _Look(shown, drawn.ink, ink_rgb, drawn.paint, labels, drawings.new_paints, inks)
    return _Look(shown, np.zeros_like(alpha), np.zeros(3), None, shares.argmax(axis=-1), palette)


def _lines(look: _Look) -> Share:
    """Return how far lines cover every pixel.

    Where a view is one of the drawings it shows that one's own line, beside which `ink` may lie:
    how much of it there is follows from the colour that lies under it.
    """
    if look.paint is None:
        return look.ink
    way = look.ink_rgb - look.paint
    length = np.square(way).sum(axis=-1)
    off = look.shown.color - look.shown.alpha[..., None] * look.paint
    share = (off * way).sum(axis=-1) / np.maximum(length, 1e-9)
    share = np.where(length > CLEAR**2, share, look.ink)
    faint = FAINT - 0.5 / 255  # bytes are rounded
    return np.where(dilate(look.ink > 0, NEAR_PX) & (share > faint), share, 0)


def _pure(look: _Look, rest: _Rest, lines: Share) -> list[Bool[np.ndarray, "height width"]]:
    """Return where every paint is seen alone: amid its own, or thin and in its own colour."""
    color = rest.color / np.maximum(rest.alpha, 1e-6)[..., None]
    off = np.linalg.norm(color - look.paints[look.labels] / 255.0, axis=-1)
    pure = (is_uniform(look.labels) | (off < PLAIN)) & (rest.alpha > 1 - FAINT) & (lines < PURE)
    return [pure & (look.labels == number) for number in range(len(look.paints))]


def _colors(
    look: _Look, rest: _Rest, pure: Sequence[Bool[np.ndarray, "height width"]]
) -> Float[np.ndarray, "paints height width 3"]:
    """Return every paint's colour at every pixel: that of the nearest that shows it alone."""
    color = rest.color / np.maximum(rest.alpha, 1e-6)[..., None]
    plain = np.broadcast_to(look.paints[:, None, None] / 255.0, (len(pure), *color.shape)).copy()
    for number, at in enumerate(pure):
        if at.any():
            plain[number] = color[nearest(at)]
    return plain


def _edges(
    look: _Look,
    rest: _Rest,
    pure: Sequence[Bool[np.ndarray, "height width"]],
    colors: Float[np.ndarray, "paints height width 3"],
) -> tuple[Labels, Share, Labels, _Rest]:
    """Return the upper paint of soft edges (-1: none), its share, the lower one, and what is left.

    An edge mixes two of the commonest paints around it; the label of a mixture says nothing.
    """
    upper, lower = np.full(look.labels.shape, -1), look.labels.copy()
    share = np.zeros(look.labels.shape)
    at = ~is_uniform(look.labels) & (rest.alpha > 0)
    side = (AROUND_PX, AROUND_PX)
    counts = [cv2.boxFilter(one.astype(np.float32), -1, side, normalize=False)[at] for one in pure]
    seen = np.stack(counts)
    common = np.argsort(-seen, axis=0, kind="stable")[:MOST]
    color = (rest.color / np.maximum(rest.alpha, 1e-6)[..., None])[at]
    every, near = np.arange(len(color)), colors[:, at]
    least = np.full(len(color), BLEND)
    found = np.stack([upper[at], lower[at]]), np.zeros(len(color))
    for i, j in itertools.combinations(range(len(common)), 2):
        pair = np.sort(common[[i, j]], axis=0)
        low, high = near[pair[0], every], near[pair[1], every]
        way = high - low
        part = ((color - low) * way).sum(axis=-1) / np.maximum(np.square(way).sum(axis=-1), 1e-6)
        part = part.clip(0, 1)
        off = np.linalg.norm(color - low - part[:, None] * way, axis=-1)
        better = (off < least) & (seen[common[j], every] >= FEWEST)
        least = np.where(better, off, least)
        found[0][:, better], found[1][better] = pair[::-1, better], part[better]
    upper[at], lower[at] = found[0]
    share[at] = found[1] * rest.alpha[at]
    over = np.take_along_axis(colors, upper.clip(0)[None, ..., None], axis=0)[0]
    share, under = rest.under(share, over)
    return upper, share, lower, under


def _straight(
    rest: _Rest, colors: Float[np.ndarray, "paints height width 3"], labels: Labels
) -> Color:
    """Return straight colour; that of its paint where next to nothing of it is seen."""
    plain = np.take_along_axis(colors, labels[None, ..., None], axis=0)[0]
    color = rest.color / np.maximum(rest.alpha, 1e-6)[..., None]
    off = rest.weight * rest.alpha * np.abs(color - plain).max(axis=-1)
    covered = (rest.weight < 1) & (off <= UNSEEN)
    return np.where(covered[..., None], plain, color)


def _cut(name: str, color: Color, share: Share) -> PaintLayer | None:
    """Return a layer cropped to its visible pixels; None if it is empty."""
    rgba = np.rint(255 * np.dstack([color, share]).clip(0, 1)).astype(np.uint8)
    rgba[rgba[..., 3] == 0] = 0
    if not rgba.any():
        return None
    x, y, width, height = cv2.boundingRect(rgba[..., 3])
    return PaintLayer(name, (x, y), rgba[y : y + height, x : x + width])


def encode_ora(
    named: Sequence[tuple[str, Sequence[PaintLayer]]], pictures: Sequence[Picture]
) -> bytes:
    """Return an OpenRaster file with a group of layers per view; only the first view is shown.

    Args:
        named: views by name, in layers, the uppermost first.
        pictures: of the views.

    Raises:
        OutputError: the pictures differ in size, or there are none.
    """
    check_one_size(pictures, "turntable.ora")
    height, width = pictures[0].shape[:2]
    image = ET.Element("image", version=VERSION, w=str(width), h=str(height))
    stack = ET.SubElement(image, "stack")
    files: dict[str, bytes] = {}
    for number, (name, layers) in enumerate(named):
        shown = "hidden" if number else "visible"
        group = ET.SubElement(stack, "stack", name=name, visibility=shown)
        for place, layer in enumerate(layers):
            source = f"data/{number:04d}-{place:02d}.png"
            files[source] = encode_png(layer.rgba)
            x, y = map(str, layer.place)
            ET.SubElement(group, "layer", name=layer.name, src=source, x=x, y=y)
    files["mergedimage.png"] = encode_png(pictures[0])
    files["Thumbnails/thumbnail.png"] = encode_png(_thumbnail(pictures[0]))
    content = {"mimetype": MIMETYPE, "stack.xml": ET.tostring(image, "UTF-8", xml_declaration=True)}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:  # stored: pictures are compressed already
        for name, data in (content | files).items():
            archive.writestr(zipfile.ZipInfo(name, STORED_TIME), data)
    return buffer.getvalue()


def _thumbnail(picture: Picture) -> Picture:
    """Return a picture as large as thumbnails may be, never larger than it is."""
    height, width = picture.shape[:2]
    by = min(1.0, THUMBNAIL_PX / max(height, width))
    size = (max(1, round(by * width)), max(1, round(by * height)))
    return straight(cv2.resize(premultiply(picture), size, interpolation=cv2.INTER_AREA))
