"""Small drawings of every kind to find palettes of: flat, cel, painted, grainy, through JPEG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import UInt8

from lab.bench.palette.cases import as_jpeg, characters
from lab.bench.palette.cel import CelOptions, cel_case
from toonset.dataset.synthetic.options import CONDITIONS, SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.mesh import Mesh

Images = tuple[UInt8[np.ndarray, "_ _ 4"], ...]
Rgb = tuple[int, int, int]
CELL_PX, VIEWS = 150, 3
FLAT = SynthOptions(cell_px=CELL_PX, outline_px=1.8, elevation_deg=5, views=VIEWS)
GRAIN = 5  # levels
OPAQUE_SHARE = 0.8  # of see-through drawings
GAINS = (1.0, 0.88, 1.1)  # of drawings in other light
FEW = (
    ("flat, JPEG", "cel of 2 tones", "grainy", "line art"),
    ("painted", "cel of 4 tones", "see-through", "other light", "enlarged"),
)
TIMES = 3  # of drawings that are enlarged without smoothing


def drawings(*, large: bool) -> Iterator[tuple[str, Images, tuple[Rgb, ...]]]:
    """Yield names, drawings and printed colours: the usual few, or many others of other seeds."""
    first = 40 if large else 5
    for number, mesh in enumerate(characters(None, first, quick=not large, count=4)):
        kinds = _kinds(mesh, first + number, number)
        for kind, images in kinds.items():
            if large or kind in FEW[number]:
                yield f"{kind}, {mesh.name}", images, ()
        if number == 0 and large:
            colors = [tuple(map(int, rgb)) for rgb in _turnaround(mesh, FLAT, first).palette[:4]]
            printed: tuple[Rgb, ...] = tuple((rgb[0], rgb[1], rgb[2]) for rgb in colors)
            yield f"printed, {mesh.name}", kinds["painted"], printed


def _kinds(mesh: Mesh, seed: int, number: int) -> dict[str, Images]:
    flat = _turnaround(mesh, FLAT, seed)
    plain = tuple(view.rgba for view in flat.views)
    soft = {name: _turnaround(mesh, _of_condition(name), seed) for name in ("painted", "artist")}
    found = {"flat": plain, "flat, JPEG": as_jpeg(flat, 80)}
    found |= {name: as_jpeg(own, 90) for name, own in soft.items()}
    for tones in (2, 3, 4):
        options = CelOptions(tones, number % 3 < 2, number % 2 > 0, tones == 3)
        made = cel_case(mesh, seed, replace(options, jpeg=90 if tones == 4 else None))
        found[f"cel of {tones} tones"] = _halved(made.sheet.images[:VIEWS])
    found["grainy"] = _grainy(plain, seed)
    found["line art"] = tuple(map(_line_art, plain))
    found["see-through"] = tuple(map(_see_through, plain))
    found["other light"] = tuple(map(_lit, plain, GAINS))
    found["enlarged"] = tuple(_enlarged(one) for one in plain)
    return found


def _of_condition(name: str) -> SynthOptions:
    return replace(CONDITIONS[name], cell_px=CELL_PX, views=VIEWS)


def _turnaround(mesh: Mesh, options: SynthOptions, seed: int) -> Turnaround:
    return make_turnaround(mesh, options, seed)


def _halved(images: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> Images:
    """Return drawings at half their size, colours weighed by their alpha."""
    halved = []
    for one in images:
        alpha = one[..., 3:] / 255
        both = np.dstack([one[..., :3] * alpha, 255 * alpha])
        small = cv2.resize(both, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        small[..., :3] /= np.maximum(small[..., 3:] / 255, 1e-6)
        halved.append(np.rint(small).clip(0, 255).astype(np.uint8))
    return tuple(halved)


def _grainy(images: Images, seed: int) -> Images:
    rng, found = np.random.default_rng(seed), []
    for one in images:
        noise = rng.normal(0, GRAIN, one.shape[:2])[..., None]
        rgb = np.rint(one[..., :3] + noise).clip(0, 255).astype(np.uint8)
        found.append(np.dstack([rgb, one[..., 3]]))
    return tuple(found)


def _line_art(image: UInt8[np.ndarray, "_ _ 4"]) -> UInt8[np.ndarray, "_ _ 4"]:
    dark = image[..., :3].max(axis=-1, keepdims=True) < 60
    return np.dstack([np.where(dark, image[..., :3], np.uint8(250)), image[..., 3]])


def _see_through(image: UInt8[np.ndarray, "_ _ 4"]) -> UInt8[np.ndarray, "_ _ 4"]:
    return np.dstack([image[..., :3], (image[..., 3] * OPAQUE_SHARE).astype(np.uint8)])


def _lit(image: UInt8[np.ndarray, "_ _ 4"], gain: float) -> UInt8[np.ndarray, "_ _ 4"]:
    rgb = np.rint(image[..., :3] * gain).clip(0, 255).astype(np.uint8)
    return np.dstack([rgb, image[..., 3]])


def _enlarged(image: UInt8[np.ndarray, "_ _ 4"]) -> UInt8[np.ndarray, "_ _ 4"]:
    return image[::3, ::3].repeat(TIMES, axis=0).repeat(TIMES, axis=1)
