"""Check the add-on of `export --to blender-addon` inside Blender, with the real command.

    toonset export --to blender-addon -o addon.zip
    HOME=/tmp/home python lab/consumers/check_blender_addon.py addon.zip examples /path/of/toonset

With Blender installed as a Python module, or `blender -b --factory-startup --python FILE -- ...`.
It is installed into the preferences of HOME: give it an empty one. Opens a sheet, finds its
cameras, turns one by its compass, finds them again with that said, then a missing sheet and a
missing command. Done with Debian's 3.4.1, 4.2.23 LTS and 5.0.1; in 3.4.1 by hand in a window, too.
"""

from __future__ import annotations

import math
import shutil
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

bpy = import_module("bpy")
PACKAGE = "toonset_sheet"
SLACK_DEG = 0.01


def yaw_of(camera: Any) -> float:
    """Return the direction from which a camera looks, from its place; degrees."""
    target, place = camera["target"], camera.matrix_world.translation
    return math.degrees(math.atan2(place.x - target[0], -(place.y + target[2])))


def check_cameras(sheet: Any) -> None:
    """Every camera must stand where its drawing's compass says."""
    for drawing in sheet.drawings:
        camera = bpy.data.scenes[sheet.scene].timeline_markers[drawing.name].camera
        off = (math.degrees(drawing.yaw) - yaw_of(camera) + 180) % 360 - 180
        assert abs(off) < SLACK_DEG, (drawing.name, off)


def refused() -> str:
    """Return what the button says where it cannot go on."""
    try:
        bpy.ops.toonset.find()
    except RuntimeError as error:
        return str(error)
    raise AssertionError("nothing was refused")


def main(archive: str, examples: str, command: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=False)
    bpy.ops.preferences.addon_install(filepath=str(Path(archive).resolve()), overwrite=True)
    bpy.ops.preferences.addon_enable(module=PACKAGE)
    preferences = bpy.context.preferences.addons[PACKAGE].preferences
    preferences.command = command
    sheet = bpy.context.window_manager.toonset_sheet
    with tempfile.TemporaryDirectory() as place:
        for name in ("sheet.png", "mannequin.obj"):
            shutil.copy(Path(examples) / name, place)
        sheet.path, sheet.mannequin = f"{place}/sheet.png", f"{place}/mannequin.obj"
        assert bpy.ops.toonset.find() == {"FINISHED"}
        check_cameras(sheet)
        assert not any(drawing.said for drawing in sheet.drawings)
        one = sheet.drawings[1]
        found = math.degrees(one.yaw)
        one.yaw += math.radians(15)
        check_cameras(sheet)
        assert one.said
        assert bpy.data.scenes[sheet.scene].frame_current == 2
        one.yaw = math.radians(45)
        assert bpy.ops.toonset.find() == {"FINISHED"}
        check_cameras(sheet)
        again = math.degrees(sheet.drawings[1].yaw)
        assert sheet.drawings[1].said
        assert [scene.name for scene in bpy.data.scenes].count("toonset") == 1
        sheet.path = f"{place}/none.png"
        assert not sheet.drawings
        assert "none.png: no such file" in refused()
        preferences.command = f"{place}/toonset"
        assert "name the toonset command" in refused()
        assert not sheet.busy
    bpy.ops.preferences.addon_disable(module=PACKAGE)
    print(f"Blender {bpy.app.version_string}: yaw {found:.1f}, {again:.1f} with 45 said  ok")


if __name__ == "__main__":
    main(*sys.argv[-3:])
