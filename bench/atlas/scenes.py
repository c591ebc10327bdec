"""How every step of a training page draws its scene: posed drawings, held-out views that are true.

The base scene has eight drawings without lines and eight held-out views between them, all seen
from 8 degrees above; what goes wrong goes wrong with the drawings or their cameras, never with the
held-out views, unless the character itself is another.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from bench.cases.bodies import random_body
from bench.stability import draws
from bench.stability.bodies import EARS, with_contrast, with_ears, with_eyes
from bench.stability.damage import Drawn, stretched, with_gaps_closed
from bench.stability.sheet import Step, stream
from toonset.camera import rotation_from_angles
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import BEND_REACH, MARGIN, Turnaround, make_turnaround
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


def draw_scene(
    seed: int, options: SynthOptions | None = None, mesh: Mesh | None = None
) -> DrawnScene:
    """Return a scene of `mesh` (default: the seed's body), held-out views without drawing error."""
    body, options = mesh or random_body(seed), options or SCENE
    truth = replace(options, views=HELD_OUT, yaw_jitter_deg=0, warp_percent=0)
    made = make_turnaround(body, options, seed)
    return DrawnScene(_scene(made), _held_out(body, truth, seed))


def numbered(step: Step, seed: int) -> DrawnScene:
    """Return a scene of `step` drawings."""
    return draw_scene(seed, replace(SCENE, views=int(step)))


def uneven(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings turned too far or too little by up to `step` degrees."""
    return draw_scene(seed, replace(SCENE, yaw_jitter_deg=float(step)))


def misturned(step: Step, seed: int) -> DrawnScene:
    """Return a scene whose cameras are off by `step` degrees of yaw, as their sigma says."""
    error = math.radians(float(step))
    return _either("turns", seed, lambda frame, side: _turned(frame, side * error))


def misscaled(step: Step, seed: int) -> DrawnScene:
    """Return a scene whose cameras are too large or too small by `step` percent."""

    def change(frame: Frame, side: int) -> Frame:
        factor = (1 + float(step) / 100) ** side
        return replace(frame, camera=replace(frame.camera, scale=frame.camera.scale * factor))

    return _either("sizes", seed, change)


def shifted(step: Step, seed: int) -> DrawnScene:
    """Return a scene whose cameras are shifted by `step` percent of the picture, root mean square.

    The shifts are those that no place of the body explains.
    """
    scene = draw_scene(seed)
    cameras = [frame.camera for frame in scene.train.frames]
    moves = stream("shifts", seed).normal(size=2 * len(cameras))
    of_body = np.concatenate([camera.rotation[:2] for camera in cameras])
    moves -= of_body @ np.linalg.lstsq(of_body, moves, rcond=None)[0]
    moves = moves.reshape(-1, 2) * (np.sqrt(len(cameras)) / np.linalg.norm(moves))
    moves *= float(step) / 100 * SCENE.cell_px
    frames = tuple(
        replace(frame, camera=replace(frame.camera, center=frame.camera.center + move))
        for frame, move in zip(scene.train.frames, moves, strict=True)
    )
    return replace(scene, train=replace(scene.train, frames=frames))


def warped(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings bent by `step` percent of the usual cell.

    Bends need room: the cells grow, so that the figures stay as large.
    """
    usual, share = SCENE.cell_px, float(step) / 100
    cell = round(usual * (1 + BEND_REACH * share / (0.5 - MARGIN)))
    bent = replace(SCENE, cell_px=cell, warp_percent=100 * share * usual / cell)
    return replace(draw_scene(seed, bent), test=draw_scene(seed).test)


def squashed(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings stretched or squashed by `step` percent, seen by square pixels."""

    def change(frame: Frame, side: int) -> Frame:
        growth = (1 + float(step) / 100) ** side - 1
        return _redrawn(frame, lambda drawn: stretched(*drawn, growth))

    return _either("squash", seed, change)


def with_following_ears(step: Step, seed: int) -> DrawnScene:
    """Return a scene of a body whose ears face whoever looks, held-out views included."""
    body = random_body(seed)
    eared = with_ears(body, float(step) / 100 * body.height)
    return draw_scene(seed, replace(SCENE, following_parts=EARS if step else ()), eared)


def with_gaps_painted(step: Step, seed: int) -> DrawnScene:
    """Return a scene on which gaps up to `step` percent of the height are painted shut."""
    return _either(
        "gaps",
        seed,
        lambda frame, _: _redrawn(frame, lambda d: with_gaps_closed(*d, float(step) / 100)),
    )


def outlined(step: Step, seed: int) -> DrawnScene:
    """Return a scene with lines of `step` px, in the held-out views, too."""
    return draw_scene(seed, replace(SCENE, outline_px=float(step)))


def paler(step: Step, seed: int) -> DrawnScene:
    """Return a scene with `step` percent of the contrast between colours, everywhere."""
    return draw_scene(seed, mesh=with_contrast(random_body(seed), float(step) / 100))


def with_tiny_eyes(step: Step, seed: int) -> DrawnScene:
    """Return a scene of a body with eyes of `step` percent of the height; only these count."""
    body = random_body(seed)
    eyed = with_eyes(body, float(step) / 100 * body.height)
    scene, blind = draw_scene(seed, mesh=eyed), draw_scene(seed, mesh=body)
    pairs = zip(scene.test.frames, blind.test.frames, strict=True)
    return replace(scene, where=tuple((a.rgba != b.rgba).any(axis=-1) for a, b in pairs))


def compressed(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings cut out of a sheet that was a JPEG file of quality `step`."""
    return _through_sheet(seed, lambda sheet: draws.through_jpeg(sheet, step), SCENE)


def blurred(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings without anti-aliasing, or blurred by `step` px, cut out."""
    options = draws.without_samples(SCENE, step)
    return _through_sheet(seed, lambda sheet: draws.soft(sheet, step), options)


def sized(step: Step, seed: int) -> DrawnScene:
    """Return a scene of drawings of `step` px; held-out views have the usual size."""
    return replace(draw_scene(seed, replace(SCENE, cell_px=int(step))), test=draw_scene(seed).test)


def _through_sheet(
    seed: int, change: Callable[[draws.Rgba], draws.Rgba], options: SynthOptions
) -> DrawnScene:
    made = make_turnaround(random_body(seed), options, seed)
    found = draws.cut_out(made, change(made.sheet))
    frames = tuple(Frame(view.name, camera, view.rgba) for view, camera in found.drawings)
    return replace(draw_scene(seed), train=Scene(frames, None, made.mesh.name))


def _either(name: str, seed: int, change: Callable[[Frame, int], Frame]) -> DrawnScene:
    """Return the base scene with every frame changed to one side, half of them to the other.

    In equal numbers, or the body as a whole would be of another size or turned.
    """
    scene = draw_scene(seed)
    count = len(scene.train.frames)
    sides = stream(name, seed).permutation(np.resize([-1, 1], count))
    pairs = zip(scene.train.frames, sides.tolist(), strict=True)
    frames = tuple(change(frame, side) for frame, side in pairs)
    return replace(scene, train=replace(scene.train, frames=frames))


def _turned(frame: Frame, error: float) -> Frame:
    if not error:
        return frame
    yaw, elevation, roll = frame.camera.angles
    rotation = rotation_from_angles(yaw + error, elevation, roll)
    return replace(frame, camera=replace(frame.camera, rotation=rotation), yaw_sigma=abs(error))


def _redrawn(frame: Frame, change: Callable[[Drawn], Drawn]) -> Frame:
    """Return the frame with a changed drawing; its camera has square pixels as before."""
    height, width = frame.rgba.shape[:2]
    view, camera = change((View(frame.rgba, (0, 0, width, height), 0.0, frame.name), frame.camera))
    scale = camera.scale * math.sqrt(camera.pixel_aspect)
    return replace(frame, rgba=view.rgba, camera=replace(camera, scale=scale, pixel_aspect=1.0))


def _held_out(body: Mesh, options: SynthOptions, seed: int) -> Scene:
    scene = _scene(make_turnaround(body, options, seed))
    return replace(scene, frames=scene.frames[1::2])


def _scene(made: Turnaround) -> Scene:
    frames = zip(made.views, made.cameras, strict=True)
    return Scene(
        tuple(Frame(view.name, camera, view.rgba) for view, camera in frames), None, made.mesh.name
    )
