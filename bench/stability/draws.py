"""How every step of a calibration sweep draws its sheet: one thing changes, all else stays."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image

from bench.cases.bodies import HAIR, random_body
from bench.stability.bodies import (
    EARS,
    vase,
    with_arms_raised,
    with_contrast,
    with_ears,
    with_head_grown,
)
from bench.stability.damage import (
    Drawn,
    mirrored,
    rolled,
    stretched,
    with_capsule,
    with_gaps_closed,
    without_feet,
    without_pieces,
)
from bench.stability.sheet import BASE, DrawnSheet, Step, draw_sheet, stream
from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import SheetError
from toonset.mesh import Mesh

STAFF_RADIUS = 0.02  # of the body's height
LOSSLESS, HARD = "lossless", "hard"

Rgba = UInt8[np.ndarray, "height width 4"]


def without_lines(step: Step, seed: int) -> DrawnSheet:
    """Return the base sheet without lines: an alignment alone does not know their width."""
    return draw_sheet(seed, replace(BASE, outline_px=0))


def warped(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings bent by `step` percent of the cell."""
    return draw_sheet(seed, replace(BASE, warp_percent=float(step)))


def outlined(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings with lines of `step` px."""
    return draw_sheet(seed, replace(BASE, outline_px=float(step)))


def misscaled(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings too large or too small by up to `step` percent."""
    return draw_sheet(seed, replace(BASE, scale_error_percent=float(step)))


def near(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings seen from `step` body heights."""
    return draw_sheet(seed, replace(BASE, distance_heights=float(step)))


def numbered(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of so many views; few views still come from all directions over the seeds."""
    views = int(step)
    return draw_sheet(seed, replace(BASE, views=views, yaw_jitter_deg=180 / views))


def uneven(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings turned too far or too little by up to `step` degrees."""
    return draw_sheet(seed, replace(BASE, yaw_jitter_deg=float(step)))


def sized(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of cells of `step` px."""
    outline = BASE.outline_px * float(step) / BASE.cell_px
    return draw_sheet(seed, replace(BASE, cell_px=int(step), outline_px=outline))


def of_body(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of a body with this symmetry."""
    bodies = {
        "asymmetric": lambda: random_body(seed),
        "symmetric": lambda: random_body(seed, symmetric=True),
        "vase": vase,
    }
    return draw_sheet(seed, mesh=bodies[str(step)]())


def turned_over(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings that lean left or right by `step` degrees."""
    return _each("roll", seed, lambda d, sign: rolled(*d, sign * math.radians(float(step))))


def squashed(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of drawings that are stretched or squashed by `step` percent."""
    return _each("squash", seed, lambda d, sign: stretched(*d, (1 + float(step) / 100) ** sign - 1))


def cropped(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet without the lowest `step` percent of the figures."""
    return _each("feet", seed, lambda d, _: without_feet(*d, float(step) / 100))


def with_gaps_painted(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet on which gaps up to `step` percent of the height are painted shut."""
    return _each("gaps", seed, lambda d, _: with_gaps_closed(*d, float(step) / 100))


def with_hair(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures with a ball of hair round the top of the head."""
    sheet = draw_sheet(seed)
    top = sheet.mesh.vertices[sheet.mesh.vertices[:, 1].argmax()]
    return _with_extra(sheet, np.stack([top, top]), float(step) / 100 * sheet.mesh.height)


def with_staff(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures with an upright staff in the right hand."""
    sheet = draw_sheet(seed)
    hand = sheet.mesh.vertices[sheet.mesh.vertices[:, 0].argmin()]
    half = np.array([0, float(step) / 200 * sheet.mesh.height, 0])
    radius = STAFF_RADIUS * sheet.mesh.height if step else 0.0
    return _with_extra(sheet, np.stack([hand - half, hand + half]), radius)


def with_following_ears(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures with ears that face the viewer; the mannequin's face the front."""
    body = random_body(seed)
    eared = with_ears(body, float(step) / 100 * body.height)
    return draw_sheet(seed, replace(BASE, following_parts=EARS if step else ()), eared)


def with_arms_up(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures whose arms are raised by `step` degrees; the mannequin's not."""
    body = random_body(seed)
    return _of_mannequin(body, with_arms_raised(body, math.radians(float(step))), seed)


def with_large_head(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures with heads larger by `step` percent than the mannequin's."""
    body = random_body(seed)
    return _of_mannequin(body, with_head_grown(body, float(step) / 100), seed)


def paler(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet with `step` percent of the contrast between colours."""
    return draw_sheet(seed, mesh=with_contrast(random_body(seed), float(step) / 100))


def with_mirrored(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet with `step` drawings flipped left to right."""
    sheet = draw_sheet(seed)
    flipped = stream("mirror", seed).permutation(len(sheet.drawings))[: int(step)]
    drawings = (mirrored(*d) if i in flipped else d for i, d in enumerate(sheet.drawings))
    return replace(sheet, drawings=tuple(drawings))


def fragmented(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures that lack `step` percent of their area."""
    sheet = draw_sheet(seed)
    generators = stream("fragments", seed).spawn(len(sheet.drawings))
    pairs = zip(sheet.drawings, generators, strict=True)
    broken = tuple(without_pieces(*d, float(step) / 100, g) for d, g in pairs)
    return replace(sheet, drawings=broken)


def blurred(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet without anti-aliasing, or blurred by `step` px, as it is cut out of a file."""
    made = make_turnaround(random_body(seed), without_samples(BASE, step), seed)
    return cut_out(made, soft(made.sheet, step))


def compressed(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet as it is cut out of a JPEG file of quality `step`."""
    made = make_turnaround(random_body(seed), BASE, seed)
    return cut_out(made, through_jpeg(made.sheet, step))


def without_samples(options: SynthOptions, step: Step) -> SynthOptions:
    """Return the options; "hard" edges have one sample per pixel."""
    return replace(options, supersample=1) if step == HARD else options


def soft(sheet: Rgba, step: Step) -> Rgba:
    """Return the sheet blurred by `step` px, one standard deviation."""
    blur = 0.0 if step == HARD else float(step)
    return np.asarray(cv2.GaussianBlur(sheet, (0, 0), blur)) if blur else sheet


def through_jpeg(sheet: Rgba, step: Step) -> Rgba:
    """Return an opaque sheet after it was a JPEG file of quality `step`."""
    if step == LOSSLESS:
        return sheet
    file = io.BytesIO()
    Image.fromarray(sheet[..., :3]).save(file, "JPEG", quality=int(step))
    return decode_rgba(file.getvalue(), Path("sheet.jpg"))


def cut_out(made: Turnaround, sheet: Rgba) -> DrawnSheet:
    """Return the drawings as they are found on a sheet of the turnaround, with their true cameras.

    Raises:
        SheetError: other than the drawn number of views was found.
    """
    found = split_picture(sheet).views
    if len(found) != len(made.views):
        raise SheetError(f"split into {len(found)} views, {len(made.views)} were drawn")
    drawings = []
    for view, drawn, camera in zip(found, made.views, made.cameras, strict=True):
        offset = (view.box[0] - drawn.box[0], view.box[1] - drawn.box[1])
        size_wh = (view.rgba.shape[1], view.rgba.shape[0])
        drawings.append((view, camera.moved(offset, size_wh)))
    return DrawnSheet(made.mesh, tuple(drawings))


def _each(name: str, seed: int, change: Callable[[Drawn, int], Drawn]) -> DrawnSheet:
    """Return the base sheet with every drawing changed, to one of two sides."""
    sheet = draw_sheet(seed)
    sides = stream(name, seed).choice([-1, 1], len(sheet.drawings))
    pairs = zip(sheet.drawings, sides, strict=True)
    return replace(sheet, drawings=tuple(change(drawn, int(side)) for drawn, side in pairs))


def _with_extra(sheet: DrawnSheet, ends: np.ndarray, radius: float) -> DrawnSheet:
    more = tuple(with_capsule(*d, ends, radius, HAIR) for d in sheet.drawings)
    return replace(sheet, drawings=more)


def _of_mannequin(mannequin: Mesh, drawn: Mesh, seed: int) -> DrawnSheet:
    return replace(draw_sheet(seed, mesh=drawn), mesh=mannequin)
