"""Sheets that are drawn right, a little off, or wrong, each with held-out views that are true.

A body with eyes, eight drawings from 8 degrees above with lines, and what goes wrong with drawings
or cameras. Held-out views are true: drawn sides as they should look, and sides half way between.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import UInt8

from bench.cases.bodies import SHIRT, random_body
from bench.stability.bodies import recolored, with_arms_raised, with_eyes
from bench.stability.damage import mirrored
from bench.stability.draws import through_jpeg
from bench.stability.sheet import stream
from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import BEND_REACH, MARGIN, make_turnaround
from toonset.mesh import Mesh
from toonset.view import View

SHEET = SynthOptions(views=8, cell_px=120, elevation_deg=8, outline_px=1.5, supersample=2)
EYES = 0.03  # radius over the body's height
HELD_OUT = 16  # views all round, of which every second is the side of a drawing
LIGHT = np.array([-0.55, -0.6, -0.58])  # towards it, in the camera's frame: above, left, before
SHADE = 0.72  # of the colour in the shadow
ORDINARY = 0.9  # % of the cell: the hand's error of sheets that are wrong in other ways


@dataclass(frozen=True)
class Fault:
    """A way in which a sheet is drawn.

    Attributes:
        name: of it.
        kind: "lined", "plain" (no lines) or "shaded".
        warp: drawing error, % of the cell.
        views: drawings.
        change: what else happens to the frames.
    """

    name: str
    kind: str = "lined"
    warp: float = ORDINARY
    views: int = SHEET.views
    change: Callable[[Scene, int], Scene] = lambda scene, _: scene


def draw_sheet(fault: Fault, seed: int, *, mannequin: bool = False) -> tuple[Scene, Scene]:
    """Return the seed's body, drawn with a fault, and held-out views as they should look.

    Args:
        fault: of the drawings.
        seed: of the body and the hand.
        mannequin: the body itself comes with the drawings.
    """
    body = _body(seed)
    options = _options(fault.kind, SHEET.views)
    truth = _scene(body, replace(options, views=HELD_OUT), seed, fault.kind)
    bent = _with_room(replace(options, views=fault.views), fault.warp)
    drawn = fault.change(_scene(body, bent, seed, fault.kind), seed)
    drawn = replace(drawn, mannequin=body if mannequin else None)
    return drawn, replace(truth, frames=truth.frames[::2] + truth.frames[1::4])


def _body(seed: int) -> Mesh:
    body = random_body(seed)
    return with_eyes(body, EYES * body.height)


def _options(kind: str, views: int) -> SynthOptions:
    return replace(SHEET, views=views, outline_px=0.0 if kind == "plain" else SHEET.outline_px)


def _with_room(options: SynthOptions, warp: float) -> SynthOptions:
    """Return the options with cells that have room for bends of figures of the same size."""
    usual, share = options.cell_px, warp / 100
    cell = round(usual * (1 + BEND_REACH * share / (0.5 - MARGIN)))
    return replace(options, cell_px=cell, warp_percent=warp * usual / cell)


def _scene(body: Mesh, options: SynthOptions, seed: int, kind: str) -> Scene:
    made = make_turnaround(body, options, seed)
    frames = [
        Frame(view.name, camera, view.rgba)
        for view, camera in zip(made.views, made.cameras, strict=True)
    ]
    if kind == "shaded":
        frames = [replace(frame, rgba=_shaded(frame, body)) for frame in frames]
    return Scene(tuple(frames), None, f"{kind} {seed}")


def _shaded(frame: Frame, body: Mesh) -> UInt8[np.ndarray, "height width 4"]:
    """Return the drawing with a shadow of one tone, whose light stays with the viewer."""
    found = render_labels(body, np.zeros(len(body.faces), dtype=int), frame.camera)
    depth = np.where(np.isfinite(found.depth), found.depth, np.nan) * frame.camera.scale
    down, right = np.gradient(depth)
    normal = np.stack([right, down, -np.ones_like(depth)], axis=-1)
    light = (normal @ LIGHT) / np.linalg.norm(normal, axis=-1)
    dark = cv2.GaussianBlur((np.nan_to_num(light, nan=1.0) < 0.15).astype(np.float32), (0, 0), 0.7)
    rgba = frame.rgba.astype(np.float32)
    rgba[..., :3] *= 1 - (1 - SHADE) * dark[..., None]
    return np.rint(rgba).astype(np.uint8)


# ---- what goes wrong besides


def turned(degrees: float, count: int) -> Callable[[Scene, int], Scene]:
    """Return what turns `count` cameras by so much, left or right, and is believed of them."""

    def change(scene: Scene, seed: int) -> Scene:
        rng = stream("turned", seed)
        chosen = rng.permutation(len(scene.frames))[:count]
        sides = rng.permutation(np.resize([-1, 1], count))
        frames = list(scene.frames)
        for number, side in zip(chosen, sides, strict=True):
            yaw, elevation, roll = frames[number].camera.angles
            rotation = rotation_from_angles(yaw + side * math.radians(degrees), elevation, roll)
            camera = replace(frames[number].camera, rotation=rotation)
            frames[number] = replace(frames[number], camera=camera)
        return replace(scene, frames=tuple(frames))

    return change


def odd(make: Callable[[Frame, int], Frame]) -> Callable[[Scene, int], Scene]:
    """Return what changes one drawing."""

    def change(scene: Scene, seed: int) -> Scene:
        number = int(stream("odd", seed).integers(len(scene.frames)))
        frames = list(scene.frames)
        frames[number] = make(frames[number], seed)
        return replace(scene, frames=tuple(frames))

    return change


def posed(frame: Frame, seed: int) -> Frame:
    """Return the frame of the body with raised arms."""
    body = with_arms_raised(_body(seed), math.radians(40))
    return _drawn_again(frame, body, seed)


def other_colors(frame: Frame, seed: int) -> Frame:
    """Return the frame of the body in another shirt."""
    body = _body(seed)
    for part in ("trunk", "left arm", "right arm"):
        body = recolored(body, part, SHIRT[::-1])
    return _drawn_again(frame, body, seed)


def flipped(frame: Frame, _: int) -> Frame:
    """Return the frame with its drawing flipped left to right, its camera as before."""
    height, width = frame.rgba.shape[:2]
    view, _camera = mirrored(View(frame.rgba, (0, 0, width, height), 0.0, frame.name), frame.camera)
    return replace(frame, rgba=view.rgba)


def _drawn_again(frame: Frame, body: Mesh, seed: int) -> Frame:
    options = _options("lined", 1)
    made = make_turnaround(body, replace(options, views=HELD_OUT), seed)
    yaw = frame.camera.angles[0] % (2 * math.pi)
    away = [abs((turn - yaw + math.pi) % (2 * math.pi) - math.pi) for turn in made.yaws]
    number = int(np.argmin(away))
    return Frame(frame.name, made.cameras[number], made.views[number].rgba)


def blurred(sigma_px: float) -> Callable[[Scene, int], Scene]:
    """Return what blurs the drawings."""
    return _on_paper(lambda sheet: np.asarray(cv2.GaussianBlur(sheet, (0, 0), sigma_px)))


def compressed(quality: int) -> Callable[[Scene, int], Scene]:
    """Return what saves drawings on white as JPEG."""
    return _on_paper(lambda sheet: through_jpeg(sheet, quality))


def _on_paper(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Scene, int], Scene]:
    def one(frame: Frame) -> Frame:
        alpha = frame.rgba[..., 3:] / 255
        white = frame.rgba[..., :3] * alpha + 255 * (1 - alpha)
        sheet = np.dstack([np.rint(white), np.full(alpha.shape[:2], 255)]).astype(np.uint8)
        found = split_picture(change(sheet)).views
        view = max(found, key=lambda v: int(v.mask.sum()))
        x, y = view.box[:2]
        size_wh = (view.rgba.shape[1], view.rgba.shape[0])
        return replace(frame, rgba=view.rgba, camera=frame.camera.moved((x, y), size_wh))

    return lambda scene, _: replace(scene, frames=tuple(map(one, scene.frames)))


def small(factor: float) -> Callable[[Scene, int], Scene]:
    """Return what shrinks the drawings."""

    def one(frame: Frame) -> Frame:
        height, width = frame.rgba.shape[:2]
        size = (round(width * factor), round(height * factor))
        view = View(frame.rgba, (0, 0, width, height), 0.0, frame.name).resized(size)
        camera: Camera = frame.camera.resized(size[0] / width)
        return replace(frame, rgba=view.rgba, camera=replace(camera, size_wh=size))

    return lambda scene, _: replace(scene, frames=tuple(map(one, scene.frames)))


FAULTS = (
    Fault("exact", warp=0),
    Fault("plain exact", "plain", 0),
    Fault("shaded exact", "shaded", 0),
    Fault("warp 0.5", warp=0.5),
    Fault("warp 0.9"),
    Fault("warp 1.2", warp=1.2),
    Fault("warp 2", warp=2),
    Fault("warp 3", warp=3),
    Fault("plain warp 0.9", "plain"),
    Fault("plain warp 3", "plain", 3),
    Fault("shaded warp 0.9", "shaded"),
    Fault("shaded warp 2", "shaded", 2),
    Fault("yaw 3 all", change=turned(3, 8)),
    Fault("yaw 10 all", change=turned(10, 8)),
    Fault("yaw 20 one", change=turned(20, 1)),
    Fault("yaw 45 one", change=turned(45, 1)),
    Fault("6 views", views=6),
    Fault("5 views", views=5),
    Fault("4 views", views=4),
    Fault("3 views", views=3),
    Fault("other pose", change=odd(posed)),
    Fault("flipped", change=odd(flipped)),
    Fault("other colours", change=odd(other_colors)),
    Fault("blur 1", change=blurred(1.0)),
    Fault("JPEG 20", change=compressed(20)),
    Fault("60 px", change=small(0.5)),
)
