"""What a training bench runs: cases, subsets of their views, methods, seeds, and in which order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

from bench.cases.cases import TrainCase
from bench.charts.chart import DEFAULT
from bench.train.mlp import network
from bench.train.painted_hull import painted
from bench.train.peers import Peer
from bench.train.voxel import voxels
from toonset.nerf.options import TrainOptions, paper
from toonset.nerf.train.train import FieldOf

NEAREST = "nearest drawing"
MANNEQUIN = "coloured mannequin"
Preparation = Literal["alignment", "symmetry"]
PREPARATIONS: tuple[Preparation, ...] = get_args(Preparation)
PaletteChoice = Literal["no palette", "automatic palette", "hand-picked palette"]
PALETTES: tuple[PaletteChoice, ...] = get_args(PaletteChoice)
PAPER_STEPS = (200, 2000)
PLANES = {"finest planes": 1.0, "planes of 2/3": 2 / 3, "planes of 1/3": 1 / 3}  # of its cells
TURN, HALF_TURN = 8, " half turn"  # views of a whole one; ends the groups of the others


@dataclass(frozen=True)
class Method:
    """One way to predict a view.

    Attributes:
        options: of training, the seed aside; None: no training, the nearest drawing is shown.
        palette: that of the labels: none, one extracted in the seconds that count, or the one that
            the case comes with.
        first_seed_only: so slow, or so little random, that one seed must do.
        most_views_only: there to show what time buys, which fewer views need not repeat.
        leaves_out: the step that it goes without, if any. Where that had nothing to do in
            "default", this is the same training, and is not run a second time.
        curve: held-out PSNR is followed while it trains, with the most views.
        share: cells of the planes, of the finest that the scene could have; None: as `options` say.
        mannequin: no training either; the case's mannequin, where there is one, is fitted to the
            outlines and shown in the drawings' colours.
        field: returns what is fitted; None: planes.
    """

    options: TrainOptions | None
    palette: PaletteChoice = "automatic palette"
    first_seed_only: bool = False
    most_views_only: bool = False
    leaves_out: Preparation | None = None
    curve: bool = False
    share: float | None = None
    mannequin: bool = False
    field: FieldOf | None = None


def _without(
    step: Preparation | None = None, palette: PaletteChoice = "automatic palette", **changes: Any
) -> Method:
    return Method(TrainOptions(**changes), palette, first_seed_only=True, leaves_out=step)


PAPER: dict[str, Method] = {
    f"paper, {palette}, {steps} steps": Method(
        paper(steps), palette, first_seed_only=True, most_views_only=True, curve=True
    )
    for palette in PALETTES
    for steps in PAPER_STEPS
}
METHODS: dict[str, Method] = {
    DEFAULT: Method(TrainOptions(), curve=True),
    NEAREST: Method(None, first_seed_only=True),
    MANNEQUIN: Method(None, first_seed_only=True, mannequin=True),
    "coloured hull": Method(
        TrainOptions(steps=0), "no palette", first_seed_only=True, field=painted
    ),
    **{
        f"{steps} steps": Method(
            TrainOptions(steps=steps), first_seed_only=True, most_views_only=True
        )
        for steps in (30, 75, 600)
    },
    **{
        name: Method(TrainOptions(field="triplane"), first_seed_only=True, share=share)
        for name, share in PLANES.items()
    },
    "without palette": _without(palette="no palette"),
    "without smoothing": _without(smoothness=0.0),
    "without fairing": _without(fair=False),
    "without registration": _without("alignment", register=False),
    "without unbending": _without("alignment", unbend=False),
    "without both": _without("alignment", register=False, unbend=False),
    "without symmetry": _without("symmetry", symmetric=False),
    "without hull": Method(TrainOptions(carve=False), first_seed_only=True, most_views_only=True),
    "voxel": Method(TrainOptions(), first_seed_only=True, curve=True, field=voxels),
    "mlp": Method(TrainOptions(), first_seed_only=True, curve=True, field=network),
    **PAPER,
    "paper, mlp": Method(paper(2000), first_seed_only=True, most_views_only=True, field=network),
}
OF_PEERS = Method(None, first_seed_only=True, most_views_only=True)
FOR_THE_TABLE_ALONE = [name for name in PAPER if PAPER[name].palette != "automatic palette"]
SLOW = ("without hull", "mlp", "paper, mlp", *PAPER)


@dataclass(frozen=True)
class Scope:
    """What a bench runs.

    Attributes:
        methods: names in `METHODS`.
        views: numbers of training views.
        seeds: how many.
        half_turn: methods also of front, side and back alone, where there are eight views.
        first_case: methods so slow that one case per condition and size must do.
        one_case: so for all methods.
    """

    methods: tuple[str, ...]
    views: tuple[int, ...] = (8,)
    seeds: int = 1
    half_turn: tuple[str, ...] = ()
    first_case: tuple[str, ...] = ()
    one_case: bool = False


SCOPES = {  # by subject and whether it must be quick
    ("train", False): Scope(
        tuple(name for name in METHODS if name not in FOR_THE_TABLE_ALONE),
        views=(8, 4, 3),
        seeds=3,
        half_turn=(DEFAULT, NEAREST, MANNEQUIN, "coloured hull", "without symmetry", "voxel"),
        first_case=SLOW,
    ),
    ("train", True): Scope((DEFAULT, NEAREST, "coloured hull", "75 steps"), one_case=True),
}


@dataclass(frozen=True, eq=False)
class Job:
    """One training and its figures.

    Attributes:
        case: all views; held-out ones are for the figures alone.
        views: how many of the case's views are trained on.
        method: name in `METHODS`, or the peer's.
        seed: of everything random.
        followed: held-out PSNR may be followed while it trains; what is found does not depend on
            it.
        peer: the other program that is run; None: none is.
    """

    case: TrainCase
    views: int
    method: str
    seed: int
    followed: bool = True
    peer: Peer | None = None

    @property
    def way(self) -> Method:
        """Return how views are predicted."""
        return METHODS[self.method] if self.peer is None else OF_PEERS

    @property
    def curve(self) -> bool:
        """Return whether held-out PSNR is followed while it trains."""
        most_views = self.views == len(self.case.train.frames)
        return self.followed and self.way.curve and most_views

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
        method = self.way
        options = None if method.options is None else asdict(method.options)
        found = {
            "name": self.name,
            "seed": self.seed,
            "options": options,
            "palette": method.palette,
        }
        found |= {} if method.share is None else {"share": method.share}
        found |= {} if method.field is None else {"field": method.field.__name__}
        return found if self.peer is None else found | {"peer": self.peer.command}


def plan(
    cases: Iterable[TrainCase], seed: int, only: str, scope: Scope, peers: Sequence[Peer] = ()
) -> list[Job]:
    """Return the jobs, what tells most first: a stopped run has filled the most of its tables.

    Every seed begins when all cases have the one before; small pictures and many views go first.

    Args:
        cases: with all their views; several sizes of one case are several cases.
        seed: the first.
        only: keep jobs whose name contains this.
        scope: which of all possible jobs.
        peers: run with the most views of every case, after the methods.
    """
    cases = list(cases)
    first = _first_of_groups(cases)
    if scope.one_case:
        cases = first
    groups = [(case, scope.methods) for case in cases]
    if scope.half_turn:
        whole = [case for case in cases if len(case.train.frames) == TURN]
        groups += [(front_side_back(case), scope.half_turn) for case in whole]
    jobs = [
        Job(case, views, method, seed + number)
        for number in range(scope.seeds)
        for case, methods in groups
        for fewer, views in enumerate(view_counts(case, scope.views))
        for method in methods
        if (case in first or method not in scope.first_case)
        and _wanted(METHODS[method], case, number, fewer)
    ]
    jobs += [
        Job(case, view_counts(case, scope.views)[0], peer.name, seed, peer=peer)
        for case in cases
        for peer in peers
    ]
    order = [*METHODS, *(peer.name for peer in peers)]
    jobs.sort(key=lambda j: (j.seed, side_px(j.case), -j.views, order.index(j.method)))
    return [job for job in jobs if only in job.name]


def _wanted(method: Method, case: TrainCase, number: int, fewer: int) -> bool:
    if method.palette == "hand-picked palette" and case.train.palette is None:
        return False
    if method.mannequin and case.mannequin is None:
        return False
    if number > 0 and method.first_seed_only:
        return False
    return fewer == 0 or not method.most_views_only


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
