"""What a training bench runs: cases, subsets of their views, methods, seeds, and in which order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

from toonset.bench.cases import TrainCase
from toonset.nerf.options import TrainOptions
from toonset.nerf.preset import paper

NEAREST = "nearest drawing"
PaletteChoice = Literal["no palette", "automatic palette", "hand-picked palette"]
PALETTES: tuple[PaletteChoice, ...] = get_args(PaletteChoice)
PAPER_STEPS = (200, 2000)
TURN, HALF_TURN = 8, " half turn"  # views of a whole one; ends the groups of the others


@dataclass(frozen=True)
class Method:
    """One way to predict a view.

    Attributes:
        options: of training, the seed aside; None: no training, the nearest drawing is shown.
        palette: that of the labels: none, one extracted in the seconds that count, or the one that
            the case comes with.
        first_seed_only: so slow, or so little random, that one seed must do.
    """

    options: TrainOptions | None
    palette: PaletteChoice = "automatic palette"
    first_seed_only: bool = False


PAPER: dict[str, Method] = {
    f"paper, {palette}, {steps} steps": Method(paper(steps), palette, first_seed_only=True)
    for palette in PALETTES
    for steps in PAPER_STEPS
}
METHODS: dict[str, Method] = {
    "default": Method(TrainOptions()),
    NEAREST: Method(None, first_seed_only=True),
    "coloured hull": Method(TrainOptions(field="hull"), "no palette", first_seed_only=True),
    "75 steps": Method(TrainOptions(steps=75)),
    "600 steps": Method(TrainOptions(steps=600)),
    "without palette": Method(TrainOptions(), "no palette"),
    "without smoothing": Method(TrainOptions(smoothness=0.0)),
    "without fairing": Method(TrainOptions(fair=False), first_seed_only=True),
    "without registration": Method(TrainOptions(register=False), first_seed_only=True),
    "without unbending": Method(TrainOptions(unbend=False), first_seed_only=True),
    "without symmetry": Method(TrainOptions(symmetric=False), first_seed_only=True),
    "without hull": Method(TrainOptions(carve=False), first_seed_only=True),
    "voxel": Method(TrainOptions(field="voxel")),
    "mlp": Method(TrainOptions(field="mlp"), first_seed_only=True),
    **PAPER,
    "paper, mlp": Method(replace(paper(2000), field="mlp"), first_seed_only=True),
}
FOR_THE_TABLE_ALONE = [name for name in PAPER if PAPER[name].palette != "automatic palette"]


@dataclass(frozen=True)
class Scope:
    """What a bench runs.

    Attributes:
        methods: names in `METHODS`.
        views: numbers of training views.
        seeds: how many.
        half_turn: also of front, side and back alone, where there are eight views.
        one_case: one per condition and size is enough.
    """

    methods: tuple[str, ...]
    views: tuple[int, ...] = (8,)
    seeds: int = 1
    half_turn: bool = False
    one_case: bool = False


SCOPES = {  # by subject and whether it must be quick
    ("train", False): Scope(
        tuple(name for name in METHODS if name not in FOR_THE_TABLE_ALONE),
        views=(8, 4, 3),
        seeds=3,
        half_turn=True,
    ),
    ("train", True): Scope(("default", NEAREST, "coloured hull", "75 steps"), one_case=True),
    ("paper", False): Scope(("default", *PAPER)),
    ("paper", True): Scope(
        ("default", *(name for name in PAPER if name.endswith(" 200 steps"))), one_case=True
    ),
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
    def group(self) -> str:
        """Return the condition that figures are summarised over, e.g. "exact 150 px 8 views"."""
        return f"{self.case.group} {side_px(self.case)} px {self.views} views"

    @property
    def name(self) -> str:
        """Return what a person selects by."""
        views = f"{self.views} views" + " of a half turn" * self.case.group.endswith(HALF_TURN)
        return f"{self.case.name} {side_px(self.case)} px {views} {self.method}"

    @property
    def identity(self) -> dict[str, Any]:
        """Return all that a result depends on, as plain data; the code aside."""
        method = METHODS[self.method]
        options = None if method.options is None else asdict(method.options)
        return {"name": self.name, "seed": self.seed, "options": options, "palette": method.palette}


def plan(cases: Iterable[TrainCase], seed: int, only: str, scope: Scope) -> list[Job]:
    """Return the jobs, what tells most first: a stopped run has filled the most of its tables.

    Every seed begins when all cases have the one before; small pictures and many views go first.

    Args:
        cases: with all their views; several sizes of one case are several cases.
        seed: the first.
        only: keep jobs whose name contains this.
        scope: which of all possible jobs.
    """
    chosen = _first_of_groups(cases) if scope.one_case else list(cases)
    if scope.half_turn:
        chosen += [front_side_back(case) for case in chosen if len(case.train.frames) == TURN]
    jobs = [
        Job(case, views, method, seed + number)
        for number in range(scope.seeds)
        for case in chosen
        for views in view_counts(case, scope.views)
        for method in scope.methods
        if _possible(METHODS[method], case, number)
    ]
    order = list(METHODS)
    jobs.sort(key=lambda j: (j.seed, side_px(j.case), -j.views, order.index(j.method)))
    return [job for job in jobs if only in job.name]


def _possible(method: Method, case: TrainCase, number: int) -> bool:
    if method.palette == "hand-picked palette" and case.train.palette is None:
        return False
    return number == 0 or not method.first_seed_only


def view_counts(case: TrainCase, wanted: Sequence[int]) -> list[int]:
    """Return how many views are trained on; a case with fewer than 8 has all of its own first."""
    have = len(case.train.frames)
    return sorted({min(count, have) for count in wanted}, reverse=True)


def subset(case: TrainCase, views: int) -> TrainCase:
    """Return the case with so many training views, evenly taken from the first on."""
    frames = case.train.frames
    kept = tuple(frames[round(i * len(frames) / views)] for i in range(views))
    return replace(case, train=replace(case.train, frames=kept))


def front_side_back(case: TrainCase) -> TrainCase:
    """Return the case with three of its eight views: half a turn, one side is undrawn."""
    frames = case.train.frames[: TURN // 2 + 1 : TURN // 4]
    train = replace(case.train, frames=frames)
    return replace(case, group=case.group + HALF_TURN, train=train)


def side_px(case: TrainCase) -> int:
    """Return the longest side of the held-out pictures."""
    return max(max(frame.camera.size_wh) for frame in case.test.frames)


def _first_of_groups(cases: Iterable[TrainCase]) -> list[TrainCase]:
    found: dict[tuple[str, int], TrainCase] = {}
    for case in cases:
        found.setdefault((case.group, side_px(case)), case)
    return list(found.values())
