"""Draw a synthetic turnaround of any mesh, with its ground truth.

One generator feeds tests, benchmarks and examples. Every view is drawn from labels and depth of
`toonset.dataset.synthetic.gl_render`: flat colours, black contours, then the errors of a hand:
turned a little too far, a little too large, smoothly bent; or cheated, with parts that keep facing
the viewer; or with all that artists do besides (`ArtistOptions`). Bends and other bodies are in the
picture alone; all else is in the camera (or the mesh) of the truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from PIL import Image

from toonset.camera import Camera
from toonset.dataset.synthetic.body_error import deform
from toonset.dataset.synthetic.body_parts import find_body_parts
from toonset.dataset.synthetic.cell import Hand, draw_cell
from toonset.dataset.synthetic.directions import directions_deg
from toonset.dataset.synthetic.follow_viewer import part_numbers, turn_parts
from toonset.dataset.synthetic.layout import CellGrid, paste
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.paper import ruled, with_captions, with_grain, with_title
from toonset.mesh import Mesh
from toonset.view import View

JUMP = 0.02  # of the body's height: a larger step in depth is drawn as a line
CAPTION, TITLE = 0.1, 0.16  # of the cell: the strip below it, that above all
MARGIN = 0.04  # of the cell on every side, beside what outline and bend may need
BEND_REACH = 3.0  # times the bend's root mean square: as far as a figure's rim is assumed to move
FACE_ON = 1e-6  # sine of a yaw: a view of front or back
PLAIN = (204, 204, 204)  # a mesh without colours
MOST_COLORS = 64  # a textured mesh is reduced to so many


@dataclass(frozen=True, eq=False)
class Turnaround:
    """A sheet and everything that is true of it.

    Attributes:
        sheet: (height, width, 4) sRGB with the options' background, before any JPEG.
        views: the cells on transparent ground, in sheet order; `box` is the cell in the sheet.
        cameras: one per view, exact, in pixels of its cell; the bend is not in them.
        labels: per view (cell, cell) index into `palette`; 255 = background, ink, mixed pixel.
        ink: per view (cell, cell) coverage of lines, 0 to 255.
        shadows: per view (cell, cell) which pixels that have a label are in shadow.
        palette: (colors, 3) sRGB, in light.
        color_factors: per view (3,) its colours over the palette's.
        figure_boxes: per view (x, y, width, height) of the figure in the sheet.
        yaws: per view in radians, with jitter, in [0, 2 pi).
        mesh: what was drawn (parts that follow the viewer stand as in the mesh).
        options: as given.
        seed: as given.
    """

    sheet: UInt8[np.ndarray, "height width 4"]
    views: tuple[View, ...]
    cameras: tuple[Camera, ...]
    labels: tuple[UInt8[np.ndarray, "cell cell"], ...]
    ink: tuple[UInt8[np.ndarray, "cell cell"], ...]
    shadows: tuple[Bool[np.ndarray, "cell cell"], ...]
    palette: UInt8[np.ndarray, "colors 3"]
    color_factors: tuple[Float[np.ndarray, " 3"], ...]
    figure_boxes: tuple[tuple[int, int, int, int], ...]
    yaws: tuple[float, ...]
    mesh: Mesh
    options: SynthOptions
    seed: int


def make_turnaround(
    mesh: Mesh,
    options: SynthOptions,
    seed: int,
    landmarks: Mapping[str, Sequence[float]] | None = None,
) -> Turnaround:
    """Return a turnaround of `mesh`; the same arguments give the same bytes.

    Args:
        mesh: posed, +Y up, front +Z; face colours are used as they are, none means grey.
        options: what to draw.
        seed: of jitter, scale errors, bends and the rest; each of them draws from its own stream,
            so that changing one option leaves the others' randomness as it was.
        landmarks: world points by name, which say where head and arms are; without them the names
            of the mesh's parts do.

    Raises:
        MeshError: a part that should follow the viewer does not exist.
        CameraError: the perspective's camera stands within the mesh.
        SetupError: EGL or Mesa is missing.
    """
    yaws, errors, hands, paper = _errors(options, seed)
    following = part_numbers(mesh, options.following_parts)
    limbs, of_body = find_body_parts(mesh, landmarks or {}), options.artist.body
    drawn = [
        turn_parts(deform(mesh, limbs, of_body, yaw, hand.body), following, yaw)
        for yaw, hand in zip(yaws, hands, strict=True)
    ]
    tilts = [options.artist.elevation_jitter_deg * h.tilt.standard_normal() for h in hands]
    elevations = np.radians(options.elevation_deg + np.array(tilts))
    body = turn_parts(mesh, following, yaws[0])
    cameras = _cameras(body, drawn, np.stack([yaws, elevations, errors], axis=1), options)
    paints = flat_palette(mesh)
    cells = [
        draw_cell(posed, paints, camera, JUMP * mesh.height, options, hand)
        for posed, camera, hand in zip(drawn, cameras, hands, strict=True)
    ]
    grid, pictures = _grid(options), [cell.drawing.rgba for cell in cells]
    boxes = [grid.figure_box(i, rgba) for i, rgba in enumerate(pictures)]
    return Turnaround(
        sheet=_sheet(pictures, boxes, grid, options, mesh.name, paper),
        views=tuple(
            View(cell.drawing.rgba, grid.box(i), cell.line_px, f"{i:03d}.png")
            for i, cell in enumerate(cells)
        ),
        cameras=tuple(cameras),
        labels=tuple(cell.drawing.labels for cell in cells),
        ink=tuple(cell.drawing.ink for cell in cells),
        shadows=tuple(cell.shadow for cell in cells),
        palette=paints[0],
        color_factors=tuple(cell.color_factor for cell in cells),
        figure_boxes=tuple(boxes),
        yaws=tuple(float(yaw) for yaw in yaws),
        mesh=mesh,
        options=options,
        seed=seed,
    )


def _errors(
    options: SynthOptions, seed: int
) -> tuple[
    Float[np.ndarray, " views"], Float[np.ndarray, " views"], list[Hand], np.random.Generator
]:
    """Return yaws (radians), factors of size, what draws every view, and the paper's stream."""
    jitter, sizes, bends, artist, way = (
        np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(5)
    )
    turns = np.radians(directions_deg(options.turn, options.views))
    turns *= 1 if options.turn == "even" else way.choice([-1, 1])
    face_on = (options.turn == "half") & (np.abs(np.sin(turns)) < FACE_ON)
    spread = np.where(face_on, 0.0, math.radians(options.yaw_jitter_deg))
    yaws = (turns + spread * jitter.uniform(-1, 1, options.views)) % (2 * math.pi)
    factors = 1 + options.scale_error_percent / 100 * sizes.uniform(-1, 1, options.views)
    seeds = bends.integers(2**63, size=options.views)
    paper, *own = artist.spawn(options.views + 1)
    hands = [Hand(int(s), *hand.spawn(5)) for s, hand in zip(seeds, own, strict=True)]
    return yaws, factors, hands, paper


def _sheet(
    pictures: Sequence[UInt8[np.ndarray, "cell cell 4"]],
    boxes: Sequence[tuple[int, int, int, int]],
    grid: CellGrid,
    options: SynthOptions,
    name: str,
    paper: np.random.Generator,
) -> UInt8[np.ndarray, "height width 4"]:
    if options.background_rgb is None:
        return paste(pictures, grid, None)
    width, height = grid.size_wh
    ground = np.full((height, width, 3), options.background_rgb, dtype=np.uint8)
    if options.artist.height_lines:
        ground = ruled(ground, grid, boxes, options.artist.height_lines)
    sheet = paste(pictures, grid, ground)
    if options.artist.title:
        sheet = with_title(sheet, grid, name)
    if options.artist.captions:
        sheet = with_captions(sheet, grid, directions_deg(options.turn, options.views))
    return with_grain(sheet, options.artist.grain_levels, paper)


def _grid(options: SynthOptions) -> CellGrid:
    caption = round(CAPTION * options.cell_px) if options.artist.captions else 0
    title = round(TITLE * options.cell_px) if options.artist.title else 0
    columns = options.columns or options.views
    return CellGrid(options.views, columns, options.cell_px, caption, title)


def _cameras(
    body: Mesh, drawn: Sequence[Mesh], placed: Float[np.ndarray, "views 3"], options: SynthOptions
) -> list[Camera]:
    """Return cameras of one common scale (times each view's error) that keep figures in cells.

    Args:
        body: what they look at.
        drawn: what each shows.
        placed: yaw, elevation (radians) and error of the scale of each.
        options: of the sheet.
    """
    size = (options.cell_px, options.cell_px)
    k = 1 / (options.distance_heights * body.height) if options.distance_heights else 0.0
    zero = np.zeros(2)
    unit = [
        Camera.looking_at(body.middle, yaw, elevation, error, size, center=zero, k=k)
        for yaw, elevation, error in placed
    ]
    spans = [_span(mesh, camera) for mesh, camera in zip(drawn, unit, strict=True)]
    low = np.min([span[0] for span in spans], axis=0)
    high = np.max([span[1] for span in spans], axis=0)
    half_extent = max(abs(low[0]), abs(high[0]), (high[1] - low[1]) / 2)
    scale = _room_px(options) / half_extent
    center = np.array([size[0] / 2, size[1] / 2 - scale * (low[1] + high[1]) / 2])
    return [replace(camera, scale=camera.scale * scale, center=center) for camera in unit]


def _span(mesh: Mesh, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    pixels, _, _ = camera.project(mesh.vertices)
    return np.nanmin(pixels, axis=0), np.nanmax(pixels, axis=0)


def _room_px(options: SynthOptions) -> float:
    """Return how far from the cell's middle the undrawn figure may reach."""
    bend = BEND_REACH * options.warp_percent / 100 * options.cell_px
    return options.cell_px * (0.5 - MARGIN) - options.outline_px / 2 - bend


def flat_palette(mesh: Mesh) -> tuple[UInt8[np.ndarray, "colors 3"], Int[np.ndarray, " faces"]]:
    """Return the mesh's colours, largest surface first, and the index of every face's colour.

    A mesh without colours is grey; more than 64 colours are reduced to 64 by median cut.
    """
    if mesh.face_colors is None:
        return np.array([PLAIN], dtype=np.uint8), np.zeros(len(mesh.faces), dtype=np.int64)
    colors, labels = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    if len(colors) > MOST_COLORS:
        colors, labels = np.unique(_reduced(mesh.face_colors), axis=0, return_inverse=True)
    labels = labels.reshape(-1)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.bincount(labels, np.linalg.norm(normals, axis=1), len(colors))
    order = np.argsort(-areas, kind="stable")
    return colors[order], np.argsort(order)[labels]


def _reduced(face_colors: np.ndarray) -> np.ndarray:
    image = Image.fromarray(np.ascontiguousarray(face_colors[None]))
    return np.asarray(image.quantize(MOST_COLORS, Image.Quantize.MEDIANCUT).convert("RGB"))[0]
