"""One training as the command line asks for it, from reading the bundle to the files of the run."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toonset.cli.common.output import Printer
from toonset.cli.common.train_place import Place
from toonset.cli.common.train_printer import Voice
from toonset.cli.common.train_stop import Stopper
from toonset.cli.common.train_summary import summary
from toonset.cli.common.train_threads import threads_of
from toonset.errors import BundleError

if TYPE_CHECKING:
    from toonset.dataset.bundle.scene import Scene
    from toonset.nerf.options import TrainOptions
    from toonset.nerf.run.checkpoint import Checkpoint
    from toonset.nerf.run.monitor import Onlooker
    from toonset.nerf.train.result import Training

DOUBTFUL = 3  # exit code: written, but weak, or training went wrong and was cut short
FINE = ("steps", "budget")  # why a training may end
RESUMED_AS = {"steps": "--steps", "budget_s": "--budget", "device": "--device", "seed": "--seed"}
RESUMED_AS |= {
    "fair": "--as-carved",
    "register": "--as-placed",
    "turn": "--as-turned",
    "unbend": "--as-bent",
    "symmetric": "--one-sided",
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
    """

    bundle: Path
    test: Path | None
    place: Place
    options: dict[str, Any]
    threads: str
    preview_every: float | None
    palette: bool
    resume: bool

    @property
    def again(self) -> str:
        """Return the command that goes on with this training."""
        words = ["toonset", "train", str(self.bundle), "-o", str(self.place.run), "--resume"]
        return shlex.join([*words, *(["--force"] if self.place.force else [])])


def run(request: Request, printer: Printer) -> int:
    """Train, write the run and print the result; return the exit code."""
    from toonset.dataset.bundle.transforms import read_scene
    from toonset.dataset.silhouettes.mask import check_cut_out, has_figure
    from toonset.nerf.prepare.symmetry import with_all_mirrored
    from toonset.nerf.prepare.view_coverage import guesses

    place = request.place
    place.check([request.bundle, request.test], resume=request.resume)
    checkpoint = place.checkpoint() if request.resume else None
    options = _options(request, checkpoint)
    scene = read_scene(request.bundle)
    check_cut_out(scene)  # as `train` does, but before a background's colours are a palette
    for frame in scene.frames:
        if not has_figure(frame):
            printer.say(f"{frame.name} shows no figure")
    held_out = None if request.test is None else read_scene(request.test)
    scene = _prepared(scene, request, options, checkpoint, printer)
    stopper = Stopper(printer)
    onlooker = _onlooker(request, scene, options, held_out, Voice(printer), stopper)
    if checkpoint is None:
        place.clear()
    else:
        _go_on(onlooker, checkpoint, place, printer)
    for guess in guesses(with_all_mirrored(scene) if options.symmetric else scene):
        printer.say(guess)
    training = _fitted(scene, options, onlooker, stopper, printer)
    if stopper.signal and training.stopped == "interrupted":
        _leave(request, training, onlooker, printer)
        return stopper.exit_code
    metrics = _write(place, training, onlooker)
    printer.result({"run": place.run, **metrics}, summary(place.run, metrics))
    doubts = [f"weak: {reason}" for reason in metrics["verdict"]["reasons"]]
    if training.stopped not in FINE:
        doubts.append(f"training stopped early: {training.stopped}")
    for doubt in doubts:
        printer.doubt(f"{place.run}: {doubt}")
    return DOUBTFUL if doubts else 0


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


def _prepared(
    scene: Scene,
    request: Request,
    options: TrainOptions,
    checkpoint: Checkpoint | None,
    printer: Printer,
) -> Scene:
    """Set torch up and return the scene with what is trained."""
    from toonset.nerf.kernels.threads import SIDES, use_threads
    from toonset.nerf.train.memory import check_memory
    from toonset.nerf.train.train import device_of

    device = device_of(options.device)  # refused before anything is computed or said
    asked = request.threads if checkpoint is None else str(checkpoint.record.threads)
    count = threads_of(asked)
    use_threads(count, SIDES)
    printer.say(f"{check_memory(scene, options, device)}; {count} CPU thread{'s' * (count > 1)}")
    palette = request.palette if checkpoint is None else checkpoint.record.with_palette
    return _with_palette(scene, palette, printer)


def _with_palette(scene: Scene, palette: bool, printer: Printer) -> Scene:
    from toonset.nerf.train.labelling import labelled, without_palette
    from toonset.palette.names import hex_of

    if not palette:
        return without_palette(scene)
    if scene.palette is not None and any(frame.labels is not None for frame in scene.frames):
        return scene
    scene, found = labelled(scene)
    colors = " ".join(hex_of(color.rgb) for color in found.colors)
    printer.say(f"palette, extracted: {colors}")
    for warning in found.warnings:
        printer.say(f"palette: {warning}")
    return scene


def _onlooker(
    request: Request,
    scene: Scene,
    options: TrainOptions,
    held_out: Scene | None,
    voice: Voice,
    stop: Callable[[], bool],
) -> Onlooker:
    from toonset.nerf.run.monitor import Looking, Onlooker

    folder, every = request.place.unfinished, request.preview_every
    return Onlooker(Looking(voice.tell, stop, held_out, folder, every), scene, options)


def _go_on(onlooker: Onlooker, checkpoint: Checkpoint, place: Place, printer: Printer) -> None:
    """Let a training begin where its checkpoint stands.

    Raises:
        BundleError: the checkpoint is of another scene.
    """
    from toonset.nerf.run.checkpoint import check_scene, versions

    check_scene(checkpoint, onlooker.scene, place.unfinished)
    onlooker.start = checkpoint.state
    printer.say(f"going on after step {checkpoint.state.steps} of {checkpoint.options.steps}")
    if checkpoint.record.versions != versions():
        was = ", ".join(f"{name} {number}" for name, number in checkpoint.record.versions.items())
        printer.say(f"begun with {was}: the last digits may differ from an unbroken training's")


def _fitted(
    scene: Scene, options: TrainOptions, onlooker: Onlooker, stopper: Stopper, printer: Printer
) -> Training:
    """Return the training, as far as it went."""
    from toonset.nerf.train.memory import memory_errors
    from toonset.nerf.train.train import train

    with stopper.listening(), memory_errors():
        return train(scene, options, printer.progress, onlooker)


def _leave(request: Request, training: Training, onlooker: Onlooker, printer: Printer) -> None:
    """Keep what there is of an interrupted training and say how to go on."""
    from toonset.nerf.run.report import write_unfinished

    folder = request.place.unfinished
    write_unfinished(folder, training, onlooker.scene, onlooker.held_out)
    done, of = len(training.history), training.options.steps
    printer.doubt(
        f"stopped after step {done} of {of}; {folder} can be rendered as it is\n"
        f"go on with: {request.again}"
    )


def _write(place: Place, training: Training, onlooker: Onlooker) -> dict[str, Any]:
    """Write the finished run; return the content of metrics.json."""
    from toonset.nerf.run.report import write_run
    from toonset.nerf.train.memory import memory_errors
    from toonset.write import new_folder

    with new_folder(place.run, force=place.force) as folder, memory_errors():
        test = onlooker.looking.test
        metrics = write_run(folder, training, onlooker.scene, test, onlooker.held_out)
    place.clear()
    return metrics
