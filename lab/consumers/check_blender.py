"""Check `--to blender` and `--to gltf` inside Blender, installed as a Python module.

    uv venv --python 3.13 /tmp/bpy && uv pip install --python /tmp/bpy/bin/python bpy numpy
    toonset export BUNDLE --to blender -o a && toonset export BUNDLE --to gltf -o b
    /tmp/bpy/bin/python lab/consumers/check_blender.py a b

Projects 1,000 points per view with Blender's own world_to_camera_view, and the corners of the
drawings' planes. The script runs in the scene that Blender starts with, whose cube, light and
camera must not be in the way; its planes are shown first, and its turning camera looks along the
yaw of its frame. Measured with Blender 5.2.3 LTS (3 bundles, 22 views, perspective and
orthographic): at most 0.0004 px for points and corners, script and glTF alike; since the script
opens a GLB itself, with Blender 4.5.15 LTS (2 bundles, 24 views) 0.0003.
With a painted body and the turn (1 bundle, 8 views): 0.0003 with Debian's 3.4.1, 4.2.23 LTS and
5.0.1. A Blender of the system runs it, too:

    PYTHONPATH=lab/consumers blender -b --factory-startup --python-use-system-env \\
        --python lab/consumers/check_blender.py -- a b
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from exported import pixels, points_around, read_views, report

bpy = import_module("bpy")
Vector = import_module("mathutils").Vector
world_to_camera_view = import_module("bpy_extras.object_utils").world_to_camera_view

Corner = Callable[[dict[str, Any], np.ndarray], np.ndarray]


def seen(points: list[Any], camera: Any, window: np.ndarray) -> np.ndarray:
    """Return pixels in the window, v down, of points in Blender's world."""
    views = [world_to_camera_view(bpy.context.scene, camera, point) for point in points]
    return np.array([[view[0], 1 - view[1]] for view in views]) * window


def middle_of_drawing(camera: dict[str, Any], window: np.ndarray) -> np.ndarray:
    """Return the drawing's corner in the script's window: its middle is the window's."""
    return (window - np.array(camera["size_wh"])) / 2


def axis_of_lens(camera: dict[str, Any], window: np.ndarray) -> np.ndarray:
    """Return the corner in glTF's window: a pinhole's principal point is in its middle."""
    return window / 2 - (np.array(camera["size_wh"]) / 2 if camera["k"] == 0 else camera["center"])


def check(folder: Path, window: np.ndarray, corner_of: Corner) -> bool:
    """Compare every view of the scene that is open."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = (int(n) for n in window)
    scene.render.resolution_percentage = 100
    bpy.context.view_layer.update()
    off = []
    for name, view in read_views(folder).items():
        camera = bpy.data.objects[f"camera {name}"]
        corner = corner_of(view["camera"], window)
        points = points_around(view)
        turned = [Vector((x, -z, y)) for x, y, z in points]
        expected = pixels(view, points, far_pinhole=False)
        off.append(float(np.abs(seen(turned, camera, window) - corner - expected).max()))
        plane = bpy.data.objects[f"drawing {name}"]
        ends = [plane.matrix_world @ vertex.co for vertex in plane.data.vertices]
        width, height = view["camera"]["size_wh"]
        rectangle = sorted([(0, 0), (0, height), (width, height), (width, 0)])
        found = np.array(sorted(map(tuple, np.round(seen(ends, camera, window) - corner, 6))))
        order = np.lexsort((found[:, 1], np.round(found[:, 0])))
        off.append(float(np.abs(found[order] - rectangle).max()))
    return report(f"{folder} in Blender {bpy.app.version_string}", off)


def check_turn(scene: Any, views: int) -> None:
    """Compare the turning camera's yaw with its frame's: one turn, from the front, to +X first."""
    frames = scene.frame_end - views
    for step in range(frames):
        scene.frame_set(views + 1 + step)
        assert scene.camera.name == "camera turntable"
        x, y, _ = scene.camera.matrix_world.translation - scene.objects["turntable"].location
        yaw = np.arctan2(x, -y) % (2 * np.pi)
        off = (yaw - 2 * np.pi * step / frames + np.pi) % (2 * np.pi) - np.pi
        assert abs(off) < 1e-4, (step, yaw)
    scene.frame_set(1)


def open_and_check(folder: Path) -> bool:
    """Open what the folder holds in a Blender that has just started, and check it."""
    is_gltf = not (folder / "import_cameras.py").is_file()
    bpy.ops.wm.read_factory_settings(use_empty=is_gltf)
    if is_gltf:
        bpy.ops.import_scene.gltf(filepath=str(folder / "scene.glb"))
        return check(folder, np.array(bpy.context.scene["window_px"]), axis_of_lens)
    started_with = {*bpy.context.scene.objects}
    assert "Cube" in {thing.name for thing in started_with}
    runpy.run_path(str(folder / "import_cameras.py"))
    scene = bpy.context.scene
    assert not started_with & {*scene.objects}
    assert scene.view_settings.view_transform == "Standard"
    scene.collection.children["drawings"].hide_viewport = False
    check_turn(scene, len(read_views(folder)))
    render = scene.render
    return check(folder, np.array([render.resolution_x, render.resolution_y]), middle_of_drawing)


if __name__ == "__main__":
    named = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    sys.exit(not all([open_and_check(Path(name)) for name in named]))
