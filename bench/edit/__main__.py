"""`python -m bench.edit CASES`: how few corrections make doubtful sheets right, and how soon.

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

from toonset.camera import rotation_distance, rotation_from_angles
from toonset.cli.editor.opening import open_session
from toonset.cli.editor.session import Session
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
            truth = (
                Truth(tuple(b), None, math.radians(y)) for b, y in zip(boxes, yaws, strict=True)
            )
            yield Case(folder.name, folder / "sheet.png", None, tuple(truth))
    for folder in sorted((root / "sheets").iterdir()):
        character, _, condition = folder.name.partition("-")
        if condition not in ("uneven", "artist", "generic", "drawn"):
            continue
        own = (
            folder if condition == "generic" else root / "sheets" / f"{OTHER_BODY[character]}-drawn"
        )
        sheet = next(folder.glob("sheet.*"))
        yield Case(folder.name, sheet, own / "mannequin.obj", tuple(_truth(folder / "gt.json")))


def _truth(file: Path) -> Iterator[Truth]:
    from toonset.camera import angles_from_rotation

    said = json.loads(file.read_text())
    for box, pose in zip(said["boxes"], said["world_from_camera"], strict=True):
        world_from_camera = np.array(pose)[:3, :3] @ OPENGL_FROM_OPENCV[:3, :3]
        angles = angles_from_rotation(world_from_camera.T)
        yield Truth((box["sheet_x"], box["sheet_y"], box["w"], box["h"]), angles, angles[0])


def pairs(case: Case, scene: dict[str, Any]) -> list[tuple[dict[str, Any], Truth]]:
    """Return every view with the truth of the cell that its middle lies in."""
    found = []
    for view in scene["views"]:
        x, y, width, height = view["box"]
        at = (x + width / 2, y + height / 2)
        near = min(
            case.truth,
            key=lambda one: math.dist(
                at, (one.box[0] + one.box[2] / 2, one.box[1] + one.box[3] / 2)
            ),
        )
        found.append((view, near))
    return found


def corrected(case: Case, session: Session) -> dict[str, Any]:
    """Correct a sheet; return what was done and how it came out."""
    said: dict[str, Any] = {"version": 1}
    actions: list[str] = []
    seconds: list[tuple[float, float]] = []  # by the clock, of the processor
    start = _state(case, session)
    state = start
    while not state["right"] and len(actions) < MOST_ACTIONS:
        view, truth = state["next"]
        entry = next((one for one in said.get("views", []) if one["box"] == view["box"]), None)
        entry, word = _next_said(view, truth, entry)
        others = [one for one in said.get("views", []) if one["box"] != view["box"]]
        said = {"version": 1, "views": [*others, entry]}
        began, worked = time.monotonic(), time.process_time()
        session.save(said, session.revision)
        fitted = session.state()
        while fitted["busy"]:
            fitted = session.state(after=fitted["number"], wait_s=60)
        seconds.append((time.monotonic() - began, time.process_time() - worked))
        actions.append(f"{view['name'].removesuffix('.png')} {word}")
        state = _state(case, session)
    return {
        "name": case.name,
        "views": len(session.scene["views"]),
        "verdict": f"{start['verdict']} -> {state['verdict']}",
        "wrong": f"{len(start['wrong'])} -> {len(state['wrong'])}",
        "worst_deg": f"{start['most']:.0f} -> {state['most']:.0f}",
        "actions": actions,
        "seconds": seconds,
        "right": state["right"],
    }


def _state(case: Case, session: Session) -> dict[str, Any]:
    both = pairs(case, session.scene)
    errors = [truth.error_deg(view) for view, truth in both]
    doubtful = [i for i, (view, _) in enumerate(both) if view["verdict"] == "ambiguous"]
    number = int(np.argmax(errors)) if max(errors) > RIGHT_DEG else (*doubtful, 0)[0]
    wrong = [error for error in errors if error > RIGHT_DEG]
    verdict = session.scene["verdict"]["state"]
    right = not wrong and verdict != "ambiguous"
    told = {"wrong": wrong, "most": max(errors), "verdict": verdict, "right": right}
    return {"next": both[number], **told}


def _next_said(
    view: dict[str, Any], truth: Truth, entry: dict[str, Any] | None
) -> tuple[dict[str, Any], str]:
    """Return what a person says next of a drawing, and in a word."""
    yaw = math.degrees(truth.yaw)
    if entry is None:
        word = WORDS[round(yaw / 45) % 8]
        return {"box": view["box"], "label": word}, word
    angles = truth.angles or (truth.yaw, math.radians(view["elevation"]), 0.0)
    rounded = [round(math.degrees(one) / DRAGGED_DEG) * DRAGGED_DEG for one in angles[:2]]
    camera = view["camera"]
    placed = {
        "yaw": rounded[0],
        "elevation": rounded[1],
        "roll": 0.0,
        "scale": camera["scale"],
        "middle": camera["center"],
    }
    lock = {"lock": True} if "camera" in entry else {}
    word = "lock" if lock else f"drag to {rounded[0]:.0f}, {rounded[1]:.0f}"
    return {"box": view["box"], "camera": placed, **lock}, word


def main(
    root: Annotated[Path, typer.Argument(metavar="CASES", help="Folder of the public cases.")],
    only: Annotated[str, typer.Option(help="Cases whose name matches this.")] = "",
) -> None:
    """Print what corrections make of sheets that are doubtful."""
    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as place:
        for case in cases(root):
            if not re.search(only, case.name) or len(found) == MOST_SHEETS:
                continue
            folder = Path(place) / case.name
            try:
                session = open_session(case.sheet, folder, case.mesh, lambda text: None)
            except ToonsetError as error:
                print(f"{case.name}: {error}")
                continue
            try:
                if len(session.scene["views"]) != len(case.truth):
                    print(
                        f"{case.name}: {len(session.scene['views'])} of {len(case.truth)} drawings"
                    )
                elif not _state(case, session)["right"]:
                    found.append(corrected(case, session))
                    _tell(found[-1])
                else:
                    print(f"{case.name}: right at once, {session.scene['verdict']['state']}")
            finally:
                session.stop()
                shutil.rmtree(folder, ignore_errors=True)
    seconds = [one for each in found for one in each["seconds"]]
    right = sum(each["right"] for each in found)
    print(
        f"{right} of {len(found)} sheets right, not ambiguous, with {MOST_ACTIONS} actions at most"
    )
    for name, times in zip(("clock", "processor"), zip(*seconds, strict=True), strict=False):
        print(f"fits, {name}: median {np.median(times):.1f} s, most {max(times):.1f} s")


def _tell(each: dict[str, Any]) -> None:
    times = ", ".join(f"{clock:.1f} ({worked:.1f})" for clock, worked in each["seconds"])
    done = "; ".join(each["actions"])
    print(
        f"{each['name']}: {each['verdict']}; views off by > {RIGHT_DEG:.0f} deg {each['wrong']}, "
        f"worst {each['worst_deg']} deg; {len(each['actions'])} actions ({done}); "
        f"{times} s",
        flush=True,
    )


if __name__ == "__main__":
    typer.run(main)
