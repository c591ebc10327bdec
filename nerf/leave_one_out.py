"""Measure new views where the truth is known: leave every drawing out, train on the others.

The held-out protocol for a handful of drawings: for each of them a field is trained on all others,
rendered by the camera of the drawing that was left out, and scored with the figures of `toonset
evaluate`. Training sees neither pixels nor outline nor camera of that drawing. What precedes the
training does: the bundle's cameras, the fitted mannequin and the palette come from all drawings, as
NeRF papers take poses that were estimated from all photographs.

`toonset.nerf.score.left_out` asks the same of one trained field, in a second: that field has seen
the drawing, which is left out of the drawn look only.

Source: Geisser 1975, "The predictive sample reuse method" (leave one out).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import THUMBNAIL_PX, Bundle
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import check_cut_out, has_figure
from toonset.errors import BundleError, UsageError, did_you_mean
from toonset.nerf.kernels.threads import working_threads
from toonset.nerf.options import TrainOptions
from toonset.nerf.score.evaluate import LAYERS, ScoredView, report, score_views
from toonset.nerf.score.metrics import Figures, means
from toonset.nerf.score.metrics_view import load_judges
from toonset.nerf.train.fit_field import device_of
from toonset.nerf.training import Listener, train
from toonset.notebook import Cell, picture_bytes, table
from toonset.view import small_png

FEWEST = 3  # drawings: a field needs two
SHOWN = {  # figures in a notebook: heading, number format
    "psnr": ("PSNR dB", "{:.2f}"),
    "psnr_mask": ("in mask", "{:.2f}"),
    "ssim": ("SSIM", "{:.3f}"),
    "flip": ("FLIP", "{:.3f}"),
    "silhouette_iou": ("outline", "{:.1%}"),
    "ink_f1": ("lines", "{:.2f}"),
}


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Predictions of drawings by fields that were trained without them.

    Attributes:
        name: of the scene.
        views: the drawings that were left out, in the scene's order: what was rendered of them, and
            their figures per layer.
        cameras: of these views, which rendered them.
        trained_on: per view, the names of the drawings that its field was trained on.
        steps: per view, the optimiser steps that were done.
        options: of every training, with its seed.
        absent: why a figure is None, by its name.
    """

    name: str
    views: tuple[ScoredView, ...]
    cameras: tuple[Camera, ...]
    trained_on: tuple[tuple[str, ...], ...]
    steps: tuple[int, ...]
    options: TrainOptions
    absent: dict[str, str]

    @property
    def mean(self) -> dict[str, Figures]:
        """Return the mean figures of the views, per layer that every view has."""
        layers = [name for name in LAYERS if all(name in view.figures for view in self.views)]
        return {name: means([view.figures[name] for view in self.views]) for name in layers}

    def to_json(self) -> dict[str, Any]:
        """Return all figures as evaluation.json has them, and how they came about."""
        rows = zip(self.cameras, self.trained_on, self.steps, strict=True)
        protocol = {
            "options": asdict(self.options),
            "views": [
                {
                    "camera": NativeCamera.of(camera).model_dump(mode="json"),
                    "trained_on": list(names),
                    "steps": steps,
                }
                for camera, names, steps in rows
            ],
        }
        mean = {name: self.mean.get(name) for name in LAYERS}
        return {**report(self.views, (), self.absent), **mean, "leave_one_out": protocol}

    def _repr_html_(self) -> str:
        """Return a table for a notebook: each drawing beside what the others say of it, figures."""
        layer = next(iter(self.mean))
        size = picture_bytes(2 * len(self.views))
        rows: list[Sequence[Cell]] = [["", "", "mean", *_cells(self.mean[layer])]]
        for view in self.views:
            both = [small_png(p, THUMBNAIL_PX, size) for p in (view.drawn, view.pictures[layer])]
            rows.append([*both, view.name, *_cells(view.figures[layer])])
        caption = (
            f"{self.name}: {len(self.views)} drawings, each predicted by a field that was trained "
            f"without it; layer {layer}, seed {self.options.seed}"
        )
        return table(caption, ("drawn", "predicted", "view", *(t for t, _ in SHOWN.values())), rows)


def leave_one_out(
    bundle: Bundle | Scene,
    options: TrainOptions = TrainOptions(),
    *,
    views: Sequence[str] | None = None,
    palette: bool = True,
    threads: int | None = None,
    listener: Listener | None = None,
) -> LeaveOneOut:
    """Return how well each drawing is predicted by a field that was trained without it.

    One training per view, by `train` with the same options and seed; on a CPU the same bundle,
    options and threads give the same figures, unless `options.budget_s` ends a training.

    A view's camera is the bundle's: it was calibrated together with all drawings, this one among
    them, and is not calibrated again without it. That is the usual protocol, and a little kinder
    than a drawing from elsewhere would be. The same holds for the mannequin as it was fitted, and
    for the bundle's palette; a bundle without one gets a palette of the drawings that are trained
    on. Where `options.register` moves the cameras of training, this one stays; `psnr_shift` allows
    for that. Unless `options.symmetric` is "off", the mirror image of another drawing may show the
    side that was left out, as in any new view.

    Args:
        bundle: posed drawings, three or more that show a figure.
        options: of every training.
        views: names of those to leave out, e.g. ["001.png"]; None: each that shows a figure.
        palette: train labels, too, as in `train`.
        threads: of the CPU; None: two, or one if torch is set to use no more.
        listener: told, with the view's name before it, what `train` tells.

    Raises:
        UsageError: an option that means nothing, a view that is not there, shows no figure or is
            named twice.
        BundleError: fewer than three drawings show a figure, or the others alone make no field.
        SetupError: a GPU was asked for and there is none.
    """
    scene = bundle if isinstance(bundle, Scene) else bundle.scene
    options.check()
    device_of(options.device)
    check_cut_out(scene)
    chosen = _chosen(scene, views)
    judges, found = load_judges(), []
    for number, frame in enumerate(chosen, 1):
        told = _Told(listener, f"{frame.name} left out ({number} of {len(chosen)}): ")
        others = tuple(other for other in scene.frames if other is not frame)
        rest = replace(scene, frames=others, name=f"{scene.name} without {frame.name}")
        run = train(rest, options, palette=palette, threads=threads, listener=told)
        with working_threads(threads):
            (view,) = score_views(run.field, replace(scene, frames=(frame,)), judges)
        found.append((view, tuple(other.name for other in others), len(run.training.history)))
    scored, trained_on, steps = zip(*found, strict=True)
    cameras = tuple(frame.camera for frame in chosen)
    return LeaveOneOut(scene.name, scored, cameras, trained_on, steps, options, judges.absent)


def _chosen(scene: Scene, views: Sequence[str] | None) -> list[Frame]:
    """Return the frames to leave out, in the scene's order."""
    drawn = {frame.name: frame for frame in scene.frames if has_figure(frame)}
    if len(drawn) < FEWEST:
        raise BundleError(
            f"{scene.name}: {len(drawn)} drawings show a figure, {FEWEST} are needed: a field is "
            "trained on two or more, without the one that is left out"
        )
    if views is None:
        return list(drawn.values())
    if isinstance(views, str) or not views:
        raise UsageError(f"views: {views!r}; give a list of names, e.g. [{next(iter(drawn))!r}]")
    for name in views:
        if name not in drawn:
            known = did_you_mean(name, drawn) or f"choose of {', '.join(drawn)}"
            raise UsageError(f"views: {name!r} is no drawing with a figure; {known}")
        if list(views).count(name) > 1:
            raise UsageError(f"views: {name!r} is named twice; name each once")
    return [frame for name, frame in drawn.items() if name in views]


def _cells(figures: Figures) -> list[str]:
    pairs = [(figures[name], form) for name, (_, form) in SHOWN.items()]
    return ["-" if value is None else form.format(value) for value, form in pairs]


@dataclass(frozen=True)
class _Told:
    """A listener that hears of one training among others."""

    listener: Listener | None
    subject: str

    def say(self, text: str) -> None:
        if self.listener is not None:
            self.listener.say(self.subject + text)

    def detail(self, text: str) -> None:
        if self.listener is not None:
            self.listener.detail(self.subject + text)

    def progress(self, text: str) -> None:
        if self.listener is not None:
            self.listener.progress(self.subject + text)
