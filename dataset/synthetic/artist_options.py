"""Define the sizes of what artists do besides smooth drawing errors; 0 leaves one out.

No heavy imports: the command line reads the defaults.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from toonset.errors import SheetError


def check_ranges(options: object, limits: Mapping[str, tuple[float, float]]) -> None:
    """Refuse options outside of their limits.

    Raises:
        SheetError: a number is out of its range, or none.
    """
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        if not low <= value <= high:  # NaN, too
            raise SheetError(f"synth: {name} is {value}, {low:g} to {high:g} is needed; change it")


@dataclass(frozen=True)
class BodyErrors:
    """Sizes of the errors of one drawing's body; see `body_error`.

    Attributes:
        head_turn_deg: the head is turned about the neck by up to this, and tilted by half of it.
        arm_swing_deg: each arm is swung about its shoulder, ahead and sideways, by up to this.
        face_turn_deg: the face is pulled round the head towards the viewer, by this in side views.
        field_height_fraction: root mean square of a smooth displacement of all points over the
            body's height.
    """

    head_turn_deg: float = 0.0
    arm_swing_deg: float = 0.0
    face_turn_deg: float = 0.0
    field_height_fraction: float = 0.0

    def __post_init__(self) -> None:
        """Refuse bodies that fold over.

        Raises:
            SheetError: a number is out of its range.
        """
        check_ranges(
            self,
            {
                "head_turn_deg": (0, 45),
                "arm_swing_deg": (0, 45),
                "face_turn_deg": (0, 45),
                "field_height_fraction": (0, 0.05),
            },
        )

    def scaled(self, factor: float) -> BodyErrors:
        """Return all errors `factor` times as large."""
        return BodyErrors(**{name: factor * value for name, value in asdict(self).items()})


@dataclass(frozen=True)
class Brushwork:
    """Sizes of a painter's shading; see `soft_shade`.

    Attributes:
        soft_light: how much of its light paint loses on the side away from the light.
        hollows: how much more it loses in hollows.
        strokes: standard deviation of the brush's unevenness, of the light.
        line_tint: share of the paint's own colour in the lines, which are black without.
    """

    soft_light: float = 0.0
    hollows: float = 0.0
    strokes: float = 0.0
    line_tint: float = 0.0

    def __post_init__(self) -> None:
        """Refuse shares without a meaning.

        Raises:
            SheetError: a number is out of its range.
        """
        limits = {"soft_light": (0, 0.9), "hollows": (0, 0.9), "strokes": (0, 0.3)}
        check_ranges(self, {**limits, "line_tint": (0, 0.9)})


@dataclass(frozen=True)
class ArtistOptions:
    """Sizes of what artists do besides; `SynthOptions` has the rest of a drawing.

    Attributes:
        body: every drawing shows another body.
        elevation_jitter_deg: standard deviation of the views' elevation.
        shadow_strength: how much darker a two-tone shadow is: 0.3 takes 30 % of red, less of blue.
            Its light stays with the camera.
        line_width_spread: lines are wider or thinner by up to this share in a view, and again by
            half of it along the line.
        color_error_fraction: red, green and blue of a view are off by up to this share.
        grain_levels: standard deviation of the paper's grain, of 255.
        captions: "FRONT", "3/4", ... under the figures.
        height_lines: ruled behind the figures of a row, at equal steps from the soles to the top of
            the head; 0 = none.
        title: the character's name, above the figures.
        jpeg_quality: of the sheet's file; 0 = PNG.
        brush: a painter's shading.
    """

    body: BodyErrors = BodyErrors()
    elevation_jitter_deg: float = 0.0
    shadow_strength: float = 0.0
    line_width_spread: float = 0.0
    color_error_fraction: float = 0.0
    grain_levels: float = 0.0
    captions: bool = False
    height_lines: int = 0
    title: bool = False
    jpeg_quality: int = 0
    brush: Brushwork = Brushwork()

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            SheetError: a number is out of its range.
        """
        check_ranges(
            self,
            {
                "elevation_jitter_deg": (0, 20),
                "shadow_strength": (0, 0.9),
                "line_width_spread": (0, 0.9),
                "color_error_fraction": (0, 0.5),
                "grain_levels": (0, 64),
                "height_lines": (0, 100),
                "jpeg_quality": (0, 95),
            },
        )

    @property
    def on_paper(self) -> bool:
        """Return whether any of it needs an opaque background."""
        text = self.captions or self.title or self.height_lines > 0
        return text or self.grain_levels > 0 or self.jpeg_quality > 0
