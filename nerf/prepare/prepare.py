"""Prepare drawings before a field is fitted to them.

Where the mannequin is the body that was drawn, drawings are bent to show it (`to_mannequin`). Else
each only where the drawings ask for it: cameras follow drawings that were placed or
sized off (`registration`), bends are taken out of drawings (`unwarp`). Drawings whose shape is made
of sections are left as they are: so few outlines would be bent to fit each other's errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from toonset.dataset.bundle.scene import Scene
from toonset.nerf.hull.mannequin_fit import MannequinFit
from toonset.nerf.hull.mannequin_shape import Shape
from toonset.nerf.hull.scene_hull import has_sections
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.outlines import without_outlines
from toonset.nerf.prepare.paint_agreement import Depths, PaintAgreement, with_paint_agreed
from toonset.nerf.prepare.registration import Registration, register_drawings
from toonset.nerf.prepare.to_mannequin import Posed, posed
from toonset.nerf.prepare.unwarp import Unwarping, unwarp_drawings

AGREE_PX = 0.1  # outlines this near agree (docs/decisions.md)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene that is ready to be fitted, and what was done to it.

    Attributes:
        scene: the drawings, agreeing with each other.
        drawn: what they were made of: as drawn, perhaps with room round the figures.
        registration: how cameras moved; None: switched off.
        unwarping: how drawings were bent; None: switched off.
        paint: what their paint said of bends and colours; None: drawings were not bent.
        mannequin: what speaks for the mannequin's shape; None: there is none, or switched off.
        shape: the mannequin's, where it is the character's; None: it is not.
        compared: whether outlines were compared; else nobody knows whether they agree.
    """

    scene: Scene
    drawn: Scene
    registration: Registration | None
    unwarping: Unwarping | None
    paint: PaintAgreement | None = None
    mannequin: MannequinFit | None = None
    shape: Shape | None = None
    compared: bool = True

    @cached_property
    def fitted(self) -> Scene:
        """Return the drawings that a field is fitted to: few ones without their outlines."""
        return self.scene if self.compared else without_outlines(self.scene)

    @property
    def apart_px(self) -> float:
        """Return by how much outlines still disagree, root mean square; 0: as exact as pixels."""
        steps = (self.registration, self.unwarping)
        applied = [step for step in steps if step and step.applied]
        return applied[-1].apart_px[1] if applied else 0.0

    @property
    def bent(self) -> bool:
        """Return whether drawings were bent."""
        return self.unwarping is not None and self.unwarping.applied

    @property
    def agree(self) -> bool:
        """Return whether outlines agree, as they are or once cameras follow them.

        Bent drawings never do: their faces and seams are drawn as wrongly as their outlines.
        """
        return self.compared and not self.bent and self.apart_px < AGREE_PX

    def to_json(self) -> dict[str, Any]:
        """Return what was found and done, for a report."""
        registration, unwarping = self.registration, self.unwarping
        return {
            "mannequin": None if self.mannequin is None else self.mannequin.to_json(),
            "registration": None if registration is None else registration.to_json(),
            "unwarping": None if unwarping is None else unwarping.to_json(),
            "paint": None if self.paint is None else self.paint.to_json(),
            "without_outlines": self.fitted is not self.scene,
        }


def prepare(scene: Scene, options: TrainOptions) -> Prepared:
    """Return the scene as `options` want it prepared.

    Args:
        scene: posed drawings.
        options: its `mannequin`, `register` and `unwarp` switch the steps.

    Raises:
        MeshError: the mannequin lies in none of the pictures.
    """
    given = posed(scene, unwarp=options.unwarp) if options.mannequin else Posed.left_alone(scene)
    straight, unwarping = given.scene, given.unwarping
    registration = None
    compared = given.shape is not None or not has_sections(scene, options)
    if given.shape is None and compared:
        straight, registration, unwarping = aligned(scene, options.register, options.unwarp)
    return Prepared(
        straight, given.drawn, registration, unwarping, None, given.fit, given.shape, compared
    )


def agree_on_paint(ready: Prepared, depth_of: Depths, height: float) -> Prepared:
    """Bend and tint bent drawings further until their paint agrees over a hull.

    Args:
        ready: where its drawings did not bend, it is returned as it is.
        depth_of: the body's surface as a camera sees it, nan where there is none.
        height: of the figure, world units.
    """
    unwarping = ready.unwarping
    if unwarping is None or not unwarping.applied:
        return ready
    agreed = with_paint_agreed(ready.drawn, ready.scene, unwarping.warps, depth_of, height)
    scene, warps, found = agreed
    unwarping = replace(unwarping, warps=warps)
    return replace(ready, scene=scene, unwarping=unwarping, paint=found)


def aligned(
    scene: Scene, register: bool = True, unwarp: bool = True
) -> tuple[Scene, Registration | None, Unwarping | None]:
    """Return the scene with drawings set right that disagree, and what was found of each kind.

    Bends hold shifts and sizes, too: cameras are moved only where the drawings are more likely
    placed off, and perhaps bent besides, than bent alone.

    Args:
        scene: posed drawings.
        register: whether cameras may move; else there is no registration.
        unwarp: whether drawings may be bent; else there is no unwarping.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    placed, registration = register_drawings(scene) if register else (scene, None)
    if not unwarp:
        return placed, registration, None
    straight, unwarping = unwarp_drawings(scene)
    if registration is None or not registration.applied:
        return straight, registration, unwarping
    rest, left = unwarp_drawings(placed)
    if registration.gain_nats + max(0.0, left.gain_nats) >= unwarping.gain_nats:
        return rest, registration, left
    return straight, replace(registration, applied=False), unwarping
