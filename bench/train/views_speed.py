"""Milliseconds per rendered view, beside a plain renderer of the same field in the same run.

    python -m bench.train.views_speed [RUN]      a run folder; without one, a body is trained

The plain renderer sends as many rays through every pixel as the fast one does through borders, and
asks the field itself at every step of every ray through the box. It would take minutes, so it
renders SAMPLED pixels, drawn by lot, and its time is scaled to the whole picture; the same pixels
say how far the fast picture is from it. Times are CPU time of one thread, median of the views.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float

from bench.cases.cases import train_cases
from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import EDGE, occupancy
from toonset.nerf.hull.march import clip, rays_of
from toonset.nerf.kernels.compositing import compositing_weights
from toonset.nerf.options import TrainOptions
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import places_within, render
from toonset.nerf.run.folder import read_field
from toonset.nerf.score.metrics import psnr_of
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.train import fit_field

SIZES = (150, 300, 600)
VIEWS = 8  # all round
SAMPLED = 512  # pixels of a view that the plain renderer shows
RAYS_PER_CHUNK = 1 << 9
STEPS = 150  # of the training without RUN: surfaces have formed by then


@dataclass(frozen=True)
class Row:
    """Views of one size.

    Attributes:
        size_px: their side.
        fast_ms: of a whole view.
        plain_ms: of a whole view, from SAMPLED pixels.
        psnr: of the fast pictures against the plain ones over white, dB.
    """

    size_px: int
    fast_ms: float
    plain_ms: float
    psnr: float


def compare(trained: TrainedField, size_px: int, seed: int = 0) -> Row:
    """Return what views of one size cost both renderers."""
    rng, baked = np.random.default_rng(seed), Baked.of(trained)
    fast_s, plain_s, errors = [], [], []
    cameras = turntable(trained, VIEWS, 0.0, size_px)
    render(baked, cameras[0])  # pages and caches are warm from here on
    for camera in cameras:
        began = time.process_time()
        view = render(baked, camera)
        fast_s.append(time.process_time() - began)
        chosen = np.zeros(size_px * size_px, dtype=bool)
        chosen[rng.choice(chosen.size, min(SAMPLED, chosen.size), replace=False)] = True
        began = time.process_time()
        truth = plain(trained, camera, chosen.reshape(size_px, size_px))
        plain_s.append((time.process_time() - began) * chosen.size / chosen.sum())
        over_white = np.dstack([view.rgb, view.alpha]).reshape(-1, 4)[chosen]
        errors.append(np.square(_over_white(over_white) - _over_white(truth)).mean())
    fast_ms, plain_ms = 1e3 * float(np.median(fast_s)), 1e3 * float(np.median(plain_s))
    return Row(size_px, fast_ms, plain_ms, psnr_of(float(np.mean(errors))))


@torch.no_grad()
def plain(
    trained: TrainedField, camera: Camera, chosen: np.ndarray
) -> Float[np.ndarray, "pixels 4"]:
    """Return premultiplied colour and opacity of chosen pixels: every step of every ray."""
    places = places_within(chosen)
    rays = rays_of(camera, places.reshape(-1, 2), trained.hull)
    near, far = clip(rays, trained.hull)
    steps = int(((far - near).max() / trained.step).ceil().clamp_min(1))
    seen = []
    for start in range(0, len(near), RAYS_PER_CHUNK):
        part = slice(start, start + RAYS_PER_CHUNK)
        distance = near[part, None] + trained.step * (torch.arange(steps) + 0.5)
        some = rays.at(part)
        points = some.origins[:, None] + some.directions[:, None] * distance[..., None]
        density, rgb = trained.field(points.view(-1, 3))
        support = trained.hull.support_at(points.view(-1, 3))
        depth = density * trained.step * occupancy(support) * (support >= EDGE)
        depth = depth.view(distance.shape) * (distance < far[part, None])
        weights = compositing_weights(depth)
        color = torch.cat([rgb, torch.ones(len(rgb), 1)], dim=1).view(*distance.shape, 4)
        seen.append((weights[..., None] * color).sum(dim=1))
    return torch.cat(seen).view(*places.shape[:2], 4).mean(dim=1).numpy()


def main(arguments: list[str]) -> None:
    """Print the table."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    trained = read_field(Path(arguments[0])) if arguments else _some_body()
    began = time.process_time()
    Baked.of(trained)
    baking_ms = 1e3 * (time.process_time() - began)
    print(f"reading the field, once for all views: {baking_ms:.0f} ms")
    print("  px   ms per view   plain ms   ratio   dB beside plain")
    for size_px in SIZES:
        row = compare(trained, size_px)
        ratio, ms = row.plain_ms / row.fast_ms, (row.fast_ms, row.plain_ms)
        print(f"{size_px:4d} {ms[0]:13.0f} {ms[1]:10.0f} {ratio:7.0f} {row.psnr:17.1f}")


def _some_body() -> TrainedField:
    case = next(iter(train_cases(None, 0, 1)))
    return fit_field(labelled(case.train)[0], TrainOptions(steps=STEPS)).result


def _over_white(premultiplied: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3"]:
    return premultiplied[:, :3] + 1 - premultiplied[:, 3:]


if __name__ == "__main__":
    main(sys.argv[1:])
