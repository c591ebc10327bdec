"""Write a calibration as a bundle, with or without the palette of its drawings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from toonset.calib.result import Calibration
from toonset.calib.verdict.overlay import draw_overlay
from toonset.calib.verdict.report import calibration_dict
from toonset.calib.without_body.placing import size_of_figures
from toonset.dataset.bundle.bundle import WRITTEN, Bundle, bundle_folder, read_bundle
from toonset.dataset.bundle.palette_files import palette_title, write_labelled
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contours
from toonset.view import SHEET
from toonset.write import check_output


def write_bundle(
    folder: str | Path, found: Calibration, palette: Palette | None = None, *, force: bool = False
) -> Bundle:
    """Write a bundle and return it as it is read again; it appears whole or not at all.

    Args:
        folder: where; replaced as a whole with `force`.
        found: of `calibrate`.
        palette: of the drawings; written with label maps, as `toonset palette` does.
        force: replace an existing bundle.

    Raises:
        OutputError: the folder exists and `force` is off or it holds what no bundle does, or it
            cannot be written.
    """
    save_bundle(folder, found, palette, force=force)
    return read_bundle(folder)


def save_bundle(
    folder: str | Path, found: Calibration, palette: Palette | None = None, *, force: bool = False
) -> None:
    """Write a bundle as `write_bundle` does, without reading it again."""
    folder = Path(folder)
    check_output(folder, [], WRITTEN, force=force)
    cameras = [view.camera for view in found.views]
    fitted = found.mesh and replace(found.mesh, vertices=found.mannequin)
    size = (fitted.height, fitted.radius) if fitted else size_of_figures(found.drawings, cameras)
    overlay = draw_overlay(found.drawings, fitted, found)
    report = calibration_dict(found)
    with bundle_folder(
        folder, found.drawings, cameras, fitted, size, report, overlay, force=force
    ) as place:
        if palette is not None:
            pictures = [view.rgba for view in found.drawings]
            names = [view.name for view in found.drawings]
            sheets = (file["name"] for file in report.get("inputs", ()) if file["role"] == SHEET)
            titled = replace(palette, title=palette.title or palette_title(sheets, folder))
            write_labelled(place, titled, names, pictures, find_contours(pictures))
