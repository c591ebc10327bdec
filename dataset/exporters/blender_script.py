"""Hold the Blender script that `toonset.dataset.exporters.blender` fills in."""

SCRIPT = r'''"""Cameras, drawings and body of a character, for Blender 3.4 or later.

Written by toonset @VERSION@. Run it with `blender --python import_cameras.py`, or open it in the
Scripting tab and press Run. It makes a scene of its own and shows it: the start-up cube, light and
camera stay in theirs. Frame 1, 2, ... shows view 1, 2, ... with its drawing over it, half
transparent; the frames after them turn round the character. Hidden: the collections "drawings",
the drawings as planes, and, where there is a painted body, "mannequin".
"""

import json
import math
import os
import sys

import bpy
from mathutils import Matrix, Vector

OLDEST = (3, 4)
WINDOW = @WINDOW@  # render size in pixels
TURN = json.loads(r"""@TURN@""")
VIEWS = json.loads(r"""@VIEWS@""")
BLENDER_FROM_WORLD = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # +Y up
OVER = 0.5  # opacity of a drawing over its view
SUN, SKY = 2.0, 0.4  # together they light a grey body without burning it out


def folder():
    """Return where this script lies: body and drawings are beside it."""
    if os.path.isfile(__file__):
        return os.path.dirname(os.path.abspath(__file__))
    return os.path.dirname(bpy.path.abspath(bpy.context.space_data.text.filepath))


def what_is_missing():
    """Return a line where this Blender cannot do it; empty if it can."""
    if tuple(bpy.app.version[:2]) < OLDEST:
        return "import_cameras.py: needs Blender 3.4 or later, this is " + bpy.app.version_string
    try:
        import numpy
    except ImportError:
        return (
            "import_cameras.py: this Blender has no numpy, which its glTF importer needs; "
            "install it (Debian: apt-get install python3-numpy), or take Blender from blender.org"
        )
    if tuple(bpy.app.version[:2]) < (3, 6):
        numpy.bool = bool  # their importers ask for it; numpy 1.24, as in Debian, has dropped it
    return ""


def opened(name):
    """Import a GLB that lies beside this script; return its meshes."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=os.path.join(folder(), name))
    return [thing for thing in bpy.data.objects if thing not in before and thing.type == "MESH"]


def draw_outline(material):
    """Let Cycles, too, see through the near side of the outline's hull, which is inside out."""
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    surface = next(node for node in nodes if node.type == "OUTPUT_MATERIAL").inputs["Surface"]
    ink = surface.links[0].from_socket
    mixed = nodes.new("ShaderNodeMixShader")
    link(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mixed.inputs[0])
    link(ink, mixed.inputs[1])
    link(nodes.new("ShaderNodeBsdfTransparent").outputs[0], mixed.inputs[2])
    link(mixed.outputs[0], surface)


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
    lens.show_background_images = True
    drawing = lens.background_images.new()
    drawing.image = bpy.data.images.load(os.path.join(folder(), "images", view["name"]))
    drawing.alpha, drawing.display_depth, drawing.frame_method = OVER, "FRONT", "FIT"
    drawing.scale = view["of_window"]
    camera = bpy.data.objects.new("camera " + view["name"], lens)
    camera.matrix_world = BLENDER_FROM_WORLD @ Matrix(view["world_from_camera"])
    return camera


def turning_camera(first):
    """Return a camera that turns once round the character from a frame on, and its axis."""
    axis = bpy.data.objects.new("turntable", None)
    axis.location = BLENDER_FROM_WORLD @ Vector(TURN["target"])
    axis.empty_display_size = TURN["width_world"] / 20
    step = 2 * math.pi / TURN["frames"]
    axis.driver_add("rotation_euler", 2).driver.expression = f"(frame - {first}) * {step:.9f}"
    lens = bpy.data.cameras.new("turntable")
    lens.type, lens.sensor_fit, lens.ortho_scale = "ORTHO", "HORIZONTAL", TURN["width_world"]
    lens.clip_start, lens.clip_end = TURN["clip"]
    camera = bpy.data.objects.new("camera turntable", lens)
    camera.parent = axis
    up, away = TURN["elevation"], TURN["distance"]
    camera.location = (0.0, -away * math.cos(up), away * math.sin(up))
    camera.rotation_euler = (math.pi / 2 - up, 0.0, 0.0)
    return camera, axis


def collection(scene, name, things, hidden=False):
    """Put objects into a new collection of the scene, and nowhere else."""
    made = bpy.data.collections.new(name)
    scene.collection.children.link(made)
    for thing in things:
        for old in list(thing.users_collection):
            old.objects.unlink(thing)
        made.objects.link(thing)
    made.hide_viewport = made.hide_render = hidden


def light(scene):
    """Light the scene so that neither Eevee nor Cycles burns a light body out."""
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy = SUN
    sun = bpy.data.objects.new("sun", lamp)
    sun.rotation_euler = (0.8, 0.0, 0.5)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("toonset")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (SKY, SKY, SKY, 1.0)
    scene.view_settings.view_transform = "Standard"  # drawings keep their colours
    scene.view_settings.look = "None"


def main():
    """Make and show a scene with body, drawings, cameras and timeline."""
    scene = bpy.data.scenes.new("toonset")
    bpy.context.window.scene = scene
    meshes = opened("scene.glb")
    body = opened("body.glb") if os.path.isfile(os.path.join(folder(), "body.glb")) else []
    planes = [mesh for mesh in meshes if mesh.name.startswith("drawing ")]
    mannequin = [mesh for mesh in meshes if mesh not in planes]
    for mesh in mannequin:  # it must not hide what is drawn
        mesh.display_type = "WIRE"
    for thing in [*body, *meshes]:
        thing.select_set(False)
    for material in {one for mesh in body for one in mesh.data.materials if one is not None}:
        if material.name.startswith("outline"):
            draw_outline(material)
    collection(scene, "body", body)
    collection(scene, "mannequin", mannequin, hidden=bool(body))
    collection(scene, "drawings", planes, hidden=True)
    light(scene)
    scene.render.resolution_x, scene.render.resolution_y = WINDOW
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    scene.render.film_transparent = True
    cameras = [camera_of(view) for view in VIEWS]
    turning, axis = turning_camera(len(VIEWS) + 1)
    collection(scene, "cameras", [*cameras, turning, axis])
    names = [*(view["name"] for view in VIEWS), "turntable"]
    for frame, (name, camera) in enumerate(zip(names, [*cameras, turning]), start=1):
        scene.timeline_markers.new(name, frame=frame).camera = camera
    scene.frame_start, scene.frame_end = 1, len(VIEWS) + TURN["frames"]
    scene.camera = cameras[0]
    scene.frame_set(1)
    bpy.context.view_layer.update()


MISSING = what_is_missing()
if not MISSING:
    main()
elif bpy.app.background:
    sys.exit(MISSING)
else:  # to leave would close the window
    print(MISSING, file=sys.stderr)
'''
