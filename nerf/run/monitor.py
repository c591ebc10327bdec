"""Monitor a training: held-out views, previews, a request to stop.

Looking at held-out views may take a tenth of the time, so a cheap look comes often and an expensive
one seldom. None of it changes the training by a bit.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.images.picture import encode_png
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.layers import color_picture
from toonset.nerf.render.views import render
from toonset.nerf.run.report import preview
from toonset.nerf.score.metrics import psnr_of
from toonset.nerf.train.loop import Moment
from toonset.nerf.train.loss import Model
from toonset.nerf.train.progress import Status, status_of
from toonset.nerf.train.result import HeldOut
from toonset.view import over_white
from toonset.write import write_bytes

SHARE = 0.1  # of the training's seconds that looking at held-out views may take
MOST_VIEWS, MOST_PX = 4, 200  # held-out views looked at in between, and their longest side
FIRST_LOOK_S = 2.0  # of training: before, there is nothing to see
INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class MonitorOptions:
    """Options of the monitor.

    Attributes:
        tell: called with the status after every step.
        stop: whether somebody wants the training to end.
        test: held-out views; None: none.
        folder: where previews go; made with the first of them.
        preview_every_s: seconds of training between previews; None: none.
    """

    tell: Callable[[Status], None] = lambda status: None
    stop: Callable[[], bool] = lambda: False
    test: Scene | None = None
    folder: Path | None = None
    preview_every_s: float | None = None


@dataclass
class Monitor:
    """A `Watch` that does what a `MonitorOptions` asks for.

    Attributes:
        looking: what to look at.
        held_out: what was seen of held-out views.
    """

    looking: MonitorOptions
    held_out: list[HeldOut] = field(default_factory=list)

    def begin(self, trained: TrainedField) -> None:
        """Take the field that will be fitted."""
        self._trained = trained
        self._views = [] if self.looking.test is None else sample_of(self.looking.test)
        self._test_at, self._preview_at = FIRST_LOOK_S, 0.0

    def look(self, moment: Moment) -> str:
        """Look at a training after a step; return why it should end, or None."""
        spent = moment.history[-1].seconds
        unfinished = len(moment.history) < moment.of
        if self.looking.stop() and unfinished:
            return INTERRUPTED
        if self._views and spent >= self._test_at:
            took = self._look_at_held_out(moment)
            self._test_at = spent + took / SHARE
        every = self.looking.preview_every_s
        if every is not None and spent - self._preview_at >= every:
            self._show(moment)
        seen = self.held_out[-1] if self.held_out else None
        self.looking.tell(status_of(moment, seen))
        return ""

    def _show(self, moment: Moment) -> None:
        self._preview_at = moment.history[-1].seconds
        if self.looking.folder is not None:
            picture = encode_png(preview(self._shown()))
            write_bytes(self.looking.folder / "preview.png", picture)

    def _look_at_held_out(self, moment: Moment) -> float:
        """Note how near held-out views are; return the seconds that it took."""
        began = time.perf_counter()
        psnr = held_out_psnr(self._shown(), self._views)
        last = moment.history[-1]
        self.held_out.append(HeldOut(last.step + 1, last.seconds, psnr))
        return time.perf_counter() - began

    def _shown(self) -> TrainedField:
        """Return a copy on the CPU: what a renderer keeps of it must not outlive the step."""
        there = copy.deepcopy(Model(self._trained.field, self._trained.classifier)).to("cpu")
        return replace(self._trained, field=there.field, classifier=there.classifier)


def sample_of(test: Scene) -> list[Frame]:
    """Return a few of the held-out views, evenly chosen, none larger than `MOST_PX`."""
    count = min(MOST_VIEWS, len(test.frames))
    chosen = [test.frames[i * len(test.frames) // count] for i in range(count)]
    return [_smaller(frame) for frame in chosen]


def held_out_psnr(trained: TrainedField, views: list[Frame]) -> float:
    """Return the mean PSNR of views over white, dB."""
    found = []
    for frame in views:
        view = render(trained, frame.camera)
        error = over_white(color_picture(view.rgb, view.alpha)) - over_white(frame.rgba)
        found.append(psnr_of(float((error**2).mean())))
    return float(np.mean(found))


def _smaller(frame: Frame) -> Frame:
    """Return a frame with whole blocks of pixels averaged until it is small enough."""
    width, height = frame.camera.size_wh
    block = -(-max(width, height) // MOST_PX)
    if block == 1 or min(width, height) < block:
        return frame
    columns, rows = width // block, height // block
    cut = frame.rgba[: rows * block, : columns * block].astype(np.float64)
    color = cut[..., :3] * cut[..., 3:] / 255
    parts = np.concatenate([color, cut[..., 3:]], axis=-1)
    mean = parts.reshape(rows, block, columns, block, 4).mean(axis=(1, 3))
    mean[..., :3] *= 255 / np.maximum(mean[..., 3:], 1e-9)
    camera = frame.camera
    camera = replace(
        camera, scale=camera.scale / block, center=camera.center / block, size_wh=(columns, rows)
    )
    return Frame(frame.name, camera, (mean + 0.5).clip(0, 255).astype(np.uint8))
