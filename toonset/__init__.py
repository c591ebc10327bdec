"""Turn character sheets into cameras, palettes and radiance fields.

import toonset as ts

sheet   = ts.split_sheet("sheet.png")
found   = ts.calibrate(sheet.views, ts.load_mesh("mannequin.obj"))
palette = ts.extract_palette(found.drawings)
bundle  = ts.write_bundle("bundle", found, palette)
run     = ts.train(bundle.scene, ts.TrainOptions(seed=0))
for i, camera in enumerate(ts.turntable(run.field, 36)):
    ts.render(run.field, camera).save(f"{i:03d}.png")

This is the whole public interface: the road of a sheet from drawings to new views, with the bytes
that the commands write. Exports, films, textures and new colours are the commands' own. Importing
it loads nothing heavy: a name's module is imported when the name is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from toonset.calib.calibrate import calibrate as calibrate
    from toonset.calib.options import Hints as Hints
    from toonset.calib.result import Calibration as Calibration
    from toonset.calib.write_bundle import write_bundle as write_bundle
    from toonset.camera import Camera as Camera
    from toonset.dataset.bundle.bundle import Bundle as Bundle
    from toonset.dataset.bundle.bundle import read_bundle as read_bundle
    from toonset.dataset.images.picture import load_rgba
    from toonset.dataset.mesh.load import load_mesh as load_mesh
    from toonset.dataset.split_folder.load import split_sheet as split_sheet
    from toonset.dataset.split_folder.options import SheetOptions as SheetOptions
    from toonset.dataset.view_dataset import ViewDataset as ViewDataset
    from toonset.errors import ToonsetError as ToonsetError
    from toonset.mesh import Mesh as Mesh
    from toonset.nerf.leave_one_out import leave_one_out as leave_one_out
    from toonset.nerf.options import TrainOptions as TrainOptions
    from toonset.nerf.render.turntable import turntable as turntable
    from toonset.nerf.render.views import render as render
    from toonset.nerf.run.folder import read_field
    from toonset.nerf.score.evaluate import evaluate as evaluate
    from toonset.nerf.surface.surface import surface_of as surface_of
    from toonset.nerf.training import train as train
    from toonset.options import Body as Body
    from toonset.palette.extract import extract_palette as extract_palette
    from toonset.palette.extract import label_image as label_image
    from toonset.palette.options import PaletteOptions as PaletteOptions
    from toonset.palette.palette import Palette as Palette
    from toonset.projection import project as project
    from toonset.view import View as View

    load_picture, read_run = load_rgba, read_field

_PLACES = {  # module -> its public names; "name=there" where it is called otherwise there
    "calib.calibrate": "calibrate",
    "calib.options": "Hints",
    "calib.result": "Calibration",
    "calib.write_bundle": "write_bundle",
    "camera": "Camera",
    "dataset.bundle.bundle": "Bundle read_bundle",
    "dataset.images.picture": "load_picture=load_rgba",
    "dataset.mesh.load": "load_mesh",
    "dataset.split_folder.load": "split_sheet",
    "dataset.split_folder.options": "SheetOptions",
    "dataset.view_dataset": "ViewDataset",
    "errors": "ToonsetError",
    "mesh": "Mesh",
    "nerf.leave_one_out": "leave_one_out",
    "nerf.options": "TrainOptions",
    "nerf.render.turntable": "turntable",
    "nerf.render.views": "render",
    "nerf.run.folder": "read_run=read_field",
    "nerf.score.evaluate": "evaluate",
    "nerf.surface.surface": "surface_of",
    "nerf.training": "train",
    "options": "Body",
    "palette.extract": "extract_palette label_image",
    "palette.options": "PaletteOptions",
    "palette.palette": "Palette",
    "projection": "project",
    "view": "View",
}


def __getattr__(name: str) -> Any:
    """Return a public name, importing the module that holds it."""
    for module, names in _PLACES.items():
        for public, _, there in (entry.partition("=") for entry in names.split()):
            if public == name:
                found = getattr(importlib.import_module(f"{__name__}.{module}"), there or public)
                globals()[name] = found
                return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names, for completion."""
    names = (entry.partition("=")[0] for names in _PLACES.values() for entry in names.split())
    return sorted(["__version__", *names])
