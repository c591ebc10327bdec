"""Click landmarks on drawings with true cameras, and measure the cameras that are found.

A click shows a vertex of the mesh that the true camera sees, chosen far from the others; it is off
by Gaussian noise, and a wrong one lies anywhere in the figure's box, a tenth of the height away at
least. Drawing error is not in the clicks, but in the outlines that are fitted beside them.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
from jaxtyping import Float, Int

from lab.bench.calib.baselines import HEIGHTS, solved
from lab.bench.calib.figures import WRONG
from lab.bench.cases.bodies import random_body
from lab.bench.cases.cases import CONDITIONS, MANNEQUIN_FILE, case_folders
from lab.bench.records.record import CPU_SECONDS, Record, Recorder
from toonset.calib.find_cameras import find_cameras
from toonset.calib.from_landmarks import calibrate_by_landmarks
from toonset.calib.known import Known
from toonset.camera import Camera, rotation_distance
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.mannequin.landmark_file import Landmarks
from toonset.dataset.mesh.load import load_mesh
from toonset.dataset.mesh.rasterize import depth_map
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Mesh
from toonset.view import View

ROTATION, PLACE, NAMED = "rotation error", "placing error", "wrong clicks named"
SILENT, FALSE = "wrong but ok", "good clicks named, a view"
PNP, ALONE, OUTLINES = "PnP, the lens known", "points", "points and outlines"
SEEN = 0.01  # of the height: a vertex this little behind the surface is on it
LEAST_WRONG = 0.1  # of the height, that a wrong click is off


@dataclass(frozen=True, eq=False)
class ClickCase:
    """Drawings with true cameras in their pixels, and the mesh that was drawn."""

    name: str
    group: str
    views: tuple[View, ...]
    cameras: tuple[Camera, ...]
    mesh: Mesh


@dataclass(frozen=True)
class Clicks:
    """How landmarks are clicked: pairs a view, their error over the height, wrong ones a view."""

    pairs: int
    sigma: float
    wrong: int

    def __str__(self) -> str:
        """Return it in words."""
        wrong = ", one wrong" if self.wrong else ""
        return f"{self.pairs} pairs, {100 * self.sigma:g} %{wrong}"


GRID = tuple(
    Clicks(pairs, sigma, wrong)
    for sigma in (0.005, 0.01, 0.02)
    for pairs in (4, 6, 8, 12)
    for wrong in (0, 1)
)
QUICK = (Clicks(6, 0.01, 0), Clicks(6, 0.01, 1))


@dataclass(frozen=True)
class Outcome:
    """How far one sheet's cameras are off.

    Attributes:
        group: its condition.
        case: its name.
        clicks: as they were made.
        rotation_deg: per view.
        place_px: per view, root mean square over the mesh's vertices, pixels of the drawing; empty
            where only rotations are found.
        named: wrong clicks that are called misplaced.
        wrong: how many there were.
        false_alarms: good clicks that are called misplaced.
        silent: views over 15 degrees off with verdict ok; -1: nothing was judged.
        cpu_s: of the sheet.
    """

    group: str
    case: str
    clicks: Clicks
    rotation_deg: tuple[float, ...]
    place_px: tuple[float, ...]
    named: int
    wrong: int
    false_alarms: int
    silent: int
    cpu_s: float


def click_cases(folder: Path | None, seed: int, count: int) -> Iterator[ClickCase]:
    """Yield the folder's cases whose mannequin is what was drawn, or synthetic sheets."""
    if folder is None:
        for group, condition in CONDITIONS.items():
            for number in range(0 if condition.other_body else count):
                body = random_body(seed + number, symmetric=condition.symmetric)
                made = make_turnaround(body, condition.options, seed + number)
                yield ClickCase(f"{group} {number}", group, made.views, made.cameras, body)
        return
    for case in case_folders(folder, "views/transforms.json"):
        frames = read_scene(case / "views").frames
        views = tuple(
            View(frame.rgba, (0, 0, *frame.camera.size_wh), 0.0, frame.name) for frame in frames
        )
        cameras = tuple(frame.camera for frame in frames)
        group = case.name.rsplit("-", 1)[-1]
        yield ClickCase(case.name, group, views, cameras, load_mesh(case / MANNEQUIN_FILE))


def measure(case: ClickCase, clicks: Clicks, seed: int, *, outlines: bool) -> Outcome:
    """Return how far the cameras are off, from the clicks alone or with the outlines."""
    marks, wrong = click(case, clicks, seed)
    began = time.process_time()
    if outlines:
        found = find_cameras(case.views, case.mesh, known=Known(landmarks=marks))
    else:
        found = calibrate_by_landmarks(case.views, case.mesh, marks)
    spent = time.process_time() - began
    called = {(i, int(name[1:])) for i, fit in enumerate(found.landmarks) for name in fit.misplaced}
    pairs = [(view.camera, true) for view, true in zip(found.views, case.cameras, strict=True)]
    off = [
        np.linalg.norm(a.project(case.mesh.vertices)[0] - b.project(case.mesh.vertices)[0], axis=1)
        for a, b in pairs
    ]
    return Outcome(
        case.group,
        case.name,
        clicks,
        tuple(float(np.degrees(rotation_distance(a.rotation, b.rotation))) for a, b in pairs),
        tuple(float(np.sqrt(np.mean(each**2))) for each in off),
        len(called & wrong),
        len(wrong),
        len(called - wrong),
        sum(
            rotation_distance(view.camera.rotation, true.rotation) > WRONG and view.verdict == "ok"
            for view, true in zip(found.views, case.cameras, strict=True)
        ),
        spent,
    )


def measure_pnp(case: ClickCase, clicks: Clicks, seed: int) -> Outcome:
    """Return how far SQPnP and its refinement are off, view by view, with the true lens."""
    marks, wrong = click(case, clicks, seed)
    began = time.process_time()
    found = []
    for own, camera in zip(marks, case.cameras, strict=True):
        lens = camera.as_pinhole(HEIGHTS * case.mesh.height) if camera.is_orthographic else camera
        rotation = solved(own.world, own.pixels, lens.K)
        found.append(np.pi if rotation is None else rotation_distance(rotation, camera.rotation))
    spent = time.process_time() - began
    degrees = tuple(np.degrees(found).tolist())
    return Outcome(case.group, case.name, clicks, degrees, (), 0, len(wrong), 0, -1, spent)


def click(
    case: ClickCase, clicks: Clicks, seed: int
) -> tuple[tuple[Landmarks, ...], set[tuple[int, int]]]:
    """Return the pairs of every view, and which of them (view, pair) are wrong."""
    about = f"{case.name} {clicks.pairs} {clicks.wrong}".encode()
    rng = np.random.default_rng([seed, crc32(about)])
    marks, wrong = [], set()
    for number, (view, camera) in enumerate(zip(case.views, case.cameras, strict=True)):
        pixels = camera.project(case.mesh.vertices)[0]
        height = float(np.ptp(pixels[:, 1]))
        chosen = _spread(case.mesh.vertices, _seen(case.mesh, camera, pixels), clicks.pairs, rng)
        at = pixels[chosen] + rng.normal(size=(len(chosen), 2)) * clicks.sigma * height
        for which in rng.permutation(len(chosen))[: clicks.wrong].tolist():
            at[which] = _elsewhere(pixels, at[which], LEAST_WRONG * height, rng)
            wrong.add((number, which))
        names = tuple(f"p{i}" for i in range(len(chosen)))
        marks.append(Landmarks(view.name, names, case.mesh.vertices[chosen], at))
    return tuple(marks), wrong


def records_of(found: Sequence[Outcome], method: str, seed: int) -> list[Record]:
    """Return the records of every condition and way of clicking."""
    records: list[Record] = []
    for key in dict.fromkeys((each.group, each.clicks) for each in found):
        own = [each for each in found if (each.group, each.clicks) == key]
        recorder = Recorder(method, f"{key[0]}: {key[1]}", seed)
        records += [
            recorder.samples(ROTATION, _joined(each.rotation_deg for each in own)),
            recorder.samples(CPU_SECONDS, [each.cpu_s for each in own], "s"),
        ]
        if method == PNP:
            continue
        records.append(recorder.samples(PLACE, _joined(each.place_px for each in own), "px"))
        silent = sum(each.silent for each in own)
        views = sum(len(each.rotation_deg) for each in own)
        records.append(recorder.total(SILENT, [True] * silent + [False] * (views - silent)))
        alarms = sum(each.false_alarms for each in own) / views
        records.append(recorder.samples(FALSE, [alarms], "1"))
        if key[1].wrong:
            share = sum(each.named for each in own) / sum(each.wrong for each in own)
            records.append(recorder.samples(NAMED, [share], "1", "higher"))
    return records


def _joined(values: Iterable[Sequence[float]]) -> list[float]:
    return [value for own in values for value in own]


def _seen(mesh: Mesh, camera: Camera, pixels: Float[np.ndarray, "v 2"]) -> Int[np.ndarray, " n"]:
    """Return the vertices that nothing hides, in a picture of the camera's size."""
    width, height = camera.size_wh
    column, row = np.floor(pixels).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    surface = depth_map(mesh.vertices, mesh.faces, camera)
    at = surface[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    depth = (mesh.vertices - camera.target) @ camera.rotation[2]
    return np.flatnonzero(inside & np.isfinite(at) & (depth < at + SEEN * mesh.height))


def _spread(
    vertices: Float[np.ndarray, "v 3"],
    among: Int[np.ndarray, " n"],
    count: int,
    rng: np.random.Generator,
) -> Int[np.ndarray, " count"]:
    """Return vertices that are far apart: a random one, then the farthest of a few random ones."""
    chosen = [int(rng.choice(among))]
    for _ in range(count - 1):
        few = rng.choice(among, min(20, len(among)), replace=False)
        apart = np.linalg.norm(vertices[few, None] - vertices[chosen][None], axis=2).min(axis=1)
        chosen.append(int(few[apart.argmax()]))
    return np.array(chosen)


def _elsewhere(
    pixels: Float[np.ndarray, "v 2"],
    at: Float[np.ndarray, " 2"],
    least_px: float,
    rng: np.random.Generator,
) -> Float[np.ndarray, " 2"]:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    while True:
        other = rng.uniform(low, high)
        if np.linalg.norm(other - at) > least_px:
            return np.asarray(other)
