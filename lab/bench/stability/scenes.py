"""Scenes of the pages about training and look: posed drawings, held-out views that are true.

The base scene has eight drawings without lines and eight held-out views between them, all seen
from 8 degrees above; what goes wrong goes wrong with the drawings or their cameras, never with the
held-out views, unless the character itself is another.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool

from lab.bench.cases.bodies import SHIRT, random_body
from lab.bench.cases.cases import scene_of
from lab.bench.stability import sheets
from lab.bench.stability.bodies import EARS, recolored, with_arms_raised, with_ears, with_eyes
from lab.bench.stability.damage import Drawn, mirrored
from lab.bench.stability.sheets import Step, stream
from toonset.camera import rotation_from_angles
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import BEND_REACH, MARGIN, make_turnaround
from toonset.mesh import Mesh
from toonset.view import View

SCENE = SynthOptions(views=8, cell_px=80, elevation_deg=8, outline_px=0)
HELD_OUT = 16  # views all round, of which every second lies between two drawings


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """Drawings to train on, and held-out views.

    Attributes:
        train: as drawn, with the cameras that are believed.
        test: as it should look.
        where: per held-out view the pixels that count; None: all of them.
    """

    train: Scene
    test: Scene
    where: tuple[Bool[np.ndarray, "height width"], ...] | None = None


def draw_scene(seed: int, mesh: Mesh | None = None, **changes: Any) -> DrawnScene:
    """Return a scene of a mesh (the seed's body), held-out views without drawing error."""
    body, options = mesh or random_body(seed), replace(SCENE, **changes)
    truth = replace(options, views=HELD_OUT, yaw_jitter_deg=0, warp_percent=0)
    test = scene_of(make_turnaround(body, truth, seed))
    between = replace(test, frames=test.frames[1::2])
    return DrawnScene(scene_of(make_turnaround(body, options, seed)), between)


def with_usual_views(scene: DrawnScene, seed: int) -> DrawnScene:
    """Return the scene with the base scene's held-out views."""
    return replace(scene, test=draw_scene(seed).test)


def misturned(frame: Frame, degrees: float) -> Frame:
    """Return the frame with a camera whose yaw is so far off."""
    if not degrees:
        return frame
    yaw, elevation, roll = frame.camera.angles
    rotation = rotation_from_angles(yaw + math.radians(degrees), elevation, roll)
    camera = replace(frame.camera, rotation=rotation)
    return replace(frame, camera=camera)


def misscaled(frame: Frame, factor: float) -> Frame:
    """Return the frame with a camera of another scale."""
    return replace(frame, camera=replace(frame.camera, scale=frame.camera.scale * factor))


def shifted(share: float, seed: int) -> DrawnScene:
    """Return a scene whose cameras are shifted by a share of the picture, root mean square.

    The shifts are those that no place of the body explains.
    """
    scene = draw_scene(seed)
    cameras = [frame.camera for frame in scene.train.frames]
    moves = stream("shifts", seed).normal(size=2 * len(cameras))
    of_body = np.concatenate([camera.rotation[:2] for camera in cameras])
    moves -= of_body @ np.linalg.lstsq(of_body, moves, rcond=None)[0]
    moves = moves.reshape(-1, 2) * (np.sqrt(len(cameras)) / np.linalg.norm(moves))
    moves *= share * SCENE.cell_px
    frames = tuple(
        replace(frame, camera=replace(frame.camera, center=frame.camera.center + move))
        for frame, move in zip(scene.train.frames, moves, strict=True)
    )
    return replace(scene, train=replace(scene.train, frames=frames))


def with_room(options: SynthOptions, percent: float) -> SynthOptions:
    """Return options of drawings bent by `percent` of the usual cell.

    Bends need room: the cells grow, so that the figures stay as large.
    """
    usual = options.cell_px
    cell = round(usual * (1 + BEND_REACH * percent / 100 / (0.5 - MARGIN)))
    return replace(options, cell_px=cell, warp_percent=percent * usual / cell)


def warped(percent: float, seed: int) -> DrawnScene:
    """Return a scene of drawings bent by `percent` of the usual cell."""
    bent = with_room(SCENE, percent)
    scene = draw_scene(seed, cell_px=bent.cell_px, warp_percent=bent.warp_percent)
    return with_usual_views(scene, seed)


def with_following_ears(share: float, seed: int) -> DrawnScene:
    """Return a scene of a body whose ears face whoever looks, held-out views included."""
    body = random_body(seed)
    eared = with_ears(body, share * body.height)
    return draw_scene(seed, eared, following_parts=EARS if share else ())


def with_tiny_eyes(share: float, seed: int) -> DrawnScene:
    """Return a scene of a body with eyes of a share of the height; only these count."""
    body = random_body(seed)
    scene, blind = draw_scene(seed, with_eyes(body, share * body.height)), draw_scene(seed, body)
    pairs = zip(scene.test.frames, blind.test.frames, strict=True)
    return replace(scene, where=tuple((a.rgba != b.rgba).any(axis=-1) for a, b in pairs))


def blurred(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings without anti-aliasing, or blurred by `step` px, cut out."""
    return _cut_out(sheets.blurred(SCENE, step, seed), seed)


def compressed(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings cut out of a sheet that was a JPEG file of quality `step`."""
    return _cut_out(sheets.compressed(SCENE, step, seed), seed)


def changed(name: str, seed: int, change: Callable[[Frame, int], Frame]) -> DrawnScene:
    """Return the base scene with every frame changed to one of two sides."""
    scene = draw_scene(seed)
    return replace(scene, train=either(name, scene.train, seed, change))


def either(name: str, scene: Scene, seed: int, change: Callable[[Frame, int], Frame]) -> Scene:
    """Return the scene with every frame changed to one side, half of them to the other.

    In equal numbers, or the body as a whole would be of another size or turned.
    """
    sides = stream(name, seed).permutation(np.resize([-1, 1], len(scene.frames)))
    pairs = zip(scene.frames, sides.tolist(), strict=True)
    return replace(scene, frames=tuple(change(frame, side) for frame, side in pairs))


def one_turned(degrees: float, seed: int) -> DrawnScene:
    """Return a scene with one camera off by some degrees of yaw."""
    return _with_one("turned", seed, lambda frame: misturned(frame, degrees))


def one_odd(step: Step, seed: int) -> DrawnScene:
    """Return a scene of a drawing that is flipped left to right, in another pose, or shirt."""
    body = random_body(seed)
    if step == "flipped":
        return _with_one(
            "odd", seed, lambda frame: _redrawn(frame, lambda d: (mirrored(*d)[0], d[1]))
        )
    if step == "other pose":
        body = with_arms_raised(body, math.radians(40))
    if step == "other shirt":
        for part in ("trunk", "left arm", "right arm"):
            body = recolored(body, part, SHIRT[::-1])
    frames = {frame.name: frame for frame in draw_scene(seed, body).train.frames}
    return _with_one("odd", seed, lambda frame: frames[frame.name])


def _with_one(name: str, seed: int, change: Callable[[Frame], Frame]) -> DrawnScene:
    scene = draw_scene(seed)
    frames = list(scene.train.frames)
    number = int(stream(name, seed).integers(len(frames)))
    frames[number] = change(frames[number])
    return replace(scene, train=replace(scene.train, frames=tuple(frames)))


def redrawn(name: str, seed: int, change: Callable[[Drawn, int], Drawn]) -> DrawnScene:
    """Return the base scene with changed drawings; cameras have square pixels as before."""
    return changed(name, seed, lambda frame, side: _redrawn(frame, lambda d: change(d, side)))


def _redrawn(frame: Frame, change: Callable[[Drawn], Drawn]) -> Frame:
    height, width = frame.rgba.shape[:2]
    view, camera = change((View(frame.rgba, (0, 0, width, height), 0.0, frame.name), frame.camera))
    scale = camera.scale * math.sqrt(camera.pixel_aspect)
    return replace(frame, rgba=view.rgba, camera=replace(camera, scale=scale, pixel_aspect=1.0))


def _cut_out(found: sheets.DrawnSheet, seed: int) -> DrawnScene:
    frames = tuple(Frame(view.name, camera, view.rgba) for view, camera in found.drawings)
    return replace(draw_scene(seed), train=Scene(frames, None, found.mesh.name))
