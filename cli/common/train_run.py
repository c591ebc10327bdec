"""Run `toonset train` from reading the bundle to writing the run."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toonset.cli.common.host import keep_freed_memory
from toonset.cli.common.output import Printer
from toonset.cli.common.train_summary import summary
from toonset.cli.common.train_watch import Stopper, TrainPrinter
from toonset.nerf.options import TrainOptions
from toonset.write import check_output

DOUBTFUL = 3  # exit code: written, but weak (--strict), or training was cut short
FINE = ("steps", "budget")  # why a training may end
PREVIEWS = ("preview.png", ".*.tmp")  # in RUN.unfinished


@dataclass(frozen=True)
class Request:
    """One training as asked for.

    Attributes:
        bundle: what to train on.
        test: held-out views; None: none.
        run: the folder to write.
        options: of training.
        threads: of the CPU; None: the usual number.
        preview_every: seconds; None: no previews.
        force: replace an earlier run.
        palette: train labels, too.
        strict: a weak run is doubtful.
    """

    bundle: Path
    test: Path | None
    run: Path
    options: TrainOptions
    threads: int | None
    preview_every: float | None
    force: bool
    palette: bool
    strict: bool

    @property
    def previews(self) -> Path:
        """Return the folder of previews, which is there until the run is."""
        return self.run.with_name(f"{self.run.name}.unfinished")


def run(request: Request, printer: Printer) -> int:
    """Train, write the run and print the result; return the exit code."""
    from toonset.dataset.bundle.bundle import failed_cameras
    from toonset.dataset.bundle.read_scene import read_scene
    from toonset.nerf.run.folder import WRITTEN
    from toonset.nerf.run.monitor import INTERRUPTED, MonitorOptions
    from toonset.nerf.training import train

    scene = read_scene(request.bundle)
    test = None if request.test is None else read_scene(request.test)
    inputs = [request.bundle, request.test]
    check_output(request.run, inputs, WRITTEN, force=request.force)
    if request.preview_every is not None:
        check_output(request.previews, inputs, PREVIEWS, force=True)
    keep_freed_memory()
    stopper = Stopper(printer)
    looking = MonitorOptions(
        TrainPrinter(printer).tell, stopper, test, request.previews, request.preview_every
    )
    with stopper.listening():
        found = train(
            scene,
            request.options,
            palette=request.palette,
            threads=request.threads,
            test=test,
            listener=printer,
            looking=looking,
        )
    metrics = found.save(request.run, force=request.force)
    if request.preview_every is not None:
        shutil.rmtree(request.previews, ignore_errors=True)
    printer.result({"run": request.run, **metrics}, summary(request.run, metrics, printer.verbose))
    stopped = found.training.stopped
    doubts = _doubts(metrics, stopped)
    if failed := failed_cameras(request.bundle):
        doubts.insert(0, failed)
    for doubt in doubts:
        printer.doubt(f"{request.run}: {doubt}")
    if stopped == INTERRUPTED:
        return stopper.exit_code
    doubtful = stopped not in FINE or (request.strict and bool(doubts))
    return DOUBTFUL if doubtful else 0


def _doubts(metrics: Mapping[str, Any], stopped: str) -> list[str]:
    """Return what speaks against a run, a line each."""
    from toonset.nerf.run.monitor import INTERRUPTED

    doubts = [f"weak: {reason}" for reason in metrics["verdict"]["reasons"]]
    if stopped == INTERRUPTED:
        doubts.append(f"stopped after step {metrics['steps']} of {metrics['steps_asked']}")
    elif stopped not in FINE:
        doubts.append(f"training stopped early: {stopped}")
    return doubts
