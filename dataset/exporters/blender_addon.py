"""Write an add-on for Blender: a panel that opens a sheet, has its cameras found and imports them.

    toonset_sheet/__init__.py    in a zip that Blender's preferences install as a legacy add-on

The add-on does nothing itself: it runs the `toonset` command in a process of its own, and the
script that `export --to blender` writes.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

from toonset import __version__
from toonset.write import write_bytes

PACKAGE = "toonset_sheet"
STAMP = (1980, 1, 1, 0, 0, 0)  # of what is in the zip: the same bytes every time


def write_blender_addon(path: Path) -> None:
    """Write the add-on as a zip, whole or not at all; what is there is replaced.

    Raises:
        OutputError: the file cannot be written.
    """
    release = ", ".join(re.findall(r"\d+", __version__)[:3])
    text = ADDON.replace("@VERSION@", __version__).replace("@RELEASE@", release)
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        entry = zipfile.ZipInfo(f"{PACKAGE}/__init__.py", STAMP)
        entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
        archive.writestr(entry, text)
    write_bytes(path, data.getvalue())


ADDON = r'''"""A panel of the 3D view for character sheets. Written by toonset @VERSION@.

View > Sidebar > toonset: choose a sheet, "Find cameras". Every drawing then has a compass: drag its
angle and its camera turns round the character, under the drawing; "Find cameras" again takes these
angles for said. What is found lies beside the sheet, in NAME_toonset/.
"""

import json
import math
import os
import runpy
import subprocess

import bpy
from mathutils import Matrix, Vector

bl_info = {
    "name": "toonset: character sheets",
    "author": "The toonset authors",
    "version": (@RELEASE@),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > toonset",
    "description": "Cameras of hand-drawn character sheets, by the toonset command",
    "category": "Import-Export",
}
FINE = (0, 3)  # exit codes: done; done, but look
WAIT_S = 0.2  # between looks at the process
BLENDER_FROM_WORLD = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # +Y up
ICONS = {"ok": "CHECKMARK", "weak": "QUESTION", "ambiguous": "QUESTION", "failed": "ERROR"}


class SheetPreferences(bpy.types.AddonPreferences):
    """Where the command is."""

    bl_idname = __name__
    command: bpy.props.StringProperty(
        name="toonset command", default="toonset", subtype="FILE_PATH"
    )

    def draw(self, context):
        """Show it."""
        self.layout.prop(self, "command")


def turn_camera(drawing, context):
    """Turn a drawing's camera round the character to the yaw that was dragged, and show it."""
    sheet = sheet_of(context)
    if sheet.busy:
        return
    drawing.said = True
    scene = bpy.data.scenes.get(sheet.scene)
    marker = None if scene is None else scene.timeline_markers.get(drawing.name)
    if marker is None or marker.camera is None:
        return
    camera = marker.camera
    about = Matrix.Translation(BLENDER_FROM_WORLD @ Vector(camera["target"]))
    turn = Matrix.Rotation(drawing.yaw - camera["yaw"], 4, "Z")
    camera.matrix_world = about @ turn @ about.inverted() @ camera.matrix_world
    camera["yaw"] = drawing.yaw
    scene.frame_set(marker.frame)


class Drawing(bpy.types.PropertyGroup):
    """One drawing of the sheet; its name is the view's."""

    yaw: bpy.props.FloatProperty(
        name="Yaw", description="0: front, 90: its left side", subtype="ANGLE", update=turn_camera
    )
    said: bpy.props.BoolProperty(
        name="Said", description="Fit with this yaw; else it is found anew"
    )
    verdict: bpy.props.StringProperty()
    reason: bpy.props.StringProperty()


def forget_drawings(sheet, context):
    """Forget what was said of another sheet's drawings."""
    sheet.drawings.clear()


class Sheet(bpy.types.PropertyGroup):
    """What the panel shows."""

    path: bpy.props.StringProperty(name="Sheet", subtype="FILE_PATH", update=forget_drawings)
    mannequin: bpy.props.StringProperty(
        name="Mannequin", description="Posed body: obj, glb ...; empty: none", subtype="FILE_PATH"
    )
    drawings: bpy.props.CollectionProperty(type=Drawing)
    scene: bpy.props.StringProperty()
    busy: bpy.props.BoolProperty()


def sheet_of(context):
    """Return what the panel shows: it outlives a change of scene."""
    return context.window_manager.toonset_sheet


def folder_of(sheet):
    """Return the folder beside the sheet for what is found."""
    return os.path.splitext(bpy.path.abspath(sheet.path))[0] + "_toonset"


def calibrate_words(sheet):
    """Return what to type for cameras, with the yaws that were said."""
    words = ["calibrate", bpy.path.abspath(sheet.path), "--force", "--quiet"]
    words += ["-o", os.path.join(folder_of(sheet), "bundle")]
    words += ["--mesh", bpy.path.abspath(sheet.mannequin) if sheet.mannequin else "none"]
    said = [f"{math.degrees(d.yaw) % 360:.1f}" if d.said else "?" for d in sheet.drawings]
    return words + (["--views", ",".join(said)] if any(d.said for d in sheet.drawings) else [])


def export_words(sheet):
    """Return what to type for the scene."""
    place = folder_of(sheet)
    words = ["export", os.path.join(place, "bundle"), "--to", "blender", "--force", "--quiet"]
    return [*words, "-o", os.path.join(place, "scene")]


def start(context, words):
    """Start the command; its output is read when it has ended."""
    command = context.preferences.addons[__name__].preferences.command
    known = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.Popen(
        [bpy.path.abspath(command), *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=known,  # Blender's Python is not its own
    )


def remove_scene(name):
    """Take away a scene that was imported before, with what is in it."""
    scene = bpy.data.scenes.get(name)
    if scene is None or len(bpy.data.scenes) == 1:
        return
    for thing in list(scene.collection.all_objects):
        bpy.data.objects.remove(thing)
    for inner in list(scene.collection.children):
        bpy.data.collections.remove(inner)
    bpy.data.scenes.remove(scene)


def show(context, sheet):
    """Import the scene that was exported, and list its drawings."""
    place = folder_of(sheet)
    before = sheet.scene
    script = runpy.run_path(os.path.join(place, "scene", "import_cameras.py"))
    if script["MISSING"]:
        raise RuntimeError(script["MISSING"])
    scene = context.window.scene
    remove_scene(before)
    scene.name = "toonset"
    sheet.scene = scene.name
    with open(os.path.join(place, "bundle", "calibration.json"), encoding="utf-8") as file:
        judged = {view["name"]: view for view in json.load(file)["views"]}
    with open(os.path.join(place, "scene", "toonset.json"), encoding="utf-8") as file:
        views = json.load(file)["views"]
    said = {drawing.name: drawing.said for drawing in sheet.drawings}
    sheet.drawings.clear()
    for view in views:
        found = judged[view["name"]]
        camera = scene.timeline_markers[view["name"]].camera
        camera["target"] = view["camera"]["target"]
        camera["yaw"] = math.radians(found["camera"]["yaw_deg"])
        drawing = sheet.drawings.add()
        drawing.name, drawing.yaw = view["name"], camera["yaw"]
        drawing.said = said.get(view["name"], False)
        drawing.verdict, drawing.reason = found["verdict"], found["reason"]


class TOONSET_OT_find(bpy.types.Operator):
    """Find the cameras of the sheet's drawings and import them"""

    bl_idname = "toonset.find"
    bl_label = "Find cameras"

    @classmethod
    def poll(cls, context):
        """Return whether there is a sheet, and nothing running."""
        sheet = sheet_of(context)
        return bool(sheet.path) and not sheet.busy

    def begin(self, context):
        """Start the first command; return whether it runs."""
        sheet = sheet_of(context)
        self.steps = [calibrate_words(sheet), export_words(sheet)]
        sheet.busy = True
        return self.next(context)

    def next(self, context):
        """Start the next command."""
        try:
            os.makedirs(folder_of(sheet_of(context)), exist_ok=True)
            self.process = start(context, self.steps.pop(0))
        except OSError as error:
            return self.fail(context, f"{error}; name the toonset command in the preferences")
        return True

    def fail(self, context, text):
        """Say what is wrong; nothing more is run."""
        sheet_of(context).busy = False
        self.report({"ERROR"}, text)
        return False

    def go_on(self, context):
        """Return whether something still runs after a command has ended."""
        _, told = self.process.communicate()
        if self.process.returncode not in FINE:
            lines = told.strip().splitlines()
            return self.fail(context, lines[-1] if lines else "toonset was ended")
        if self.steps:
            return self.next(context)
        try:
            show(context, sheet_of(context))
        except (OSError, KeyError, ValueError, RuntimeError) as error:
            return self.fail(context, f"what toonset wrote cannot be imported: {error}")
        sheet_of(context).busy = False
        return False

    def execute(self, context):
        """Do all of it at once: in scripts and without a window."""
        runs = self.begin(context)
        if not runs:
            return {"CANCELLED"}
        while self.go_on(context):
            pass
        done = self.process.returncode in FINE and not self.steps
        return {"FINISHED"} if done else {"CANCELLED"}

    def invoke(self, context, event):
        """Do it while Blender goes on."""
        if not self.begin(context):
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(WAIT_S, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Look whether the command has ended; Escape ends it."""
        if event.type == "ESC":
            self.process.terminate()
            self.process.communicate()
            self.fail(context, "ended; nothing has changed")
        elif event.type != "TIMER" or self.process.poll() is None or self.go_on(context):
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        return {"FINISHED"}


class TOONSET_PT_sheet(bpy.types.Panel):
    """The panel."""

    bl_label = "Character sheet"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "toonset"

    def draw(self, context):
        """Show sheet, drawings and their compasses."""
        sheet, layout = sheet_of(context), self.layout
        layout.prop(sheet, "path")
        layout.prop(sheet, "mannequin")
        layout.operator("toonset.find", text="Finding (Esc ends)" if sheet.busy else "Find cameras")
        for drawing in sheet.drawings:
            row = layout.row(align=True)
            row.label(text=drawing.name, icon=ICONS.get(drawing.verdict, "NONE"))
            row.prop(drawing, "yaw", text="")
            row.prop(drawing, "said", text="", icon="PINNED" if drawing.said else "UNPINNED")
            if drawing.reason:
                layout.label(text=drawing.reason)


CLASSES = (SheetPreferences, Drawing, Sheet, TOONSET_OT_find, TOONSET_PT_sheet)


def register():
    """Add the panel."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.WindowManager.toonset_sheet = bpy.props.PointerProperty(type=Sheet)


def unregister():
    """Take it away."""
    del bpy.types.WindowManager.toonset_sheet
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
'''
