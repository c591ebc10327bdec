"""The Blender script that `toonset.dataset.exporters.blender` fills in."""

SCRIPT = r'''"""Cameras, mannequin and drawings of a character, for Blender 3.6 or later.

Written by toonset @VERSION@. Run it with `blender --python import_cameras.py`, or open it in the
Scripting tab and press Run. It makes a scene of its own and shows it: the start-up cube, light and
camera stay in theirs. Frame 1, 2, ... shows view 1, 2, ...
"""

import json
import os

import bpy
from mathutils import Matrix, Vector

WINDOW = @WINDOW@  # render size in pixels
VIEWS = json.loads(r"""@VIEWS@""")
BLENDER_FROM_WORLD = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # +Y up


def folder():
    """Return where this script lies: pictures and mannequin are beside it."""
    if os.path.isfile(__file__):
        return os.path.dirname(os.path.abspath(__file__))
    return os.path.dirname(bpy.path.abspath(bpy.context.space_data.text.filepath))


def add_camera(view, collection):
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
    collection.objects.link(camera)
    return camera


def add_drawing(view, collection):
    """Hang the drawing behind the mannequin, where its camera sees it in register."""
    corners = [BLENDER_FROM_WORLD @ Vector(corner) for corner in view["plane"]]
    middle = sum(corners, Vector()) / 4
    mesh = bpy.data.meshes.new(view["name"])
    mesh.from_pydata([corner - middle for corner in corners], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="UVMap")
    for loop, uv in zip(layer.data, ((0, 1), (0, 0), (1, 0), (1, 1))):
        loop.uv = uv
    mesh.materials.append(material_of(view))
    plane = bpy.data.objects.new("drawing " + view["name"], mesh)
    plane.location = middle
    collection.objects.link(plane)


def material_of(view):
    """Return a material that shows the picture unlit, its front only."""
    material = bpy.data.materials.new(view["name"])
    material.use_nodes = True
    material.use_backface_culling = True
    if hasattr(material, "surface_render_method"):
        material.surface_render_method = "BLENDED"
    else:
        material.blend_method = "BLEND"
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    picture = nodes.new("ShaderNodeTexImage")
    picture.image = bpy.data.images.load(os.path.join(folder(), view["picture"]))
    picture.extension = "CLIP"
    light, clear = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeBsdfTransparent")
    mix, back = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeMixShader")
    side, out = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeOutputMaterial")
    links.new(picture.outputs["Color"], light.inputs["Color"])
    links.new(picture.outputs["Alpha"], mix.inputs[0])
    links.new(clear.outputs[0], mix.inputs[1])
    links.new(light.outputs[0], mix.inputs[2])
    links.new(side.outputs["Backfacing"], back.inputs[0])  # Cycles knows no culling
    links.new(mix.outputs[0], back.inputs[1])
    links.new(clear.outputs[0], back.inputs[2])
    links.new(back.outputs[0], out.inputs["Surface"])
    return material


def add_mannequin(collection):
    """Add mannequin.obj, if there is one."""
    path = os.path.join(folder(), "mannequin.obj")
    if not os.path.isfile(path):
        return
    vertices, faces = [], []
    with open(path, encoding="utf-8") as lines:
        for words in map(str.split, lines):
            if words[:1] == ["v"]:
                vertices.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    mesh = bpy.data.meshes.new("mannequin")
    mesh.from_pydata(vertices, [], faces)
    body = bpy.data.objects.new("mannequin", mesh)
    body.matrix_world = BLENDER_FROM_WORLD
    collection.objects.link(body)


def add_sun(collection):
    """Light the mannequin from above, in front and one side; drawings need no light."""
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.rotation_euler = (0.8, 0.0, 0.5)
    collection.objects.link(sun)


def main():
    """Make and show a scene with mannequin, drawings, cameras and timeline."""
    scene = bpy.data.scenes.new("toonset")
    bpy.context.window.scene = scene
    collection = bpy.data.collections.new("toonset")
    scene.collection.children.link(collection)
    add_mannequin(collection)
    add_sun(collection)
    scene.render.resolution_x, scene.render.resolution_y = WINDOW
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"  # drawings keep their colours
    scene.frame_start, scene.frame_end = 1, len(VIEWS)
    for frame, view in enumerate(VIEWS, start=1):
        camera = add_camera(view, collection)
        add_drawing(view, collection)
        scene.timeline_markers.new(view["name"], frame=frame).camera = camera
    scene.camera = scene.timeline_markers[0].camera
    scene.frame_set(1)
    bpy.context.view_layer.update()


main()
'''
