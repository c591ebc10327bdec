"""Define the sizes of what artists do besides smooth drawing errors; 0 leaves one out.

No heavy imports: the command line reads the defaults.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated

from toonset.errors import SheetError
from toonset.options import Option, check_ranges, described


@described
@dataclass(frozen=True)
class BodyErrors:
    """Sizes of the errors of one drawing's body; see `body_error`."""

    head_turn_deg: Annotated[
        float,
        Option(
            "The head is turned about the neck by up to this, and tilted by half of it.",
            flag=None,
            least=0,
            most=45,
        ),
    ] = 0.0
    arm_swing_deg: Annotated[
        float,
        Option(
            "Each arm is swung about its shoulder, ahead and sideways, by up to this.",
            flag=None,
            least=0,
            most=45,
        ),
    ] = 0.0
    face_turn_deg: Annotated[
        float,
        Option(
            "The face is pulled round the head towards the viewer, by this in side views.",
            flag=None,
            least=0,
            most=45,
        ),
    ] = 0.0
    field_height_fraction: Annotated[
        float,
        Option(
            "Root mean square of a smooth displacement of all points over the body's height.",
            flag=None,
            least=0,
            most=0.05,
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        """Refuse bodies that fold over.

        Raises:
            SheetError: a number is out of its range.
        """
        check_ranges(self, SheetError, "synth: ")

    def scaled(self, factor: float) -> BodyErrors:
        """Return all errors `factor` times as large."""
        return BodyErrors(**{name: factor * value for name, value in asdict(self).items()})


@described
@dataclass(frozen=True)
class Brushwork:
    """Sizes of a painter's shading; see `soft_shade`."""

    soft_light: Annotated[
        float,
        Option(
            "How much of its light paint loses on the side away from the light.",
            flag=None,
            least=0,
            most=0.9,
        ),
    ] = 0.0
    hollows: Annotated[
        float, Option("How much more it loses in hollows.", flag=None, least=0, most=0.9)
    ] = 0.0
    strokes: Annotated[
        float,
        Option(
            "Standard deviation of the brush's unevenness, of the light.",
            flag=None,
            least=0,
            most=0.3,
        ),
    ] = 0.0
    line_tint: Annotated[
        float,
        Option(
            "Share of the paint's own colour in the lines, which are black without.",
            flag=None,
            least=0,
            most=0.9,
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        """Refuse shares without a meaning.

        Raises:
            SheetError: a number is out of its range.
        """
        check_ranges(self, SheetError, "synth: ")


@described
@dataclass(frozen=True)
class ArtistOptions:
    """Sizes of what artists do besides; `SynthOptions` has the rest of a drawing."""

    body: Annotated[BodyErrors, Option("Every drawing shows another body.", flag=None)] = (
        BodyErrors()
    )
    elevation_jitter_deg: Annotated[
        float, Option("Standard deviation of the views' elevation.", flag=None, least=0, most=20)
    ] = 0.0
    shadow_strength: Annotated[
        float,
        Option(
            "How much darker a two-tone shadow is: 0.3 takes 30 % of red, less of blue. Its light "
            "stays with the camera.",
            flag=None,
            least=0,
            most=0.9,
        ),
    ] = 0.0
    line_width_spread: Annotated[
        float,
        Option(
            "Lines are wider or thinner by up to this share in a view, and again by half of it "
            "along the line.",
            flag=None,
            least=0,
            most=0.9,
        ),
    ] = 0.0
    color_error_fraction: Annotated[
        float,
        Option(
            "Red, green and blue of a view are off by up to this share.",
            flag=None,
            least=0,
            most=0.5,
        ),
    ] = 0.0
    grain_levels: Annotated[
        float,
        Option("Standard deviation of the paper's grain, of 255.", flag=None, least=0, most=64),
    ] = 0.0
    captions: Annotated[bool, Option('"FRONT", "3/4", ... under the figures.', flag=None)] = False
    height_lines: Annotated[
        int,
        Option(
            "Ruled behind the figures of a row, at equal steps from the soles to the top of the "
            "head; 0 = none.",
            flag=None,
            least=0,
            most=100,
        ),
    ] = 0
    title: Annotated[bool, Option("The character's name, above the figures.", flag=None)] = False
    jpeg_quality: Annotated[
        int, Option("Of the sheet's file; 0 = PNG.", flag=None, least=0, most=95)
    ] = 0
    brush: Annotated[Brushwork, Option("A painter's shading.", flag=None)] = Brushwork()

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            SheetError: a number is out of its range.
        """
        check_ranges(self, SheetError, "synth: ")

    @property
    def on_paper(self) -> bool:
        """Return whether any of it needs an opaque background."""
        text = self.captions or self.title or self.height_lines > 0
        return text or self.grain_levels > 0 or self.jpeg_quality > 0
