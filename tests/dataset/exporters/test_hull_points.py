"""Points of the drawings' visual hull: on its surface, seen by the right views, coloured."""

from dataclasses import replace

import numpy as np
import pytest

from tests.dataset.exporters.exported_views import TARGET
from toonset.camera import Camera
from toonset.dataset.exporters.common import ExportView
from toonset.dataset.exporters.hull_points import hull_points

RADIUS, SCALE, SIDE = 0.6, 60.0, 96
RED, BLUE = (200, 30, 30), (30, 60, 200)


def ball(camera: Camera, name: str) -> ExportView:
    """Return a ball about TARGET as a camera sees it, red above and blue below."""
    width, height = camera.size_wh
    v, u = np.mgrid[:height, :width] + 0.5
    off = np.stack([u, v], axis=-1) - camera.project(TARGET[None])[0][0]
    rgba = np.zeros((height, width, 4), np.uint8)
    inside = np.linalg.norm(off, axis=-1) < RADIUS * SCALE
    rgba[inside] = (*RED, 255)
    rgba[inside & (off[..., 1] > 0)] = (*BLUE, 255)
    return ExportView(name, rgba, camera, 100.0, RADIUS)


def views(count: int) -> list[ExportView]:
    yaws = 2 * np.pi * np.arange(count) / count + 0.2
    level = [Camera.looking_at(TARGET, yaw, 0.0, SCALE, (SIDE, SIDE)) for yaw in yaws]
    return [ball(camera, f"{i:03d}.png") for i, camera in enumerate(level)]


def test_points_lie_on_the_hull_and_views_see_their_own_side() -> None:
    shown = views(8)
    points = hull_points(shown, 0)
    assert points is not None
    away = np.linalg.norm(points.xyz - TARGET, axis=1)
    assert np.median(np.abs(away - RADIUS)) < 0.02 * 2 * RADIUS
    again = hull_points(shown, 0)
    assert again is not None
    np.testing.assert_array_equal(points.xyz, again.xyz)
    assert points.seen.any(axis=0).all()
    for view, seen, pixels in zip(shown, points.seen, points.pixels, strict=True):
        place, depth, _ = view.pinhole.project(points.xyz)
        np.testing.assert_allclose(pixels, place)
        middle = view.pinhole.project(TARGET[None])[1][0]
        assert (depth[seen] < middle + 0.3 * RADIUS).all()  # nothing of the far side
    upper = points.xyz[:, 1] > TARGET[1] + 0.1
    lower = points.xyz[:, 1] < TARGET[1] - 0.1
    assert (points.rgb[upper] == RED).all()
    assert (points.rgb[lower] == BLUE).all()


@pytest.mark.parametrize("alpha", [0, 255])
def test_too_few_drawings_one_without_silhouette_or_none_in_common_have_no_hull(alpha: int) -> None:
    for count in (1, 2):
        assert hull_points(views(count), 0) is None
    shown = views(4)
    away = [
        replace(view, camera=replace(view.camera, target=TARGET + np.array([0, 4.0 * i, 0])))
        for i, view in enumerate(shown)
    ]
    assert hull_points(away, 0) is None
    shown[1].rgba[..., 3] = alpha
    assert hull_points(shown, 0) is None
