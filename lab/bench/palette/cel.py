"""Cel sheets, measured: is a paint that is shaded in flat tones one paint, and are its tones right?

A tone ends where n . l falls below a threshold: n is the surface's normal, l the direction to the
light, both in camera axes. Every paint darkens by a factor of its own. Counted are pixels of one
paint and no line; those without a label count as one more label. Index: the adjusted Rand index of
labels and paints. Own label: large paints that share more than half of their pixels with one label
(intersection over union). Tones: pixels whose tone is right, of those that have a label and lie in
one tone. Garment: a band across the largest paint, in its hue but darker and shaded in as many
tones, has a label of its own.

Source: toon shading by thresholds on the normal, A. Lake and others, "Stylized rendering techniques
for scalable real-time 3D animation" (2000).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from lab.bench.cases.jpeg import through_jpeg
from lab.bench.palette.cases import characters
from lab.bench.palette.painted import (
    LARGE,
    Labels,
    PaintedCase,
    k_means,
    label_overlaps,
    rand_index,
)
from lab.bench.records.record import Column, Record, Recorder
from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_and_normals
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.shadow import SOFT, TO_LIGHT
from toonset.dataset.synthetic.turnaround import flat_palette, make_turnaround
from toonset.mesh import Mesh
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import UNLABELLED

BODIES = 10
CELL_PX, VIEWS, ELEVATION_DEG = 300, 4, 3
OUTLINE = 0.01  # of the cell
FINE = 3  # rendered so many times larger, then averaged
CUTS = {1: (), 2: (0.3,), 3: (0.45, -0.05), 4: (0.6, 0.25, -0.15)}  # n . l between two tones
LOGS = {1: (0.0,), 2: (0, -0.33), 3: (0, -0.28, -0.6), 4: (0, -0.22, -0.45, -0.75)}  # of light
COOLER = (1.1, 1.0, 0.8)  # times that, by red, green and blue
DEPTH, UNEVEN = 0.12, 0.06  # deviations of logarithms: of a paint's strength, of each tone
SHINY, WHITER = 0.965, 0.55  # least n . l of a highlight, and how far it goes to white
GARMENT = (0.45, 0.6, 0.7, 0.8)  # times as light as the paint that it is on, body by body
BAND = 0.3  # of the height of the largest paint, which it is on
OWN = 0.5  # more of all pixels of a paint and a label are shared: the label is its own
OWN_LABEL, TONES, GARMENTS = "own labels of large paints", "tones right", "garments apart"
COLUMNS = (
    Column(OWN_LABEL, "own label", "{:.3f}", "mean"),
    Column(TONES, "tones", "{:.3f}", "mean"),
    Column(GARMENTS, "garment", "{:.2f}", "mean"),
)


@dataclass(frozen=True)
class CelOptions:
    """How a cel sheet is drawn.

    Attributes:
        tones: of every paint, 1 to 4.
        lined: whether it has contours.
        shiny: whether paints have highlights.
        garment: whether a band in a paint's hue is on it.
        jpeg: quality; None: PNG.
    """

    tones: int
    lined: bool = True
    shiny: bool = False
    garment: bool = False
    jpeg: int | None = None

    @property
    def group(self) -> str:
        """Return the condition's name."""
        parts = [f"cel, {CELL_PX} px, {self.tones} tone{'s' * (self.tones > 1)}"]
        parts += ["lines" if self.lined else "no lines"]
        parts += ["highlights"] * self.shiny + ["garment"] * self.garment
        return ", ".join([*parts, f"jpeg {self.jpeg}" if self.jpeg else "png"])


QUICK = (CelOptions(3),)
CONDITIONS = (
    *(CelOptions(tones, lined) for lined in (True, False) for tones in CUTS),
    CelOptions(3, shiny=True),
    CelOptions(3, jpeg=90),
    CelOptions(3, garment=True),
)


@dataclass(frozen=True, eq=False)
class CelCase:
    """A cel sheet and its truth.

    Attributes:
        sheet: drawings, and the paint of every pixel.
        tones: of every pixel, from 0 in light on; 255: no paint, a highlight, or a mixture.
        garment: number of the paint of the garment, None without.
    """

    sheet: PaintedCase
    tones: Labels
    garment: int | None = None


@dataclass(frozen=True, eq=False)
class _Fine:
    """A view, rendered large: paint and tone of every pixel, and where highlights are."""

    paints: UInt8[np.ndarray, "fine fine"]
    tones: UInt8[np.ndarray, "fine fine"]
    shiny: Bool[np.ndarray, "fine fine"]


def bench_cel(
    folder: Path | None,
    seed: int,
    *,
    quick: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return records of the palette and of k-means on cel sheets.

    Args:
        folder: character folders with known colours; None for synthetic ones.
        seed: of the first synthetic character and of its drawings.
        quick: two characters in three tones.
        progress: told what is measured.
    """
    records = []
    for options in QUICK if quick else CONDITIONS:
        samples: dict[tuple[str, str], dict[str, float]] = {}
        bodies = characters(folder, seed, quick=quick, count=BODIES)
        for number, mesh in enumerate(bodies):
            progress(f"palette {mesh.name}, {options.group}")
            case = cel_case(mesh, seed + number, options)
            for name, method in METHODS.items():
                for metric, value in score_cel(case, *method(case)).items():
                    samples.setdefault((name, metric), {})[mesh.name] = value
        for (name, metric), by_case in samples.items():
            recorder, values = Recorder(name, options.group, seed), list(by_case.values())
            records.append(recorder.samples(metric, values, "", "higher", by_case))
    return records


def cel_case(mesh: Mesh, seed: int, options: CelOptions) -> CelCase:
    """Return a cel sheet of a body; the same arguments give the same bytes.

    Args:
        mesh: in its paints.
        seed: of the drawings and of how far every paint darkens.
        options: how it is drawn.
    """
    outline = OUTLINE * CELL_PX if options.lined else 0.0
    drawn = SynthOptions(
        cell_px=CELL_PX, outline_px=outline, elevation_deg=ELEVATION_DEG, views=VIEWS
    )
    made = make_turnaround(mesh, drawn, seed)
    palette, faces = flat_palette(mesh)
    views = [_rendered(mesh, faces, c.resized(FINE), options) for c in made.cameras]
    worn = None
    if options.garment:
        paints = np.concatenate([view.paints[view.paints != UNLABELLED] for view in views])
        worn, under = len(palette), int(np.bincount(paints).argmax())
        views = [replace(view, paints=_dressed(view.paints, under, worn)) for view in views]
        cloth = np.rint(GARMENT[seed % len(GARMENT)] * palette[under]).astype(np.uint8)
        palette = np.concatenate([palette, cloth[None]])
    colors = _tone_colors(palette, options.tones, np.random.default_rng(1000 + seed))
    images, truths, tones = [], [], []
    for fine, ink in zip(views, made.ink, strict=True):
        images.append(_drawing(fine, colors, ink, options.jpeg))
        paint = np.where(ink == 0, _of_one(fine.paints), UNLABELLED)
        tone = _of_one(np.where(fine.shiny, UNLABELLED, fine.tones))
        truths.append(paint)
        tones.append(np.where(paint == UNLABELLED, UNLABELLED, tone))
    known = np.concatenate([paint[paint != UNLABELLED] for paint in truths])
    shares = np.bincount(known, minlength=len(palette)) / len(known)
    return CelCase(PaintedCase(mesh.name, images, truths, shares), tones, worn)


def ours(case: CelCase) -> tuple[Labels, Labels]:
    """Return labels and tones of `toonset palette`."""
    images = case.sheet.images
    palette = extract_palette(images)
    maps = paint_maps(images, find_contours(images), palette)
    tones = [np.zeros_like(m.labels) if m.tones is None else m.tones for m in maps]
    return [m.labels for m in maps], tones


def one_color_each(case: CelCase) -> tuple[Labels, None]:
    """Return labels of k-means, which knows no tones."""
    return k_means(case.sheet)[1], None


METHODS: dict[str, Callable[[CelCase], tuple[Labels, Labels | None]]] = {
    "default": ours,
    "k-means, true k": one_color_each,
}


def score_cel(case: CelCase, labels: Labels, tones: Labels | None) -> dict[str, float]:
    """Return metrics of a cel sheet's labels and tones, by name: see the module.

    Args:
        case: the sheet.
        labels: of every drawing.
        tones: of every drawing; None: not known.
    """
    of_all = (case.sheet.truths, labels, case.tones)
    true, own, true_tone = (np.concatenate([one.ravel() for one in of]) for of in of_all)
    known = true != UNLABELLED
    shared = label_overlaps(true[known], own[known], len(case.sheet.shares))
    scores = {
        "index of labels": rand_index(true[known], own[known]),
        OWN_LABEL: float((shared[case.sheet.shares >= LARGE] > OWN).mean()),
    }
    if tones is not None:
        told = (own != UNLABELLED) & (true_tone != UNLABELLED)
        found = np.concatenate([one.ravel() for one in tones])
        scores[TONES] = float((found == true_tone)[told].mean())
    if case.garment is not None:
        scores[GARMENTS] = float(shared[case.garment] > OWN)
    return scores


def _dressed(
    paints: UInt8[np.ndarray, "fine fine"], under: int, worn: int
) -> UInt8[np.ndarray, "fine fine"]:
    """Return a view's paints with a band of another one across the middle of one of them."""
    own = paints == under
    rows = np.flatnonzero(own.any(axis=1))
    if not rows.size:  # hidden in this view
        return paints
    middle, reach = (rows[0] + rows[-1]) / 2, BAND * (rows[-1] - rows[0]) / 2
    across = abs(np.arange(len(own)) - middle) < reach
    return np.where(own & across[:, None], np.uint8(worn), paints)


def _tone_colors(
    palette: UInt8[np.ndarray, "paints 3"], tones: int, rng: np.random.Generator
) -> Float[np.ndarray, "tones paints 3"]:
    """Return the colours of all paints in every tone, from light on, and in a highlight, last."""
    logs = np.array(LOGS[tones])[:, None, None]
    strength = np.exp(rng.normal(0, DEPTH, (1, len(palette), 1)))
    uneven = (logs != 0) * rng.normal(0, UNEVEN, (tones, len(palette), 1))
    drawn = palette * np.exp(logs * np.array(COOLER) * strength + uneven)
    return np.concatenate([drawn, palette[None] + WHITER * (255.0 - palette)]).clip(0, 255)


def _rendered(
    mesh: Mesh, faces: Int[np.ndarray, " faces"], camera: Camera, options: CelOptions
) -> _Fine:
    depth, normals = depth_and_normals(mesh.vertices, mesh.faces, camera)
    there = np.isfinite(depth).astype(np.float32)
    light = (normals @ np.array(TO_LIGHT)).astype(np.float32)
    sigma = SOFT * mesh.height * camera.scale
    light, weight = (cv2.GaussianBlur(each, (0, 0), sigma) for each in (light, there))
    light /= np.maximum(weight, 1e-3)
    tones = sum((light < cut).astype(np.uint8) for cut in CUTS[options.tones])
    paints = render_labels(mesh, faces, camera).labels
    shiny = (paints != UNLABELLED) & (light > SHINY) & options.shiny
    return _Fine(paints, np.broadcast_to(np.uint8(tones), paints.shape), shiny)


def _drawing(
    fine: _Fine,
    colors: Float[np.ndarray, "tones paints 3"],
    ink: UInt8[np.ndarray, "cell cell"],
    jpeg: int | None,
) -> UInt8[np.ndarray, "cell cell 4"]:
    """Return a view: tones averaged over every pixel, lines over them."""
    there = fine.paints != UNLABELLED
    rgba = np.zeros((*there.shape, 4))
    tones = np.where(fine.shiny, len(colors) - 1, fine.tones)
    rgba[there, :3], rgba[there, 3] = colors[tones[there], fine.paints[there]], 255
    mean = cv2.resize(rgba, (CELL_PX, CELL_PX), interpolation=cv2.INTER_AREA)
    cover, line = mean[..., 3:] / 255, ink[..., None] / 255
    rgb = mean[..., :3] / np.maximum(cover, 1e-6) * (1 - line)
    cover = np.maximum(cover, line)
    image = np.rint(np.dstack([rgb, 255 * cover])).clip(0, 255).astype(np.uint8)
    if jpeg is not None:
        cover = image[..., 3:] / 255
        paper = np.rint(image[..., :3] * cover + 255 * (1 - cover)).astype(np.uint8)
        image[..., :3] = through_jpeg(paper, jpeg)[..., :3]
    return image


def _of_one(values: UInt8[np.ndarray, "fine fine"]) -> UInt8[np.ndarray, "cell cell"]:
    """Return the value of pixels that have one alone, 255 elsewhere."""
    within = values.reshape(CELL_PX, FINE, CELL_PX, FINE)
    low, high = within.min(axis=(1, 3)), within.max(axis=(1, 3))
    return np.asarray(np.where(low == high, low, np.uint8(UNLABELLED)))
