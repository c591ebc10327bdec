"""Convert a rendered view to 8-bit layers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from toonset.camera import Camera
from toonset.dataset.images.picture import encode_grey_png, encode_indexed_png, encode_png
from toonset.errors import BundleError, OutputError, PaletteError, ToonsetError
from toonset.nerf.fields.trained_field import NO_DRAWINGS, NO_LINES, NO_PALETTE, TrainedField
from toonset.nerf.look.blend import blend_view
from toonset.nerf.look.drawn_view import SOLID, DrawnView, Geometry
from toonset.nerf.options import LAYERS
from toonset.nerf.render.depth import DepthLevels, normal_picture
from toonset.palette.pixels.labels import UNLABELLED
from toonset.view import small_png
from toonset.write import write_bytes

SOURCE_COLORS = np.array([[190, 190, 190], [60, 110, 220], [220, 60, 50]], dtype=np.uint8)
Picture = UInt8[np.ndarray, "height width 4"]
Layer = UInt8[np.ndarray, "height width *channels"]


@dataclass(frozen=True, eq=False)
class FieldView:
    """What a camera sees of a field.

    Attributes:
        rgb: (height, width, 3) premultiplied colour in [0, 1].
        alpha: (height, width) opacity in [0, 1].
        depth: (height, width) mean distance past the plane through the camera's target, world
            units; nan where nothing is seen.
        labels: (height, width) most frequent palette label, 255 where nothing is seen; None
            without palette.
        shares: (height, width, colors) share of a pixel that each palette colour covers
            (premultiplied by alpha); None without palette.
    """

    rgb: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    labels: UInt8[np.ndarray, "height width"] | None
    shares: Float[np.ndarray, "height width colors"] | None


@dataclass(frozen=True, eq=False)
class Rendering:
    """One rendered view: the field's own, and the drawn look.

    Each is made when it is first asked for: where the mannequin is the surface, the drawn look
    needs nothing of the field. rgb, alpha, depth, labels and shares are those of `FieldView`.

    Attributes:
        camera: it is seen from.
        field: that was rendered.
        cast: returns what the camera sees of it.
        surface: returns its opacity and depth alone, with fewer rays.
    """

    camera: Camera
    field: TrainedField
    cast: Callable[[], FieldView]
    surface: Callable[[], Geometry]

    @cached_property
    def seen(self) -> FieldView:
        """Return what the camera sees of the field."""
        return self.cast()

    @property
    def rgb(self) -> Float[np.ndarray, "height width 3"]:
        """Return premultiplied colour in [0, 1]: see `FieldView`."""
        return self.seen.rgb

    @property
    def alpha(self) -> Float[np.ndarray, "height width"]:
        """Return opacity in [0, 1]: see `FieldView`."""
        return self.seen.alpha

    @property
    def depth(self) -> Float[np.ndarray, "height width"]:
        """Return depth, nan where nothing is seen: see `FieldView`."""
        return self.seen.depth

    @property
    def labels(self) -> UInt8[np.ndarray, "height width"] | None:
        """Return the most frequent palette labels: see `FieldView`."""
        return self.seen.labels

    @property
    def shares(self) -> Float[np.ndarray, "height width colors"] | None:
        """Return the share of a pixel that each palette colour covers: see `FieldView`."""
        return self.seen.shares

    @cached_property
    def geometry(self) -> Geometry:
        """Return what the drawn look needs of the field: nothing where the body is known."""
        drawings = self.field.drawings
        known = drawings is not None and drawings.shape is not None
        return Geometry.of(self.camera) if known else self.surface()

    @cached_property
    def drawn(self) -> DrawnView:
        """Return the view put together from the drawings.

        Raises:
            BundleError: the run holds none.
        """
        if self.field.drawings is None:
            raise BundleError(NO_DRAWINGS)
        return blend_view(self.field.drawings, self.geometry)

    def picture(self, layer: str | None = None) -> Layer:
        """Return one layer as RGBA with straight alpha, or as a label map.

        Args:
            layer: one of `LAYERS`; "depth" is grey, the nearest point white; None: what people
                look at (`default_layer`).

        Raises:
            ToonsetError: there is no such layer, or the run has no palette or lines for it.
        """
        layer = default_layer(self.field) if layer is None else layer
        if layer not in LAYERS:
            raise ToonsetError(f"layer {layer!r} is none of {', '.join(LAYERS)}; choose one")
        made: dict[str, Callable[[], Layer]] = {
            "drawn": lambda: color_picture(self.drawn.rgb, self.drawn.alpha),
            "rgb": lambda: color_picture(self.rgb, self.alpha),
            "palette": lambda: palette_picture(self, self.field.palette),
            "labels": lambda: label_picture(self),
            "depth": lambda: depth_picture(self),
            "alpha": lambda: alpha_picture(self),
            "ink": lambda: ink_picture(self),
            "source": lambda: source_picture(self),
            "normal": lambda: normal_picture(self.depth, self.alpha, self.camera),
            "normal-camera": lambda: normal_picture(
                self.depth, self.alpha, self.camera, in_camera=True
            ),
        }
        return made[layer]()

    def png(
        self, layer: str | None = None, *, levels: DepthLevels | None = None
    ) -> tuple[bytes, Picture]:
        """Return a layer as a PNG file, and as RGBA for a GIF.

        Args:
            layer: see `picture`. Labels are an indexed PNG, depth is grey of 16 bits.
            levels: scale of depth; None: that of this view alone.

        Raises:
            ToonsetError: see `picture`.
        """
        picture = self.picture(layer)
        if layer == "depth":
            levels = levels or DepthLevels.of(self.field.hull, [self.camera])
            return encode_grey_png(levels.picture(self.depth)), picture
        if layer != "labels":
            return encode_png(picture), picture
        assert self.field.palette is not None  # label_picture has refused a run without palette
        return encode_indexed_png(picture, self.field.palette), _in_colors(
            picture, self.field.palette
        )

    def _repr_png_(self) -> bytes:
        """Return what people look at, for a notebook."""
        return small_png(self.picture())

    def save(self, path: str | Path, layer: str | None = None) -> None:
        """Write a layer as a PNG file; the file appears whole or not at all.

        Raises:
            ToonsetError: see `picture`; or the file is no .png, or cannot be written.
        """
        if Path(path).suffix.lower() != ".png":
            raise OutputError(f"{path}: a rendering is a PNG; give a name that ends in .png")
        write_bytes(Path(path), self.png(layer)[0])


def default_layer(trained: TrainedField) -> str:
    """Return the layer that people look at: "drawn" where the run holds drawings."""
    return "rgb" if trained.drawings is None else "drawn"


def color_picture(
    premultiplied: Float[np.ndarray, "height width 3"], alpha: Float[np.ndarray, "height width"]
) -> UInt8[np.ndarray, "height width 4"]:
    """Return premultiplied colour as 8-bit RGBA with straight alpha."""
    picture = np.zeros((*alpha.shape, 4), np.uint8)
    visible = alpha > 0
    cover = alpha[visible][:, None]
    picture[visible] = _bytes(np.concatenate([premultiplied[visible] / cover, cover], axis=-1))
    return picture


def palette_picture(
    rendering: Rendering, palette: UInt8[np.ndarray, "colors 3"] | None
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the view in palette colours only; pixels on borders mix the colours they cover.

    Raises:
        PaletteError: the run was trained without palette.
    """
    if rendering.shares is None or palette is None:
        raise PaletteError(NO_PALETTE)
    return color_picture(rendering.shares @ (palette / 255.0), rendering.alpha)


def depth_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return depth as grey, the nearest point white and the farthest black, with alpha."""
    depth, seen = rendering.depth, np.isfinite(rendering.depth)
    near = float(depth[seen].min()) if seen.any() else 0.0
    extent = float(depth[seen].max()) - near if seen.any() else 0.0
    grey = 1 - (np.where(seen, depth, near) - near) / (extent or 1.0)
    return _bytes(np.dstack([grey, grey, grey, np.where(seen, rendering.alpha, 0)]))


def alpha_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return opacity as opaque grey."""
    alpha = rendering.alpha
    return _bytes(np.dstack([alpha, alpha, alpha, np.ones_like(alpha)]))


def source_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return where paint comes from: grey of a drawing, blue of a mirror image, red: guessed.

    Raises:
        BundleError: the run holds no drawings.
    """
    drawn = rendering.drawn
    solid = (drawn.alpha >= SOLID)[..., None] * np.uint8(255)
    return np.concatenate([SOURCE_COLORS[drawn.source], solid], axis=-1)


def ink_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return the lines of the drawn look alone, in their colour.

    Raises:
        BundleError: the drawings have none.
    """
    drawings = rendering.field.drawings
    if drawings is None or drawings.pen is None:
        raise BundleError(NO_LINES)
    lines = rendering.drawn.ink
    return color_picture(lines[..., None] * (np.array(drawings.pen.rgb) / 255.0), lines)


def label_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width"]:
    """Return the label map, 255 where nothing is seen.

    Raises:
        PaletteError: the run was trained without palette.
    """
    if rendering.labels is None:
        raise PaletteError(NO_PALETTE)
    return rendering.labels


def _bytes(values: Float[np.ndarray, "*n 4"]) -> UInt8[np.ndarray, "*n 4"]:
    return (values.clip(0, 1) * 255 + 0.5).astype(np.uint8)


def _in_colors(
    labels: UInt8[np.ndarray, "height width"], palette: UInt8[np.ndarray, "colors 3"]
) -> Picture:
    colors = np.concatenate([palette, np.zeros((256 - len(palette), 3), np.uint8)])[labels]
    return np.dstack([colors, np.where(labels == UNLABELLED, 0, 255).astype(np.uint8)])
