"""Train a run on a scene: everything `toonset train` does between reading and writing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from jaxtyping import Float
from threadpoolctl import threadpool_limits

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import check_cut_out, has_figure
from toonset.errors import UsageError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.kernels.threads import working_threads
from toonset.nerf.look.build import drawings_of
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.symmetry import add_mirrored_views, differences, find_symmetry
from toonset.nerf.prepare.view_coverage import guesses
from toonset.nerf.render.views import baked_of, keep, render
from toonset.nerf.run.folder import WRITTEN
from toonset.nerf.run.monitor import Monitor, MonitorOptions
from toonset.nerf.run.report import preview, write_run
from toonset.nerf.train.fit_field import device_of, fit_field
from toonset.nerf.train.labelling import drop_palette, label_scene
from toonset.nerf.train.result import HeldOut, Training
from toonset.palette.names import hex_of
from toonset.view import small_png
from toonset.write import check_output, new_folder

PREVIEW_PX = 960  # wide, in a notebook
OUT_OF_MEMORY = ("can't allocate memory", "out of memory", "not enough memory")


class Listener(Protocol):
    """Who is told how a training goes; a command's printer is one."""

    def say(self, text: str) -> None:
        """Take what a person should know."""

    def detail(self, text: str) -> None:
        """Take what is evidence."""

    def progress(self, text: str) -> None:
        """Take where the work stands."""


class _Silence:
    """A listener that ignores everything."""

    def say(self, text: str) -> None:
        pass

    detail = progress = say


@dataclass(frozen=True, eq=False)
class Run:
    """A trained field and how it came about.

    Attributes:
        field: what `render`, `turntable`, `evaluate` and `surface_of` take.
        training: history, evidence, seconds, counts.
        scene: what was trained on, with the palette that was found.
        test: held-out views; None: none.
        held_out: what was seen of them on the way.
        threads: that worked.
    """

    field: TrainedField
    training: Training
    scene: Scene
    test: Scene | None
    held_out: Sequence[HeldOut]
    threads: int

    def _repr_png_(self) -> bytes:
        """Return four views side by side, for a notebook."""
        with working_threads(self.threads), _memory_errors():
            shown = preview(baked_of(self.field))
        return small_png(np.dstack([shown, np.full(shown.shape[:2], 255, np.uint8)]), PREVIEW_PX)

    def save(self, folder: str | Path, *, force: bool = False) -> dict[str, Any]:
        """Write a run folder, whole or not at all; return the content of its metrics.json.

        Raises:
            OutputError: the folder exists and `force` is off or it holds what no run does, or it
                cannot be written.
        """
        check_output(Path(folder), [], WRITTEN, force=force)
        with (
            new_folder(Path(folder), force=force) as place,
            working_threads(self.threads),
            _memory_errors(),
        ):
            return write_run(place, self.training, self.scene, self.test, self.held_out)


def train(
    scene: Scene,
    options: TrainOptions = TrainOptions(),
    *,
    palette: bool = True,
    threads: int | None = None,
    test: Scene | None = None,
    listener: Listener | None = None,
    looking: MonitorOptions | None = None,
) -> Run:
    """Return a radiance field, and a classifier from its colours to the palette's.

    Torch's threads and random numbers are afterwards as they were; they are the process's own, so
    make one such call at a time. On a CPU the same scene,
    options and threads give the same bits, unless `options.budget_s` ends the training.

    Args:
        scene: posed drawings, as `read_bundle` or `write_bundle` returns them.
        options: of the training.
        palette: train labels, too; a palette is extracted where the scene has none.
        threads: of the CPU; None: two, or one if torch is set to use no more.
        test: held-out views to score.
        listener: told what a person should know, evidence, and where the work stands.
        looking: what is looked at while the field is fitted: previews, a wish to stop.

    Raises:
        ToonsetError: fewer than two usable views, a picture that is opaque all over, cameras that
            do not belong to the pictures.
        UsageError: an option or a number of threads that means nothing.
        MemoryError: torch found no more.
        SetupError: a GPU was asked for and there is none.
    """
    options.check()
    if not isinstance(palette, bool):
        raise UsageError("palette: True or False is needed; a bundle's own palette is used")
    if threads is not None and threads < 1:
        raise UsageError(f"threads: {threads}; 1 or more are needed")
    told = listener or _Silence()
    check_cut_out(scene)  # before a background's colours are a palette
    for frame in scene.frames:
        if not has_figure(frame):
            told.say(f"{frame.name} shows no figure")
    device_of(options.device)  # refused before anything is computed or said
    with (
        working_threads(threads) as count,
        threadpool_limits(1, user_api="blas"),
        _own_random_numbers(),
        _memory_errors(),
    ):
        told.detail(f"{count} CPU thread{'s' * (count > 1)}")
        scene = _with_palette(scene, told) if palette else drop_palette(scene)
        monitor = Monitor(looking or MonitorOptions(test=test))
        asked = options.symmetric or scene.symmetric
        for guess in guesses(add_mirrored_views(scene, find_symmetry(scene, asked))):
            told.say(guess)
        training = fit_field(scene, options, told.progress, monitor)
        told.progress("laying the drawings over the field")
        training = replace(training, result=add_drawings(training, scene))
    return Run(training.result, training, scene, test, monitor.held_out, count)


def add_drawings(training: Training, scene: Scene) -> TrainedField:
    """Add the drawings of the drawn look to a field."""
    ready, baked = training.prepared, baked_of(training.result)

    def depth_of(camera: Camera) -> Float[np.ndarray, "height width"]:
        return render(baked, camera).depth

    seen, drawn = training.seen, add_mirrored_views(scene, training.symmetry)
    found = drawings_of(
        seen, drawn, depth_of, ready.shape, differences(seen), training.result.hull, bent=ready.bent
    )
    result = replace(training.result, drawings=found)
    keep(result, baked)
    return result


def _with_palette(scene: Scene, told: Listener) -> Scene:
    """Return the scene with a palette, its own where it has one."""
    if scene.palette is not None and any(frame.labels is not None for frame in scene.frames):
        return scene
    scene, found = label_scene(scene)
    told.say(f"palette, extracted: {' '.join(hex_of(color.rgb) for color in found.colors)}")
    for warning in found.warnings:
        told.say(f"palette: {warning}")
    return scene


@contextmanager
def _own_random_numbers() -> Iterator[None]:
    """Leave torch's random numbers as they were."""
    state = torch.get_rng_state()
    try:
        yield
    finally:
        torch.set_rng_state(state)


@contextmanager
def _memory_errors() -> Iterator[None]:
    """Turn torch's ways to say that memory ran out into a `MemoryError` of one line."""
    try:
        yield
    except RuntimeError as error:
        message = str(error)
        if not isinstance(error, torch.OutOfMemoryError) and not any(
            words in message for words in OUT_OF_MEMORY
        ):
            raise
        where = "the GPU" if isinstance(error, torch.OutOfMemoryError) else "this machine"
        raise MemoryError(f"training asked for more than {where} has") from error
