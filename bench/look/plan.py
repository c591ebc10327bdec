"""What the look bench compares: the default look, and it without each of its parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from bench.charts.chart import DEFAULT
from toonset.camera import Camera
from toonset.nerf.look.blend import flanking
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.options import TrainOptions

Layer = Literal["drawn", "rgb", "palette"]
Part = Literal["", "flow", "vote"]


@dataclass(frozen=True)
class Recipe:
    """A training that looks share.

    Attributes:
        options: the seed aside.
        paint: bend the drawings until their paint agrees.
    """

    options: TrainOptions = TrainOptions()
    paint: bool = True


@dataclass(frozen=True)
class Look:
    """One way to show new views.

    Attributes:
        layer: that is shown.
        recipe: of the field.
        without: the part of the drawn look that is left out: the flow between drawings, or the
            vote: the nearest drawing alone is shown.
    """

    layer: Layer = "drawn"
    recipe: Recipe = Recipe()
    without: Part = ""


NO_MANNEQUIN = Recipe(TrainOptions(mannequin=False))
FIELD = "field only"
LOOKS: dict[str, Look] = {
    DEFAULT: Look(),
    "without the mannequin": Look(recipe=NO_MANNEQUIN),
    "without paint agreement": Look(recipe=Recipe(paint=False)),
    "without flow": Look(without="flow"),
    "nearest drawing": Look(without="vote"),
    FIELD: Look("rgb"),
    "field only, no mannequin": Look("rgb", NO_MANNEQUIN),
    "palette layer": Look("palette"),
}


class Variant:
    """The drawings of a run, as a look has them for a view."""

    def __init__(self, drawings: Drawings, without: Part) -> None:
        """Take the drawings and what the look leaves out."""
        self._without = without
        self._whole = replace(drawings, flows=()) if without == "flow" else drawings
        self._alone: dict[int, Drawings] = {}

    def seen_by(self, camera: Camera) -> Drawings:
        """Return the drawings to put a view together from."""
        if self._without != "vote":
            return self._whole
        nearest, _, _ = flanking([view.camera for view in self._whole.views], camera)
        if nearest not in self._alone:
            view = self._whole.views[nearest]
            self._alone[nearest] = replace(self._whole, views=(view,), flows=())
        return self._alone[nearest]
