"""The drawings of a sheet and the surface that they show, ready to be looked up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, Float16, UInt8, UInt16

from toonset.camera import Camera
from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.hull.mannequin_shape import Shape
from toonset.nerf.look.border_lines import lined_pairs
from toonset.nerf.look.crisp_depth import SQUARE, filled
from toonset.nerf.look.drawing import Drawing, depth_of, halved
from toonset.nerf.look.outline import Outline
from toonset.nerf.look.paint_labels import paint_labels, repainted
from toonset.nerf.look.places import places_in, sample_picture
from toonset.nerf.look.shade import Shade
from toonset.nerf.look.silhouette import Rim, rim_of
from toonset.nerf.look.step_lines import StepLines, step_edges
from toonset.nerf.look.texture import Texture
from toonset.nerf.sections.roles import hull_is_square
from toonset.palette.palette import Shadow
from toonset.palette.pixels.labels import nearest_colors
from toonset.palette.pixels.ramp_labels import Ramp, plain_ramp
from toonset.raster import depth_inside, distance_to

STEP = 0.03  # of the figure's height: surfaces so far apart in depth are two
BESIDE_PX = 2  # behind a step of a known shape: hands miss steps by as much
FARTHEST_PX = 50.0  # from an edge: farther is as far
COARSE = 0.6  # times a drawing's size: smaller views take drawings of half the size
INK_LIKE = 60  # sum of channels: a palette colour so near to the ink is the ink's
AROUND = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class PairFlow:
    """Flow between two neighbouring drawings, seen from half way between them.

    Attributes:
        pair: the drawings' numbers.
        camera: half way; one pixel of `flow` is one of its.
        flow: (h, w, 2) F in pixels of the drawings: see `toonset.nerf.look.paint_flow`.
    """

    pair: tuple[int, int]
    camera: Camera
    flow: Float16[np.ndarray, "h w 2"]

    def at(
        self, points: Float[np.ndarray, "rows columns 3"]
    ) -> Float[np.ndarray, "rows columns 2"]:
        """Return F at world points; beyond the picture that of its edge."""
        places, _, _ = places_in(self.camera, points)
        return sample_picture(self.flow.astype(np.float32), places, cv2.INTER_LINEAR)


@dataclass(frozen=True, eq=False)
class Drawings:
    """Drawings and surface of the drawn look.

    Attributes:
        views: the drawings that show a figure.
        flows: of neighbouring drawings.
        outline: the line round the figures; None: there is none.
        pen: draws the line round new views; None: there is none.
        palette: (colors, 3) of the drawings' labels.
        height: of the figure, world units.
        depths: the nearest and the farthest, past the cameras' targets, world units.
        bent: whether the drawings had to be bent to agree: their hull is a little too large then.
        shape: the mannequin's, where it is the character's; None: the surface is the field's.
        steps: lines at steps in depth; None: there are none, or the paint has them.
        shade: a shadow that the paint lacks; None: there is none, or the paint has it.
        shadow: that the drawings have, by their palette; None: there is none.
        ramps: of the palette's colours, where the drawings are shaded throughout.
        repaint: colours to show instead of the palette's, in the same order; None: its own.
    """

    views: tuple[Drawing, ...]
    flows: tuple[PairFlow, ...]
    outline: Outline | None
    pen: Outline | None
    palette: UInt8[np.ndarray, "colors 3"]
    height: float
    depths: tuple[float, float]
    bent: bool
    shape: Shape | None = None
    steps: StepLines | None = None
    shade: Shade | None = None
    shadow: Shadow | None = None
    ramps: tuple[Ramp, ...] = ()
    repaint: UInt8[np.ndarray, "colors 3"] | None = None

    @cached_property
    def paints(self) -> UInt8[np.ndarray, "paints 3"]:
        """Return the palette, and the ink behind it where no palette colour is like it."""
        if self.outline is None:
            return self.palette
        ink = np.array([self.outline.rgb])
        like = np.abs(self.palette.astype(int) - ink).sum(axis=1) < INK_LIKE
        return self.palette if like.any() else np.concatenate([self.palette, ink.astype(np.uint8)])

    @property
    def paint_ramps(self) -> tuple[Ramp, ...]:
        """Return the ramps of `paints`; none of drawings that are not shaded throughout."""
        behind = self.paints[len(self.ramps) :] if self.ramps else ()
        return (*self.ramps, *(plain_ramp(rgb) for rgb in behind))

    @property
    def painted_shadow(self) -> Shadow | None:
        """Return the shadow that the paint still has; None if removed or missing."""
        return self.shadow if self.shade is None else None

    @property
    def drawn_shadow(self) -> Shadow | None:
        """Return the shadow that the drawings have, also where only the surface tells of it."""
        if self.shadow is not None or self.shade is None:
            return self.shadow
        return Shadow(self.shade.factor, (0.0, 0.0, 0.0), 0.0)

    @cached_property
    def new_paints(self) -> UInt8[np.ndarray, "paints 3"]:
        """Return what to show instead of `paints`."""
        if self.repaint is None:
            return self.paints
        return np.concatenate([self.repaint, self.paints[len(self.repaint) :]])

    def ink(self, outline: Outline) -> tuple[int, UInt8[np.ndarray, " 3"]]:
        """Return the label that the ink of a line has in `paints`, and the colour to show."""
        rgb = np.array(outline.rgb, np.uint8)
        label = int(nearest_colors(rgb[None], self.paints)[0])
        new = self.new_paints[label]
        return label, rgb if np.array_equal(new, self.paints[label]) else new

    @cached_property
    def textures(self) -> tuple[Texture, ...]:
        """Return the drawings, ready to be looked up, in the colours to show."""
        paints, new, ramps = self.paints, self.new_paints, self.paint_ramps
        shadow = self.painted_shadow
        plain = [_opaque(view.paint) for view in self.views]
        labels = paint_labels(plain, paints, shadow, ramps)
        plain = repainted(plain, paints, new, shadow, ramps)
        whole, drawn = (
            repainted(pictures, paints, new, self.drawn_shadow, ramps)
            for pictures in ([v.rgba for v in self.views], [v.as_drawn.rgba for v in self.views])
        )
        parts = zip(self.views, whole, drawn, plain, labels, strict=True)
        return tuple(
            _texture(replace(view, rgba=rgba, paint=paint[..., :3]), own, label, view.paint, self)
            for view, rgba, own, paint, label in parts
        )

    def depth(self, view: Drawing) -> Float[np.ndarray, "height width"]:
        """Return the depth of the surface that a drawing shows, nan beside it."""
        if view.levels is not None:
            return depth_of(view.levels, self.depths)
        assert self.shape is not None
        return self.shape.seen(view.camera).depth

    @cached_property
    def lined_pairs(self) -> UInt16[np.ndarray, " pairs"]:
        """Return the pairs of `paints` between which the artist draws a line."""
        if self.outline is None:
            return np.zeros(0, np.uint16)
        drawn = (
            texture.unlined
            for texture, view in zip(self.textures, self.views, strict=True)
            if not view.mirrored
        )
        return lined_pairs(drawn, self.outline.width_px)

    @property
    def steps_hold(self) -> bool:
        """Return whether drawings from enough sides gave the surface to trust its depth steps."""
        return not hull_is_square([view.camera for view in self.views if not view.mirrored])

    @cached_property
    def half(self) -> Drawings:
        """Return the same at half the size: small views would miss every other pixel."""
        flows = (replace(found, flow=found.flow * np.float16(0.5)) for found in self.flows)
        outline, pen = (
            line and replace(line, width_px=line.width_px / 2) for line in (self.outline, self.pen)
        )
        views = tuple(halved(view) for view in self.views)
        steps = self.steps and replace(
            self.steps, near_px=self.steps.near_px / 2, far_px=self.steps.far_px / 2
        )
        changed = replace(self, views=views, flows=tuple(flows), steps=steps)
        return replace(changed, outline=outline, pen=pen)

    def fitting(self, scale: float) -> Drawings:
        """Return the drawings as large as a view needs them, of `scale` pixels per world unit."""
        own = min(view.camera.scale for view in self.views)
        return self if scale > COARSE * own else self.half.fitting(scale)

    def without(self, number: int) -> Drawings:
        """Return the others, without flows: what they make of the one left out predicts it."""
        others = [i for i in range(len(self.views)) if i != number]
        left = replace(self, views=tuple(self.views[i] for i in others), flows=())
        left.__dict__["textures"] = tuple(self.textures[i] for i in others)  # not made again
        return left

    def with_flows(self, flows: tuple[PairFlow, ...]) -> Drawings:
        """Return the same with the flows of its pairs."""
        found = replace(self, flows=flows)
        found.__dict__["textures"] = self.textures  # they do not depend on flows
        return found

    def flow(self, i: int, j: int) -> tuple[PairFlow, float] | None:
        """Return the flow of two drawings and its sign; None where none was measured."""
        for found in self.flows:
            if found.pair in ((i, j), (j, i)):
                return found, 1.0 if found.pair == (i, j) else -1.0
        return None


def _opaque(paint: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "height width 4"]:
    return np.dstack([paint, np.full(paint.shape[:2], 255, np.uint8)])


def _texture(
    view: Drawing,
    drawn: UInt8[np.ndarray, "rows columns 4"],
    labels: UInt8[np.ndarray, "height width"],
    in_own: UInt8[np.ndarray, "height width 3"],
    drawings: Drawings,
) -> Texture:
    depth, height = drawings.depth(view), drawings.height
    inside = depth_inside(mask_of(view.rgba))
    seen, deep = np.isfinite(depth), filled(depth)
    if view.levels is None:
        seen &= deep - cv2.erode(deep, AROUND) <= STEP * height
    far = np.where(seen, cv2.dilate(deep, SQUARE), -np.inf)
    to_step = distance_to(step_edges(depth, STEP * height))
    to_edge = np.minimum(inside, to_step).clip(0, FARTHEST_PX)
    return Texture(
        view.camera,
        _premultiplied(view.rgba),
        view.as_drawn.camera,
        _premultiplied(drawn),
        view.paint / np.float32(255),
        labels,
        far.astype(np.float32),
        to_edge.astype(np.float32),
        _rim(view, depth, drawings),
        distance_to(mask_of(view.rgba) | np.isfinite(depth)).astype(np.float32),
        (drawings.pen.width_px, drawings.pen.rgb) if drawings.pen else None,
        height * view.camera.scale,
        in_own,
    )


def _rim(view: Drawing, depth: Float[np.ndarray, "height width"], drawings: Drawings) -> Rim:
    cover, surface = view.rgba[..., 3] / np.float32(255), np.isfinite(depth)
    unknown = (cover > 0.5) & ~surface if view.mirrored else np.zeros(cover.shape, dtype=bool)
    return rim_of(cover, surface, unknown, drawings.height * view.camera.scale)


def _premultiplied(
    rgba: UInt8[np.ndarray, "height width 4"],
) -> Float[np.ndarray, "height width 4"]:
    whole = rgba / np.float32(255)
    whole[..., :3] *= whole[..., 3:]
    return whole
