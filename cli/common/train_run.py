"""One training as the command line asks for it, from reading the bundle to the files of the run."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toonset.cli.common.host import keep_freed_memory, threads_of
from toonset.cli.common.output import Printer
from toonset.cli.common.train_place import Place
from toonset.cli.common.train_summary import summary
from toonset.cli.common.train_watch import Stopper, Voice
from toonset.errors import BundleError

if TYPE_CHECKING:
    from toonset.nerf.options import TrainOptions
    from toonset.nerf.run.checkpoint import Checkpoint
    from toonset.nerf.training import Run

DOUBTFUL = 3  # exit code: written, but weak (--strict), or training was cut short
FINE = ("steps", "budget")  # why a training may end
RESUMED_AS = {"steps": "--steps", "budget_s": "--budget", "device": "--device", "seed": "--seed"}
RESUMED_AS |= {
    "fair": "--as-carved",
    "register": "--as-placed",
    "turn": "--as-turned",
    "unbend": "--as-bent",
    "symmetric": "--one-sided",
    "mannequin": "--no-mannequin",
    "ink": "--ink",
}
RESUMED_AS |= {"field": "--field", "carve": "--preset", "smoothness": "--preset"}


@dataclass(frozen=True)
class Request:
    """What was asked for.

    Attributes:
        bundle: what to train on.
        test: held-out views; None: none.
        place: where to write.
        options: of training, those that were given.
        threads: "auto" or a number.
        preview_every: seconds; None: no previews.
        palette: train labels, too.
        resume: go on with an unfinished training.
        strict: a weak run is doubtful.
    """

    bundle: Path
    test: Path | None
    place: Place
    options: dict[str, Any]
    threads: str
    preview_every: float | None
    palette: bool
    resume: bool
    strict: bool

    @property
    def again(self) -> str:
        """Return the command that goes on with this training."""
        words = ["toonset", "train", str(self.bundle), "-o", str(self.place.run), "--resume"]
        return shlex.join([*words, *(["--force"] if self.place.force else [])])


def run(request: Request, printer: Printer) -> int:
    """Train, write the run and print the result; return the exit code."""
    from toonset.dataset.bundle.read_scene import read_scene
    from toonset.nerf.run.monitor import Looking
    from toonset.nerf.training import train

    place = request.place
    scene = read_scene(request.bundle)
    test = None if request.test is None else read_scene(request.test)
    place.check([request.bundle, request.test], resume=request.resume)
    checkpoint = place.checkpoint() if request.resume else None
    options = _options(request, checkpoint)
    if checkpoint is None:
        place.clear()
    keep_freed_memory()
    stopper = Stopper(printer)
    tell = Voice(printer).tell
    looking = Looking(tell, stopper, test, place.unfinished, request.preview_every)
    with stopper.listening():
        found = train(
            scene,
            options,
            palette=request.palette if checkpoint is None else checkpoint.record.with_palette,
            threads=_threads(request, checkpoint),
            test=test,
            listener=printer,
            looking=looking,
            resume=checkpoint,
        )
    if stopper.signal and found.training.stopped == "interrupted":
        _leave(request, found, printer)
        return stopper.exit_code
    metrics = found.save(place.run, force=place.force)
    place.clear()
    printer.result({"run": place.run, **metrics}, summary(place.run, metrics, printer.verbose))
    doubts = [f"weak: {reason}" for reason in metrics["verdict"]["reasons"]]
    doubtful = request.strict and bool(doubts)
    if found.training.stopped not in FINE:
        doubts.append(f"training stopped early: {found.training.stopped}")
        doubtful = True
    for doubt in doubts:
        printer.doubt(f"{place.run}: {doubt}")
    return DOUBTFUL if doubtful else 0


def _threads(request: Request, checkpoint: Checkpoint | None) -> int:
    return threads_of(request.threads) if checkpoint is None else checkpoint.record.threads


def _options(request: Request, checkpoint: Checkpoint | None) -> TrainOptions:
    """Return the training's options: an unfinished one has settled them.

    Raises:
        BundleError: the command line asks for others.
    """
    from toonset.nerf.options import TrainOptions

    given = {name: value for name, value in request.options.items() if value is not None}
    if checkpoint is None:
        return TrainOptions(**given)
    defaults, settled = asdict(TrainOptions()), asdict(checkpoint.options)
    for name, value in given.items():
        if value not in (defaults[name], settled[name]):
            flag = RESUMED_AS.get(name, name)
            raise BundleError(
                f"{request.place.unfinished}: was begun with {flag} {settled[name]}, not {value}; "
                f"leave {flag} out, or train anew with --force instead of --resume"
            )
    return checkpoint.options


def _leave(request: Request, found: Run, printer: Printer) -> None:
    """Keep what there is of an interrupted training and say how to go on."""
    from toonset.nerf.run.report import write_unfinished

    folder = request.place.unfinished
    write_unfinished(folder, found.training, found.scene, found.held_out)
    done, of = len(found.training.history), found.training.options.steps
    printer.doubt(
        f"stopped after step {done} of {of}; {folder} can be rendered as it is\n"
        f"go on with: {request.again}"
    )
