"""Drawn sheets with held-out views that are true: what the look bench is measured on.

Synthetic bodies with eyes, outlines, the errors of a hand and their own mesh as mannequin, or case
folders as in `bench.cases.cases`. Every sheet comes twice: with its true cameras, and with those
that calibration finds on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from lab.bench.cases.bodies import random_body
from lab.bench.cases.cases import MANNEQUIN_FILE, case_folders, scene_of
from lab.bench.stability.bodies import with_eyes
from toonset.calib.calibrate import calibrate
from toonset.calib.write_bundle import write_bundle
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.mesh.load import load_mesh
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.view import View

DRAWN = SynthOptions(cell_px=300, elevation_deg=8, outline_px=2.5, warp_percent=1.0)
QUICK_PX = 150
EYE_RADIUS = 0.022  # of the height
HELD_OUT = 16  # views all round, of which every second lies between two drawings
TURN, SHOWN = 90, 30  # views of a whole turn; as many of them as flicker is measured on
SYNTHETIC, CALIBRATED = "drawn", ", calibrated"  # a group; ends the groups of found cameras


@dataclass(frozen=True, eq=False)
class LookCase:
    """Drawings to train on, and what new views of them should look like.

    Attributes:
        name: of the character.
        group: condition.
        train: the drawings.
        test: held-out views without drawing error.
        turn: consecutive views of a turn, as they should look; None: they are not known.
    """

    name: str
    group: str
    train: Scene
    test: Scene
    turn: Scene | None = None


def look_cases(
    folder: Path | None, seed: int, count: int, only: str = "", *, quick: bool = False
) -> Iterator[LookCase]:
    """Yield every sheet with its true cameras and, unless it must be quick, with found ones.

    Args:
        folder: case folders; None for synthetic sheets.
        seed: of the first synthetic body; the others' follow.
        count: of synthetic bodies.
        only: leave out cases whose name and group do not contain this.
        quick: true cameras alone, synthetic sheets of half the size.

    Raises:
        ToonsetError: the folder holds no case, or a sheet cannot be split or calibrated.
    """
    sides = (False,) if quick else (False, True)
    if folder is None:
        for body in (seed + i for i in range(count)):
            for calibrated in sides:
                if only in f"body {body} {SYNTHETIC}{CALIBRATED * calibrated}":
                    yield _synthetic(body, calibrated=calibrated, px=QUICK_PX if quick else 300)
        return
    for place in case_folders(folder, "views/transforms.json"):
        group = place.name.rsplit("-", 1)[-1]
        for calibrated in sides:
            if only in f"{place.name} {group}{CALIBRATED * calibrated}":
                yield _from_folder(place, group, calibrated=calibrated)


def drawn_case(seed: int, options: SynthOptions = DRAWN) -> tuple[LookCase, Turnaround]:
    """Return the synthetic sheet of a seed with its true cameras, without a turn, and its drawing.

    Args:
        seed: of the body, its yaws and bends.
        options: of the drawings; held-out views have the same lines, and none of the errors.
    """
    body = random_body(seed)
    body = with_eyes(body, EYE_RADIUS * body.height)
    made = make_turnaround(body, options, seed)
    test = scene_of(make_turnaround(body, _true(options, HELD_OUT), seed))
    between = replace(test, frames=test.frames[1::2])
    return LookCase(f"body {seed}", SYNTHETIC, scene_of(made), between), made


def _synthetic(seed: int, *, calibrated: bool, px: int) -> LookCase:
    options = replace(DRAWN, cell_px=px, outline_px=DRAWN.outline_px * px / DRAWN.cell_px)
    case, made = drawn_case(seed, options)
    turn = scene_of(make_turnaround(made.mesh, _true(options, TURN), seed))
    train = replace(case.train, mannequin=made.mesh)
    case = replace(case, train=train, turn=replace(turn, frames=turn.frames[:SHOWN]))
    if not calibrated:
        return case
    views = split_picture(made.sheet).views
    return replace(case, group=SYNTHETIC + CALIBRATED, train=_calibrated(views, made.mesh))


def _from_folder(place: Path, group: str, *, calibrated: bool) -> LookCase:
    train, test = read_scene(place / "views"), read_scene(place / "test")
    if calibrated:
        sheets = sorted(path for path in place.glob("sheet.*"))
        if not sheets:
            raise BundleError(f"{place}: holds no sheet.png or sheet.jpg to calibrate")
        mesh = load_mesh(place / MANNEQUIN_FILE)
        train = _calibrated(split_sheet(sheets[0]).views, mesh)
    name = place.name.removesuffix(f"-{group}")
    return LookCase(name, group + CALIBRATED * calibrated, train, test)


def _calibrated(views: tuple[View, ...], mesh: Mesh) -> Scene:
    """Return the drawings with the cameras that calibration finds, as a bundle has them."""
    with TemporaryDirectory() as folder:
        return write_bundle(Path(folder) / "bundle", calibrate(views, mesh)).scene


def _true(options: SynthOptions, views: int) -> SynthOptions:
    """Return the options without what a hand does wrong."""
    return replace(options, views=views, warp_percent=0, yaw_jitter_deg=0, scale_error_percent=0)
