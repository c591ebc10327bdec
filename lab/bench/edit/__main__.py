"""`python -m lab.bench.edit CASES`: how few corrections make doubtful sheets right, and how soon.

Sheets are drawn sprites with the plain body, and sheets of 3D characters with another character's
mannequin. Of those that come out wrong or ambiguous, ten are corrected by what a person sees: the
drawing that is farthest off, or else the first that is ambiguous, gets the nearest of the
compass's eight directions; where that was said already, the mannequin is dragged to the drawing's
own angles, to 10 degrees. Every correction is what the page would send, and is fitted before the
next. Truth is the cases' own; of sprites only yaw is known.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from toonset.apps.web.editor.opening import open_session
from toonset.apps.web.editor.session import Session
from toonset.camera import angles_from_rotation, rotation_distance, rotation_from_angles
from toonset.errors import ToonsetError
from toonset.frames import OPENGL_FROM_OPENCV

RIGHT_DEG = 15.0
MOST_ACTIONS, MOST_SHEETS = 5, 10
DRAGGED_DEG = 10.0
WORDS = ("front", "front-left", "left", "back-left", "back", "back-right", "right", "front-right")
OTHER_BODY = {  # whose mannequin a character's sheet is fitted with
    "kaykit_knight": "kaykit_rogue",
    "kaykit_rogue": "superpowers_brute",
    "quaternius_bunny_hero": "kaykit_knight",
    "quaternius_farmer": "kaykit_rogue",
    "quaternius_space_enemy": "kaykit_knight",
    "superpowers_brute": "quaternius_farmer",
}


@dataclass(frozen=True)
class Truth:
    """A drawing's camera: yaw, elevation and roll in radians; only yaw of sprites."""

    box: tuple[float, float, float, float]
    angles: tuple[float, float, float] | None
    yaw: float

    def error_deg(self, view: dict[str, Any]) -> float:
        """Return how far a fitted view is off."""
        yaw, elevation, roll = (math.radians(view[name]) for name in ("yaw", "elevation", "roll"))
        if self.angles is None:
            return abs(math.degrees((yaw - self.yaw + math.pi) % (2 * math.pi) - math.pi))
        found = rotation_from_angles(yaw, elevation, roll)
        return math.degrees(rotation_distance(found, rotation_from_angles(*self.angles)))


@dataclass(frozen=True)
class Case:
    """A sheet, a mannequin that is not its own (None: the plain one), and its truth."""

    name: str
    sheet: Path
    mesh: Path | None
    truth: tuple[Truth, ...]


def cases(root: Path) -> Iterator[Case]:
    """Yield every case, sprites first."""
    for folder in sorted((root / "turnarounds2d").iterdir()):
        info = json.loads((folder / "info.json").read_text())
        boxes, yaws = info.get("sheet_boxes_xywh"), info.get("yaw_deg")
        if boxes and yaws:
            pairs = zip(boxes, yaws, strict=True)
            truth = tuple(Truth(tuple(box), None, math.radians(yaw)) for box, yaw in pairs)
            yield Case(folder.name, folder / "sheet.png", None, truth)
    for folder in sorted((root / "sheets").iterdir()):
        character, _, condition = folder.name.partition("-")
        if condition not in ("uneven", "artist", "generic", "drawn"):
            continue
        other = root / "sheets" / f"{OTHER_BODY[character]}-drawn"
        own = folder if condition == "generic" else other
        sheet = next(folder.glob("sheet.*"))
        yield Case(folder.name, sheet, own / "mannequin.obj", tuple(_truth(folder / "gt.json")))


def _truth(file: Path) -> Iterator[Truth]:
    said = json.loads(file.read_text())
    for box, pose in zip(said["boxes"], said["world_from_camera"], strict=True):
        world_from_camera = np.array(pose)[:3, :3] @ OPENGL_FROM_OPENCV[:3, :3]
        angles = angles_from_rotation(world_from_camera.T)
        yield Truth((box["sheet_x"], box["sheet_y"], box["w"], box["h"]), angles, angles[0])


@dataclass(frozen=True)
class State:
    """How a sheet stands: views that are wrong, the worst, the verdict, what is corrected next."""

    wrong: int
    most_deg: float
    verdict: str
    next: tuple[dict[str, Any], Truth]

    @property
    def right(self) -> bool:
        """Return whether nothing is left to correct."""
        return not self.wrong and self.verdict != "ambiguous"


def state_of(case: Case, session: Session) -> State:
    """Return how a sheet stands; every view has the truth of the cell that is nearest."""

    def apart(view: dict[str, Any], truth: Truth) -> float:
        middles = [(x + w / 2, y + h / 2) for x, y, w, h in (view["box"], truth.box)]
        return math.dist(*middles)

    views = session.scene["views"]
    both = [(view, min(case.truth, key=lambda t: apart(view, t))) for view in views]
    errors = [truth.error_deg(view) for view, truth in both]
    doubtful = [i for i, (view, _) in enumerate(both) if view["verdict"] == "ambiguous"]
    wrong = sum(error > RIGHT_DEG for error in errors)
    number = int(np.argmax(errors)) if wrong else (*doubtful, 0)[0]
    return State(wrong, max(errors), session.scene["verdict"]["state"], both[number])


def corrected(case: Case, session: Session) -> tuple[bool, list[float]]:
    """Correct a sheet, and print what was done; return whether it is right, and its fits' CPU s."""
    entries: list[dict[str, Any]] = []
    actions: list[str] = []
    seconds: list[float] = []
    start = now = state_of(case, session)
    while not now.right and len(actions) < MOST_ACTIONS:
        view, truth = now.next
        known = next((one for one in entries if one["box"] == view["box"]), None)
        entry, word = _next_said(view, truth, known)
        entries = [*(one for one in entries if one is not known), entry]
        began = time.process_time()
        session.save({"version": 1, "views": entries}, session.revision)
        fitted = session.state()
        while fitted["busy"]:
            fitted = session.state(after=fitted["number"], wait_s=60)
        seconds.append(time.process_time() - began)
        actions.append(f"{view['name'].removesuffix('.png')} {word}")
        now = state_of(case, session)
    times = ", ".join(f"{one:.1f}" for one in seconds)
    print(
        f"{case.name}: {start.verdict} -> {now.verdict}; views off by > {RIGHT_DEG:.0f} deg "
        f"{start.wrong} -> {now.wrong}, worst {start.most_deg:.0f} -> {now.most_deg:.0f} deg; "
        f"{len(actions)} actions ({'; '.join(actions)}); {times} CPU s",
        flush=True,
    )
    return now.right, seconds


def _next_said(
    view: dict[str, Any], truth: Truth, entry: dict[str, Any] | None
) -> tuple[dict[str, Any], str]:
    """Return what a person says next of a drawing, and in a word."""
    if entry is None:
        word = WORDS[round(math.degrees(truth.yaw) / 45) % 8]
        return {"box": view["box"], "label": word}, word
    angles = truth.angles or (truth.yaw, math.radians(view["elevation"]), 0.0)
    yaw, elevation = (round(math.degrees(a) / DRAGGED_DEG) * DRAGGED_DEG for a in angles[:2])
    place = {"scale": view["camera"]["scale"], "middle": view["camera"]["center"]}
    placed = {"yaw": yaw, "elevation": elevation, "roll": 0.0, **place}
    lock = {"lock": True} if "camera" in entry else {}
    word = "lock" if lock else f"drag to {yaw:.0f}, {elevation:.0f}"
    return {"box": view["box"], "camera": placed, **lock}, word


def main(
    root: Annotated[Path, typer.Argument(metavar="CASES", help="Folder of the public cases.")],
    only: Annotated[str, typer.Option(help="Cases whose name matches this.")] = "",
) -> None:
    """Print what corrections make of sheets that are doubtful."""
    found: list[tuple[bool, list[float]]] = []
    with tempfile.TemporaryDirectory() as place:
        for case in (case for case in cases(root) if re.search(only, case.name)):
            if len(found) == MOST_SHEETS:
                break
            folder = Path(place) / case.name
            try:
                session = open_session(case.sheet, folder, case.mesh, lambda text: None)
            except ToonsetError as error:
                print(f"{case.name}: {error}")
                continue
            try:
                seen, verdict = len(session.scene["views"]), session.scene["verdict"]["state"]
                if seen != len(case.truth):
                    print(f"{case.name}: {seen} of {len(case.truth)} drawings")
                elif state_of(case, session).right:
                    print(f"{case.name}: right at once, {verdict}")
                else:
                    found.append(corrected(case, session))
            finally:
                session.stop()
                shutil.rmtree(folder, ignore_errors=True)
    right = sum(own for own, _ in found)
    print(f"{right} of {len(found)} sheets right, not ambiguous, with {MOST_ACTIONS} actions")
    seconds = [one for _, own in found for one in own]
    if seconds:
        print(f"fits: median {np.median(seconds):.1f} CPU s, most {max(seconds):.1f}")


if __name__ == "__main__":
    typer.run(main)
