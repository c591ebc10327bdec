"""What a training bench runs: cases, subsets of their views, methods, seeds, and in which order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

from lab.bench.cases.cases import TrainCase
from lab.bench.records.record import DEFAULT
from lab.bench.train.mlp import network
from lab.bench.train.painted_hull import painted
from lab.bench.train.voxel import voxels
from toonset.nerf.options import TrainOptions, paper
from toonset.nerf.train.fit_field import FieldOf

NEAREST = "nearest drawing"
PaletteChoice = Literal["no palette", "automatic palette", "hand-picked palette"]
PALETTES: tuple[PaletteChoice, ...] = get_args(PaletteChoice)
PLANES = {"finest planes": 1.0, "planes of 2/3": 2 / 3, "planes of 1/3": 1 / 3}  # of its cells


@dataclass(frozen=True)
class Method:
    """One way to predict a view.

    Attributes:
        options: of training, the seed aside; None: no training, the nearest drawing is shown.
        palette: that of the labels: none, one extracted in the seconds that count, or the one that
            the case comes with.
        seeds: it is run with each, not with the first alone.
        fewer: it is run with fewer views, too.
        share: cells of the planes, of the finest that the scene could have; None: as `options` say.
        slow: so slow that one case per condition and size must do.
        field: returns what is fitted; None: planes.
    """

    options: TrainOptions | None
    palette: PaletteChoice = "automatic palette"
    seeds: bool = False
    fewer: bool = True
    share: float | None = None
    slow: bool = False
    field: FieldOf | None = None


METHODS: dict[str, Method] = {
    DEFAULT: Method(TrainOptions(), seeds=True),
    NEAREST: Method(None),
    "coloured hull": Method(TrainOptions(steps=0), "no palette", field=painted),
    **{f"{n} steps": Method(TrainOptions(steps=n), fewer=False) for n in (30, 75)},
    **{n: Method(TrainOptions(field="triplane"), share=share) for n, share in PLANES.items()},
    "without palette": Method(TrainOptions(), "no palette"),
    "without smoothing": Method(TrainOptions(smoothness=0.0)),
    "without fairing": Method(TrainOptions(fairing=False)),
    "without registration": Method(TrainOptions(register=False)),
    "without unwarping": Method(TrainOptions(unwarp=False)),
    "without both": Method(TrainOptions(register=False, unwarp=False)),
    "without symmetry": Method(TrainOptions(symmetric="off")),
    "without hull": Method(TrainOptions(carve=False), fewer=False, slow=True),
    "voxel": Method(TrainOptions(), field=voxels),
    "mlp": Method(TrainOptions(), slow=True, field=network),
    **{
        f"paper, {palette}, {steps} steps": Method(paper(steps), palette, fewer=False, slow=True)
        for palette in PALETTES
        for steps in (200, 2000)
    },
    "paper, mlp": Method(paper(2000), fewer=False, slow=True, field=network),
}


@dataclass(frozen=True)
class Scope:
    """Scope of a bench.

    Attributes:
        methods: names in `METHODS`.
        views: numbers of training views.
        seeds: how many.
        one_case: one case per condition and size must do for all methods.
    """

    methods: tuple[str, ...]
    views: tuple[int, ...] = (8,)
    seeds: int = 1
    one_case: bool = False


SCOPES = {  # by whether it must be quick
    False: Scope(tuple(METHODS), views=(8, 4, 3), seeds=3),
    True: Scope((DEFAULT, NEAREST, "coloured hull", "75 steps"), one_case=True),
}


@dataclass(frozen=True, eq=False)
class Job:
    """One training and its figures.

    Attributes:
        case: all views; held-out ones are for the figures alone.
        views: how many of the case's views are trained on.
        method: name in `METHODS`.
        seed: of everything random.
    """

    case: TrainCase
    views: int
    method: str
    seed: int

    @property
    def way(self) -> Method:
        """Return how views are predicted."""
        return METHODS[self.method]

    @property
    def group(self) -> str:
        """Return the condition that figures are summarised over, e.g. "exact 150 px 8 views"."""
        return f"{self.case.group} {side_px(self.case)} px {self.views} views"

    @property
    def name(self) -> str:
        """Return what a person selects by."""
        return f"{self.case.name} {side_px(self.case)} px {self.views} views {self.method}"

    @property
    def identity(self) -> dict[str, Any]:
        """Return all that a result depends on, as plain data; the code aside."""
        way = self.way
        options = None if way.options is None else asdict(way.options)
        found = {"name": self.name, "seed": self.seed, "options": options, "palette": way.palette}
        found |= {} if way.share is None else {"share": way.share}
        return found | ({} if way.field is None else {"field": way.field.__name__})


def plan(cases: Iterable[TrainCase], seed: int, only: str, scope: Scope) -> list[Job]:
    """Return the jobs, what tells most first: a stopped run has filled the most of its tables.

    Every seed begins when all cases have the one before; small pictures and many views go first.

    Args:
        cases: with all their views; several sizes of one case are several cases.
        seed: the first.
        only: keep jobs whose name contains this.
        scope: which of all possible jobs.
    """
    cases = list(cases)
    first = _first_of_groups(cases)
    if scope.one_case:
        cases = first
    jobs = [
        Job(case, views, method, seed + number)
        for number in range(scope.seeds)
        for case in cases
        for fewer, views in enumerate(view_counts(case, scope.views))
        for method in scope.methods
        if (case in first or not METHODS[method].slow)
        and _wanted(METHODS[method], case, number, fewer)
    ]
    order = list(METHODS)
    jobs.sort(key=lambda j: (j.seed, side_px(j.case), -j.views, order.index(j.method)))
    return [job for job in jobs if only in job.name]


def _wanted(method: Method, case: TrainCase, number: int, fewer: int) -> bool:
    if method.palette == "hand-picked palette" and case.train.palette is None:
        return False
    return (number == 0 or method.seeds) and (fewer == 0 or method.fewer)


def view_counts(case: TrainCase, wanted: Sequence[int]) -> list[int]:
    """Return how many views are trained on; a case with fewer than 8 has all of its own first."""
    have = len(case.train.frames)
    return sorted({min(count, have) for count in wanted}, reverse=True)


def subset(case: TrainCase, views: int) -> TrainCase:
    """Return the case with so many training views, evenly taken from the first on."""
    frames = case.train.frames
    kept = tuple(frames[round(i * len(frames) / views)] for i in range(views))
    return replace(case, train=replace(case.train, frames=kept))


def side_px(case: TrainCase) -> int:
    """Return the longest side of the held-out pictures."""
    return max(max(frame.camera.size_wh) for frame in case.test.frames)


def _first_of_groups(cases: Iterable[TrainCase]) -> list[TrainCase]:
    found: dict[tuple[str, int], TrainCase] = {}
    for case in cases:
        found.setdefault((case.group, side_px(case)), case)
    return list(found.values())
