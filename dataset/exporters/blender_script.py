"""Hold the Blender script that `toonset.dataset.exporters.blender` fills in."""

SCRIPT = r'''"""Cameras, mannequin and drawings of a character, for Blender 3.6 or later.

Written by toonset @VERSION@. Run it with `blender --python import_cameras.py`, or open it in the
Scripting tab and press Run. It makes a scene of its own and shows it: the start-up cube, light and
camera stay in theirs. Frame 1, 2, ... shows view 1, 2, ...
"""

import json
import os

import bpy
from mathutils import Matrix

WINDOW = @WINDOW@  # render size in pixels
VIEWS = json.loads(r"""@VIEWS@""")
BLENDER_FROM_WORLD = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # +Y up


def folder():
    """Return where this script lies: mannequin and drawings are beside it."""
    if os.path.isfile(__file__):
        return os.path.dirname(os.path.abspath(__file__))
    return os.path.dirname(bpy.path.abspath(bpy.context.space_data.text.filepath))


def camera_of(view):
    """Return a camera that sees exactly what the drawing shows."""
    lens = bpy.data.cameras.new(view["name"])
    lens.sensor_fit = "HORIZONTAL"
    if view["orthographic"]:
        lens.type = "ORTHO"
        lens.ortho_scale = view["width_world"]
    else:
        lens.lens = view["focal_widths"] * lens.sensor_width
    lens.shift_x, lens.shift_y = view["shift"]
    lens.clip_start, lens.clip_end = view["clip"]
    camera = bpy.data.objects.new("camera " + view["name"], lens)
    camera.matrix_world = BLENDER_FROM_WORLD @ Matrix(view["world_from_camera"])
    return camera


def main():
    """Make and show a scene with mannequin, drawings, cameras and timeline."""
    scene = bpy.data.scenes.new("toonset")
    bpy.context.window.scene = scene
    bpy.ops.import_scene.gltf(filepath=os.path.join(folder(), "scene.glb"))
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))  # drawings need no light
    sun.rotation_euler = (0.8, 0.0, 0.5)
    scene.collection.objects.link(sun)
    scene.render.resolution_x, scene.render.resolution_y = WINDOW
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"  # drawings keep their colours
    scene.frame_start, scene.frame_end = 1, len(VIEWS)
    for frame, view in enumerate(VIEWS, start=1):
        camera = camera_of(view)
        scene.collection.objects.link(camera)
        scene.timeline_markers.new(view["name"], frame=frame).camera = camera
    scene.camera = scene.timeline_markers[0].camera
    scene.frame_set(1)
    bpy.context.view_layer.update()


main()
'''
