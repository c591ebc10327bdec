"""Project a sheet's drawings as textures into another view, with visibility."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float16, Shaped, UInt8, UInt16

from toonset.camera import Camera
from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.hull.mannequin_shape import Shape
from toonset.nerf.look.borders import Unlined, lined_pairs
from toonset.nerf.look.features import Features, features_of
from toonset.nerf.look.outline import Outline, without_crumbs
from toonset.nerf.look.paint_labels import paint_labels, repainted
from toonset.nerf.look.shade import Shade
from toonset.nerf.look.silhouette import Rim, rim_of
from toonset.nerf.look.step_lines import StepLines, step_edges
from toonset.nerf.sections.roles import hull_is_square
from toonset.palette.palette import Shadow
from toonset.palette.pixels.labels import nearest_colors
from toonset.palette.pixels.ramp_labels import Ramp, plain_ramp
from toonset.raster import depth_inside, distance_to, nearest, sized_parts, taken

STEP = 0.03  # of the figure's height: surfaces so far apart in depth are two
FACES = 2  # times as far behind: hair bulges over faces, which stay whole
BESIDE_PX = 2  # behind a step of a known shape: hands miss steps by as much
FARTHEST_PX = 50.0  # from an edge: farther is as far
COARSE = 0.6  # times a drawing's size: smaller views take drawings of half the size
CRUMB = 3e-4  # of the squared height of the figure: smaller patches that are seen are noise
INK_LIKE = 60  # sum of channels: a palette colour so near to the ink is the ink's
SQUARE = np.ones((3, 3), dtype=np.uint8)
AROUND = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), dtype=np.uint8)

Places = tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]


@dataclass(frozen=True, eq=False)
class Original:
    """A drawing as it is on the sheet.

    Attributes:
        camera: that calibration found.
        rgba: (height, width, 4) sRGB with straight alpha.
    """

    camera: Camera
    rgba: UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """One drawing, agreeing with the others, and the surface that it shows.

    Attributes:
        camera: that saw it.
        rgba: (height, width, 4) sRGB with straight alpha.
        paint: (height, width, 3) of `toonset.nerf.look.flat_paint`.
        levels: (height, width) depth of the field's surface, 1 to 255 over `Drawings.depths`; 0
            where there is none, or a mirrored drawing does not hold; None: the surface is the
            mannequin's.
        mirrored: it is the mirror image of another.
        original: how it was drawn; None: just so.
        limbs: what it shows and the field lacks, for views near it; None: nothing.
    """

    camera: Camera
    rgba: UInt8[np.ndarray, "height width 4"]
    paint: UInt8[np.ndarray, "height width 3"]
    levels: UInt8[np.ndarray, "height width"] | None
    mirrored: bool = False
    original: Original | None = None
    limbs: Shape | None = None

    @property
    def as_drawn(self) -> Original:
        """Return the drawing as it is on the sheet."""
        return self.original or Original(self.camera, self.rgba)


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
        views = tuple(_half(view) for view in self.views)
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


@dataclass(frozen=True, eq=False)
class Texture:
    """One drawing, ready to be looked up from other views.

    Attributes:
        camera: that saw it.
        whole: (height, width, 4) premultiplied, in [0, 1].
        drawn_by: the camera that calibration found.
        drawn: (rows, columns, 4) how it is on the sheet, premultiplied.
        paint: (height, width, 3) straight colour in [0, 1]: see `Drawing`.
        labels: (height, width) of this paint.
        far: (height, width) depth of the surface, the farthest of 3 x 3 pixels; -inf beside it, and
            just behind the steps of a known shape.
        to_edge: (height, width) pixels to the outline or the nearest step in depth.
        rim: what its outline has beyond the surface's.
        beyond: (height, width) pixels to the drawing and its surface.
        pen: width in pixels and colour of its lines; None: there are none.
        figure_px: height of the figure.
        in_own: (height, width, 3) the paint in the artist's colours.
    """

    camera: Camera
    whole: Float[np.ndarray, "height width 4"]
    drawn_by: Camera
    drawn: Float[np.ndarray, "rows columns 4"]
    paint: Float[np.ndarray, "height width 3"]
    labels: UInt8[np.ndarray, "height width"]
    far: Float[np.ndarray, "height width"]
    to_edge: Float[np.ndarray, "height width"]
    rim: Rim
    beyond: Float[np.ndarray, "height width"]
    pen: tuple[float, tuple[int, int, int]] | None
    figure_px: float
    in_own: UInt8[np.ndarray, "height width 3"]

    @cached_property
    def features(self) -> Features:
        """Return what is carried whole."""
        inside = self.whole[..., 3] > 0.5
        drawn = self.in_own / np.float32(255)
        return features_of(self.paint, self.labels, inside, self.pen, self.figure_px, drawn)

    @cached_property
    def unlined(self) -> Unlined:
        """Return its paints without lines and features."""
        found = self.features
        inside = (self.whole[..., 3] > 0.5) & (found.numbers == 0)
        drawn = self.in_own / np.float32(255)
        return Unlined.of(drawn, found.labels, inside, self.pen, self.figure_px)

    @cached_property
    def afloat(self) -> Bool[np.ndarray, "height width"]:
        """Return the pixels that it shows apart from its largest part."""
        part, areas = sized_parts(self.whole[..., 3] > 0.5)
        return (part > 0) & (part != areas[1:].argmax() + 1)

    @cached_property
    def anchors(self) -> Float[np.ndarray, "features 3"]:
        """Return the world points of the surface at which the features' middles lie."""
        found = self.features.found
        middles = np.array([feature.middle for feature in found]).reshape(-1, 2)
        surface = filled(np.where(np.isfinite(self.far), self.far, np.nan))
        depths = [np.median(surface[one.rows, one.columns][one.matte > 0.5]) for one in found]
        return self.camera.unproject(middles + 0.5, np.array(depths))


@dataclass(frozen=True, eq=False)
class Seen:
    """Projection of surface points into one drawing.

    Attributes:
        x, y: (h, w) column and row, the first pixel's centre at 0.
        mask: (h, w) the drawing shows the place.
    """

    x: Float[np.ndarray, "h w"]
    y: Float[np.ndarray, "h w"]
    mask: Bool[np.ndarray, "h w"]

    def moved(self, flow: Float[np.ndarray, "h w 2"] | None, part: float) -> Places:
        """Return the places with `part` of a displacement added, pixels of the drawing."""
        if flow is None or part == 0:
            return self.x, self.y
        return self.x + np.float32(part) * flow[..., 0], self.y + np.float32(part) * flow[..., 1]


def _half(view: Drawing) -> Drawing:
    """Return a drawing averaged over blocks of 2 x 2 pixels."""
    even = [(0, size % 2) for size in view.rgba.shape[:2]]
    paint = np.pad(view.paint, [*even, (0, 0)], mode="edge").astype(np.float32)
    levels = None if view.levels is None else np.pad(view.levels, even)[::2, ::2].copy()
    own = _half_size(Original(view.camera, view.rgba))
    original = None if view.original is None else _half_size(view.original)
    flat = _rounded(_in_blocks(paint))
    return Drawing(own.camera, own.rgba, flat, levels, view.mirrored, original, view.limbs)


def _half_size(picture: Original) -> Original:
    even = [(0, size % 2) for size in picture.rgba.shape[:2]]
    rgba = np.pad(picture.rgba, [*even, (0, 0)]).astype(np.float32)
    rgba[..., :3] *= rgba[..., 3:] / 255
    mean = _in_blocks(rgba)
    mean[..., :3] *= 255 / np.maximum(mean[..., 3:], 1e-6)
    camera = replace(picture.camera, size_wh=(rgba.shape[1], rgba.shape[0])).resized(0.5)
    return Original(camera, _rounded(mean))


def _in_blocks(picture: Float[np.ndarray, "height width c"]) -> Float[np.ndarray, "rows columns c"]:
    height, width, channels = picture.shape
    return picture.reshape(height // 2, 2, width // 2, 2, channels).mean(axis=(1, 3))


def _rounded(picture: Float[np.ndarray, "rows columns c"]) -> UInt8[np.ndarray, "rows columns c"]:
    return (picture + 0.5).clip(0, 255).astype(np.uint8)


def levels_of(
    depth: Float[np.ndarray, "height width"], depths: tuple[float, float]
) -> UInt8[np.ndarray, "height width"]:
    """Return depth (nan: none) in levels of `Drawing`."""
    low, high = depths
    part = (depth - low) / max(high - low, 1e-12)
    return np.where(np.isfinite(depth), np.rint(np.nan_to_num(part) * 254) + 1, 0).astype(np.uint8)


def depth_of(
    levels: UInt8[np.ndarray, "height width"], depths: tuple[float, float]
) -> Float[np.ndarray, "height width"]:
    """Return the depths of levels: the inverse of `levels_of`."""
    low, high = depths
    return np.where(levels > 0, low + (levels - 1.0) / 254 * (high - low), np.nan)


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


def look_up(
    texture: Texture,
    points: Float[np.ndarray, "h w 3"],
    slack: float,
    least_px: float,
    *,
    faces: bool = False,
) -> Seen:
    """Return where places of the surface lie in a drawing, and which of them it shows.

    Args:
        texture: the drawing.
        points: world.
        slack: world units that a place may lie behind the drawing's own surface.
        least_px: smaller patches and pinholes of what it shows are noise.
        faces: groups of features may lie FACES times as far behind it.
    """
    (x, y), depth, front = places_in(texture.camera, points)
    border = cv2.BORDER_CONSTANT
    far = cv2.remap(texture.far, x, y, cv2.INTER_NEAREST, borderMode=border, borderValue=-np.inf)
    covered = cv2.remap(texture.whole[..., 3], x, y, cv2.INTER_LINEAR, borderMode=border)
    if faces:
        grouped = cv2.remap(texture.features.groups, x, y, cv2.INTER_NEAREST) > 0
        far = far + np.float32((FACES - 1) * slack) * grouped
    mask = front & (covered > 0.5) & (depth <= far + slack)
    return Seen(x, y, without_crumbs(mask, least_px))


def places_in(
    camera: Camera, points: Float[np.ndarray, "h w 3"]
) -> tuple[Places, Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return where world points lie in a picture, their depth, and which are in front.

    The first pixel's centre is at 0; points behind a pinhole lie far beyond the picture.
    """
    pixels, depth, front = camera.project_grid(points)
    x, y = (pixels - 0.5).astype(np.float32)
    if not front.all():
        x, y = (np.nan_to_num(at, nan=-1e4) for at in (x, y))
    return (x, y), depth, front


def sample_picture(
    picture: Shaped[np.ndarray, "height width *channels"], places: Places, mode: int
) -> Shaped[np.ndarray, "h w *channels"]:
    """Return a picture's values at places; beyond its edges those of the edge."""
    return cv2.remap(picture, *places, mode, borderMode=cv2.BORDER_REPLICATE)


def filled(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return depth with every gap as deep as the nearest pixel that has one; 0 without any."""
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros(depth.shape, dtype=np.float32)
    return taken(depth, nearest(seen)).astype(np.float32)


def crisp_depth(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return depth without gaps and without mixtures of near and far."""
    return crisp(filled(depth))


def crisp(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return depth, which has no gaps, without mixtures of near and far.

    A pixel on a step shows the mean of both sides; it goes to the side that it is nearer to.
    """
    low, high = cv2.erode(depth, SQUARE), cv2.dilate(depth, SQUARE)
    nearer = np.minimum(depth, (depth + low) / 2)
    farther = np.maximum(depth, (depth + high) / 2)
    return np.where(depth - low < high - depth, nearer, farther)
