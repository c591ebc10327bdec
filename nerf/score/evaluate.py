"""Evaluate renderings against held-out views and the drawings trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import color_picture, palette_picture
from toonset.nerf.render.views import render
from toonset.nerf.score.flip import PIXELS_PER_DEGREE
from toonset.nerf.score.labels import score_labels, shifted_miou
from toonset.nerf.score.lines import OF_PX, TOLERANCE_PX
from toonset.nerf.score.metrics import MOST_SHIFT_PX, Figures, means
from toonset.nerf.score.metrics_view import Judges, figures_of, load_judges
from toonset.palette.pixels.labels import label_pixels

LAYERS = ("drawn", "rgb", "palette")  # from the drawings; the field's colour; in palette colours
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class ScoredView:
    """One view, its renderings and their figures.

    Attributes:
        name: of the picture.
        drawn: (height, width, 4) the truth.
        pictures: per layer, the rendering; no "palette" without palette, no "drawn" of a run that
            holds no drawings.
        figures: per layer, as `toonset.nerf.score.metrics_view` names them, with label_accuracy,
            label_miou and label_miou_shift.
        errors: per layer, (height, width) error in [0, 1].
    """

    name: str
    drawn: UInt8[np.ndarray, "height width 4"]
    pictures: dict[str, UInt8[np.ndarray, "height width 4"]]
    figures: dict[str, Figures]
    errors: dict[str, Float[np.ndarray, "height width"]]


def evaluate(
    trained: TrainedField,
    test: Scene,
    training: Scene | None = None,
    progress: Progress = lambda text: None,
) -> dict[str, Any]:
    """Return figures of renderings beside pictures: the content of evaluation.json.

    PSNR, SSIM, FLIP, LPIPS and more, whole over white and inside the mask; a figure that cannot be
    said is None, `absent` says why.

    Args:
        trained: the field.
        test: held-out views.
        training: the scene that it was trained on, to be scored apart.
        progress: told which view is rendered.
    """
    judges = load_judges()
    own = () if training is None else score_views(trained, training, judges, progress)
    return report(score_views(trained, test, judges, progress), own, judges.absent)


def score_views(
    trained: TrainedField, scene: Scene, judges: Judges, progress: Progress = lambda text: None
) -> tuple[ScoredView, ...]:
    """Return every view of the scene, rendered and scored.

    Label figures count pixels that are no blends in the drawing and lie inside both masks. The
    drawing's labels are the scene's own where its palette is the run's, else the run's palette
    applied to the drawing.
    """
    baked, views = Baked.of(trained), []
    for number, frame in enumerate(scene.frames, 1):
        progress(f"{scene.name}: view {number} of {len(scene.frames)}")
        views.append(_scored(baked, scene, frame, judges))
    return tuple(views)


def chosen_frames(scene: Scene, config: object) -> Scene:
    """Return the frames of a bundle that a run's config.json names; all if it names none."""
    about = config.get("scene") if isinstance(config, dict) else None
    names = about.get("views") if isinstance(about, dict) else None
    if not isinstance(names, list):
        return scene
    frames = tuple(frame for frame in scene.frames if frame.name in names)
    return replace(scene, frames=frames)


def report(
    held_out: Sequence[ScoredView], training: Sequence[ScoredView], absent: dict[str, str]
) -> dict[str, Any]:
    """Return all figures as plain data.

    `drawn`, `rgb` and `palette` (None without) are means over the held-out views, `views` has each
    of them; `training` is the same for the views trained on, or None. `absent` says why a metric is
    null.
    """
    settings = {
        "flip_pixels_per_degree": PIXELS_PER_DEGREE,
        "psnr_shift_px": MOST_SHIFT_PX,
        "ink_tolerance_height": TOLERANCE_PX / OF_PX,
    }
    training_part = _section(training) if training else None
    return {**_section(held_out), "training": training_part, "absent": absent, "settings": settings}


def _section(views: Sequence[ScoredView]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for layer in LAYERS:
        rows = [view.figures[layer] for view in views if layer in view.figures]
        result[layer] = means(rows) if rows else None
    listed = [
        {"name": view.name} | {layer: view.figures.get(layer) for layer in LAYERS} for view in views
    ]
    return result | {"views": listed}


def _scored(baked: Baked, scene: Scene, frame: Frame, judges: Judges) -> ScoredView:
    trained, view = baked.trained, render(baked, frame.camera)
    pictures = {"rgb": color_picture(view.rgb, view.alpha)}
    labels = {"rgb": view.labels}
    if trained.drawings is not None:
        pictures = {"drawn": view.picture("drawn"), **pictures}
        labels["drawn"] = view.drawn.palette_labels(len(trained.drawings.palette))
    if trained.palette is not None:
        pictures["palette"] = palette_picture(view, trained.palette)
        labels["palette"] = view.labels
    figures, errors = {}, {}
    for layer, picture in pictures.items():
        found, errors[layer] = figures_of(picture, frame.rgba, judges)
        figures[layer] = found | label_figures(trained, scene, frame, labels[layer])
    return ScoredView(frame.name, frame.rgba, pictures, figures, errors)


def label_figures(
    trained: TrainedField,
    scene: Scene,
    frame: Frame,
    labels: UInt8[np.ndarray, "height width"] | None,
) -> Figures:
    """Return how right a view's labels are; None where the run, or the view, has none.

    Args:
        trained: its palette is that of the labels.
        scene: of the frame; its labels are the truth's if its palette is the run's.
        frame: the truth.
        labels: of the rendering.
    """
    score, shifted = None, None
    if trained.palette is not None and labels is not None:
        own = scene.palette is not None and np.array_equal(scene.palette, trained.palette)
        true = frame.labels if own else None
        true = label_pixels(frame.rgba, trained.palette) if true is None else true
        score, shifted = score_labels(labels, true), shifted_miou(labels, true)
    return {
        "label_accuracy": None if score is None else score.accuracy,
        "label_miou": None if score is None else score.miou,
        "label_miou_shift": shifted,
    }
