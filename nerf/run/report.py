"""Write a run's report: metrics.json, history.csv and preview.png beside the field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8

from toonset import __version__
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.images.picture import encode_png
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.kernels.threads import side_by_side, threads_in_use
from toonset.nerf.look.drawn_view import SOURCES
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import Rendering, color_picture, default_layer
from toonset.nerf.render.turntable import between_drawings
from toonset.nerf.render.views import baked_of, render
from toonset.nerf.run.folder import write_field
from toonset.nerf.score.metrics import compare, means
from toonset.nerf.score.verdict import verdict_of
from toonset.nerf.train.result import HeldOut, Step, Training
from toonset.view import over_white
from toonset.write import write_bytes, write_json

PREVIEW_VIEWS, PREVIEW_PX = 4, 512  # of a preview: how many, and their side at most


def write_run(
    folder: Path,
    training: Training,
    scene: Scene,
    test: Scene | None = None,
    held_out: Sequence[HeldOut] = (),
) -> dict[str, Any]:
    """Write all files of a run into an existing folder; return the content of metrics.json.

    Its figures of training views are those of the drawings as they were fitted: set right, and few
    ones without their outlines.

    Args:
        folder: where to.
        training: what to write.
        scene: what was trained on.
        test: held-out views, compared whole; None: none.
        held_out: what was seen of them on the way.
    """
    baked = baked_of(training.result)
    views = between_views(baked)
    metrics = {
        **_course(training, held_out),
        "train": compared(baked, training.prepared.fitted),
        "test": None if test is None else compared(baked, test),
        "sources": None if training.result.drawings is None else _sources(views),
        "verdict": verdict_of(training, scene, baked).to_json(),
    }
    write_bytes(folder / "preview.png", encode_png(_in_a_row(views)))
    about = {
        "options": asdict(training.options),
        "scene": {"views": [frame.name for frame in scene.frames]},
        "versions": {"toonset": __version__, "torch": torch.__version__, "numpy": np.__version__},
        "threads": threads_in_use(),
    }
    write_json(folder / "config.json", write_field(folder, training.result, about))
    write_json(folder / "metrics.json", metrics)
    write_bytes(folder / "history.csv", _csv(training.history).encode())
    return metrics


def compared(source: TrainedField | Baked, scene: Scene) -> dict[str, float | None]:
    """Return the mean figures of the field's renderings beside a scene's pictures."""
    return figures_of(pictures_of(source, scene), scene)


def pictures_of(
    source: TrainedField | Baked, scene: Scene
) -> list[UInt8[np.ndarray, "height width 4"]]:
    """Return the field's pictures, straight alpha, seen by a scene's cameras."""
    baked = source if isinstance(source, Baked) else Baked.of(source)
    views = side_by_side([partial(render, baked, frame.camera) for frame in scene.frames])
    return [color_picture(view.rgb, view.alpha) for view in views]


def figures_of(
    pictures: Sequence[UInt8[np.ndarray, "height width 4"]], scene: Scene
) -> dict[str, float | None]:
    """Return the mean figures of pictures beside a scene's."""
    pairs = zip(pictures, scene.frames, strict=True)
    return means([compare(picture, frame.rgba) for picture, frame in pairs])


def _course(training: Training, held_out: Sequence[HeldOut]) -> dict[str, Any]:
    """Return how training went: its end, hull evidence, seconds, counts."""
    last = training.history[-1] if training.history else None
    return {
        "stopped": training.stopped,
        "steps": len(training.history),
        "steps_asked": training.options.steps,
        "loss": None if last is None else last.loss,
        "held_out": [asdict(seen) for seen in held_out],
        "drawings": training.prepared.to_json(),
        "symmetry": None if training.symmetry is None else training.symmetry.to_json(),
        "hull": asdict(training.evidence),
        "planes": None if training.choice is None else training.choice.to_json(),
        "counts": training.counts,
        "seconds": {k: round(v, 3) for k, v in training.seconds.items()},
    }


def preview(source: TrainedField | Baked) -> np.ndarray:
    """Return the views of `between_views` side by side over white, (height, 4 height, 3) bytes."""
    return _in_a_row(between_views(source))


def between_views(source: TrainedField | Baked) -> list[Rendering]:
    """Return four views half way between the drawings, where a field may be wrong."""
    baked = source if isinstance(source, Baked) else Baked.of(source)
    side = min(PREVIEW_PX, baked.trained.size_px)
    cameras = between_drawings(baked.trained, PREVIEW_VIEWS, side)
    return side_by_side([partial(render, baked, camera) for camera in cameras])


def _sources(views: Sequence[Rendering]) -> list[dict[str, float]]:
    """Return of each view which share of its paint is drawn, mirrored and guessed."""
    return [
        {
            "yaw_deg": round(math.degrees(view.camera.angles[0]) % 360, 2),
            **{name: round(view.drawn.share(number), 4) for number, name in enumerate(SOURCES)},
        }
        for view in views
    ]


def _in_a_row(views: Sequence[Rendering]) -> np.ndarray:
    layer = default_layer(views[0].field)
    pictures = [over_white(view.picture(layer)) for view in views]
    return (np.concatenate(pictures, axis=1) * 255 + 0.5).astype(np.uint8)


def _csv(history: tuple[Step, ...]) -> str:
    rows = [
        f"{s.step},{s.loss:.8g},{s.photometric:.8g},{s.cross_entropy:.8g},{s.seconds:.3f}"
        for s in history
    ]
    return "\n".join(["step,loss,photometric,cross_entropy,seconds", *rows]) + "\n"
