"""Read a scene from disk: pictures, cameras, and labels where there is a palette."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.bundle.transforms_read import (
    PosedPicture,
    member,
    read_frames,
    transforms_file,
)
from toonset.dataset.images.picture import load_indexed_png, load_rgba
from toonset.dataset.mesh.load import load_mesh
from toonset.errors import BundleError
from toonset.lock import settle
from toonset.options import SYMMETRIC, Symmetric
from toonset.palette.formats.json import read_palette_json
from toonset.palette.palette import MOST_TONES, Palette
from toonset.palette.pixels.labels import UNLABELLED
from toonset.palette.pixels.ramp_labels import ramps_of

MANNEQUIN, CALIBRATION = "mannequin.obj", "calibration.json"
Labels = UInt8[np.ndarray, "height width"]


def read_scene(path: Path) -> Scene:
    """Return the posed pictures of a bundle, a transforms.json, or a folder that holds one.

    Labels and palette are read where the folder has `palette.json` and `labels/`, the mannequin
    where it has one.

    Raises:
        BundleError: a file is missing, broken, of another size than its camera says, or outside
            of the folder; calibration.json is broken.
        MeshError: mannequin.obj is broken.
        PaletteError: palette.json is broken.
        PictureError: a picture cannot be read.
    """
    file = transforms_file(path)
    root = file.parent
    palette = read_palette_of(root)
    posed = read_frames(file, need_pictures=True)
    if palette is not None:
        check_label_names(file, posed)
    frames = []
    for frame in posed:
        rgba = read_picture(frame, file)
        labels = None if palette is None else read_labels(root, frame, len(palette.colors))
        frames.append(Frame(Path(frame.file_path).name, frame.camera, rgba, labels))
    mannequin = member(root, MANNEQUIN)
    mesh = None if mannequin is None else load_mesh(mannequin)
    said = symmetric_of(root)
    scene = Scene(tuple(frames), None, str(path), mesh, symmetric=said)
    if palette is None:
        return scene
    return replace(scene, palette=palette.rgb, shadow=palette.shadow, ramps=ramps_of(palette))


def symmetric_of(root: Path) -> Symmetric:
    """Return whether left and right are mirror images, as calibration.json says; else "auto".

    Raises:
        BundleError: it lies elsewhere or is broken.
    """
    file = member(root, CALIBRATION)
    if file is None:
        return "auto"
    said = read_calibration(file).options.get("symmetric", "auto")
    if said not in SYMMETRIC:
        raise BundleError(
            f"{file}: options: symmetric: {said!r} is unknown; write {' or '.join(SYMMETRIC)}"
        )
    return cast(Symmetric, said)


def read_palette_of(root: Path) -> Palette | None:
    """Return the palette of a folder's palette.json; None if missing.

    Raises:
        BundleError, PaletteError: it lies elsewhere, or is broken.
    """
    settle(root / "palette.json")
    file = member(root, "palette.json")
    return None if file is None else read_palette_json(file)


def read_picture(frame: PosedPicture, file: Path) -> UInt8[np.ndarray, "height width 4"]:
    """Return a frame's picture.

    Raises:
        PictureError: it cannot be read.
        BundleError: it has another size than its camera.
    """
    assert frame.picture is not None  # read_frames has seen to it
    rgba = load_rgba(frame.picture)
    check_size(frame.picture, rgba, frame.camera, file.name)
    return rgba


def read_labels(root: Path, frame: PosedPicture, colors: int) -> Labels | None:
    """Return a frame's label map; None if missing.

    Raises:
        PictureError: it is not an indexed PNG.
        BundleError: it has another size than its camera, or a label without a colour.
    """
    file = member(root, f"labels/{label_name(frame)}")
    if file is None:
        return None
    labels = load_indexed_png(file)
    check_size(file, labels, frame.camera, "transforms.json")
    check_paints(file, labels, colors, "label")
    return labels


def read_tones(root: Path, frame: PosedPicture) -> UInt8[np.ndarray, "height width"] | None:
    """Return how dark each pixel's paint lies: 0 in light, 1 in shadow, to 3; 255: no paint.

    None where the frame has no tones: those of a flat sheet, or of an older palette.

    Raises:
        PictureError: it cannot be read.
        BundleError: it has another size than its camera, is not grey, or has another value.
    """
    file = member(root, f"tones/{label_name(frame)}")
    if file is None:
        return None
    tones = _read_grey(file, frame)
    odd = tones[~np.isin(tones, (*range(MOST_TONES), UNLABELLED))]
    if odd.size:
        raise BundleError(
            f"{file}: has the value {odd[0]}, only 0 (light) to 3 (darkest) and 255 (none) are "
            "known; write the tones again with `toonset palette`"
        )
    return tones


def read_coverage(
    root: Path, frame: PosedPicture, colors: int
) -> UInt8[np.ndarray, "height width 3"] | None:
    """Return which paints cover each pixel (`toonset.palette.coverage`), None where not known.

    Raises:
        PictureError: it cannot be read.
        BundleError: it has another size than its camera, or a paint that the palette lacks.
    """
    file = member(root, f"coverage/{label_name(frame)}")
    if file is None:
        return None
    ranks = load_rgba(file)[..., :3]
    check_size(file, ranks, frame.camera, "transforms.json")
    check_paints(file, ranks[..., :2], colors, "paint")
    return ranks


def check_paints(file: Path, paints: UInt8[np.ndarray, ...], colors: int, what: str) -> None:
    """Refuse numbers of paints that the palette lacks.

    Raises:
        BundleError: one is as large as the palette, and not 255.
    """
    used = paints[paints != UNLABELLED]
    if used.size and used.max() >= colors:
        raise BundleError(
            f"{file}: {what} {used.max()} but the palette has {colors} colours; run `toonset "
            "palette` again"
        )


def read_contour(root: Path, frame: PosedPicture) -> UInt8[np.ndarray, "height width"] | None:
    """Return how much of each pixel of a frame is drawn line (255 = all), None where not known.

    Raises:
        PictureError: it cannot be read.
        BundleError: it has another size than its camera, or is not grey.
    """
    file = member(root, f"contours/{label_name(frame)}")
    return None if file is None else _read_grey(file, frame)


def _read_grey(file: Path, frame: PosedPicture) -> UInt8[np.ndarray, "height width"]:
    rgba = load_rgba(file)
    check_size(file, rgba, frame.camera, "transforms.json")
    grey = rgba[..., 0]
    if (rgba[..., 1:3] != grey[..., None]).any() or (rgba[..., 3] < 255).any():
        raise BundleError(
            f"{file}: is coloured or see-through, a grey picture is needed; save it as 8-bit grey"
        )
    return grey


def label_name(frame: PosedPicture) -> str:
    """Return the file name of a frame's label map (and contour)."""
    return f"{Path(frame.file_path).stem}.png"


def check_label_names(file: Path, posed: list[PosedPicture]) -> None:
    """Refuse frames that would share one label map.

    Raises:
        BundleError: two pictures have one name.
    """
    name, count = Counter(label_name(frame) for frame in posed).most_common(1)[0]
    if count > 1:
        raise BundleError(f"{file}: {count} pictures share labels/{name}; rename all but one")


def check_size(path: Path, pixels: np.ndarray, camera: Camera, said_by: str) -> None:
    """Refuse a picture that is not its camera's.

    Raises:
        BundleError: it has another size.
    """
    height, width = pixels.shape[:2]
    if (width, height) != camera.size_wh:
        raise BundleError(
            f"{path}: is {width} x {height} px, {said_by} says {camera.size_wh[0]} x "
            f"{camera.size_wh[1]}; make them equal"
        )
