"""Define the options of a synthetic turnaround. Imports nothing heavy."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Annotated

from toonset.dataset.synthetic.artist_options import ArtistOptions, BodyErrors, Brushwork
from toonset.dataset.synthetic.directions import MOST_OF_HALF, Turn
from toonset.errors import SheetError
from toonset.options import Option, check_ranges, described

MAX_SAMPLES = 4096  # px a side of a supersampled cell: what off-screen buffers hold in < 1 GiB
HEX_COLOR = re.compile(r"#?[0-9a-fA-F]{6}")


@described
@dataclass(frozen=True)
class SynthOptions:
    """How a turnaround of a mesh is drawn."""

    views: Annotated[
        int,
        Option(
            "Drawings, evenly round; studio (4, at most 8): front, back, side, 3/4 first.",
            least=1,
            most=360,
        ),
    ] = 8  # the usual turnaround
    turn: Annotated[
        Turn,
        Option(
            "Which directions they show (`directions`); unless it is even, the seed says whether "
            "the character's left or right side is drawn first.",
            flag=None,
        ),
    ] = "even"
    cell_px: Annotated[
        int, Option("Side of a drawing's cell, px.", flag="--cell", least=16, most=MAX_SAMPLES)
    ] = 300  # shows every colour of a character
    columns: Annotated[int, Option("Drawings in a row; 0 = all.", least=0)] = 0
    yaw_jitter_deg: Annotated[
        float,
        Option(
            "Each view is turned wrongly by up to this, degrees.",
            flag="--yaw-jitter",
            least=0,
            most=180,
        ),
    ] = 0.0
    elevation_deg: Annotated[
        float, Option("Cameras look down by this, degrees.", flag="--elevation", least=-89, most=89)
    ] = 0.0
    distance_heights: Annotated[
        float,
        Option(
            "Camera distance in body heights; 0 = orthographic.",
            flag="--distance",
            least=0,
            most=1e6,
        ),
    ] = 0.0
    outline_px: Annotated[
        float, Option("Width of the black outline, px; 0 = none.", flag="--outline", least=0)
    ] = 2.5  # about 1 % of a 300 px cell, a usual brush; inner lines are 0.6 of it
    label_lines: Annotated[
        bool, Option("Draw lines between colours, too.", flag="--label-lines/--no-label-lines")
    ] = True
    warp_percent: Annotated[
        float,
        Option("Smooth drawing error (rms), percent of the cell.", flag="--warp", least=0, most=5),
    ] = 0.0  # 0.5 to 1.5 are careful hands
    scale_error_percent: Annotated[
        float,
        Option(
            "Each view is larger or smaller by up to this, percent.",
            flag="--scale-error",
            least=0,
            most=50,
        ),
    ] = 0.0
    following_parts: Annotated[
        tuple[str, ...],
        Option(
            "Mesh part that keeps facing the viewer; repeatable.",
            flag="--following",
            metavar="PART",
        ),
    ] = ()
    background: Annotated[str, Option("white, transparent or #rrggbb.")] = "white"
    supersample: Annotated[
        int,
        Option(
            "Samples per pixel and axis for anti-aliasing; 3 gives 10 levels or more.",
            flag=None,
            least=1,
            most=16,
        ),
    ] = 3
    artist: ArtistOptions = ArtistOptions()

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            SheetError: a number is out of its range, the background is not a colour, or there is no
                paper for what would be on it.
        """
        check_ranges(self, SheetError, "synth: ")
        most = {
            "views": MOST_OF_HALF if self.turn == "half" else self.views,
            "cell_px": MAX_SAMPLES // self.supersample,
            "columns": self.views,
            "outline_px": self.cell_px / 10,
        }
        for name, limit in most.items():
            if getattr(self, name) > limit:
                said = f"synth: {name}: {getattr(self, name)} is out of range"
                raise SheetError(f"{said}; give {limit:g} at most beside the other options")
        if self.background not in ("white", "transparent") and not HEX_COLOR.fullmatch(
            self.background
        ):
            raise SheetError(
                f"synth: background {self.background!r} is none of white, transparent, #rrggbb"
            )
        if self.background == "transparent" and self.artist.on_paper:
            raise SheetError(
                "synth: grain, text, ruled lines and JPEG need paper, the background is "
                "transparent; choose white or #rrggbb"
            )

    def without_error(self, views: int) -> SynthOptions:
        """Return options of `views` exact pictures in the same style, all round, on white.

        Lines, shadow, elevation and distance stay; whatever differs from view to view goes. Where
        one side is drawn, the first half shows that side and the second half the other.
        """
        return replace(
            self,
            views=views,
            turn="even" if self.turn == "even" else "between",
            columns=0,
            yaw_jitter_deg=0.0,
            warp_percent=0.0,
            scale_error_percent=0.0,
            background="white",
            artist=ArtistOptions(
                shadow_strength=self.artist.shadow_strength, brush=self.artist.brush
            ),
        )

    @property
    def background_rgb(self) -> tuple[int, int, int] | None:
        """Return the background's sRGB; None = transparent."""
        if self.background == "transparent":
            return None
        if self.background == "white":
            return 255, 255, 255
        red, green, blue = bytes.fromhex(self.background.removeprefix("#"))
        return red, green, blue


ARTIST = ArtistOptions(
    body=BodyErrors(
        head_turn_deg=4.0, arm_swing_deg=5.0, face_turn_deg=6.0, field_height_fraction=0.01
    ),
    elevation_jitter_deg=1.0,
    shadow_strength=0.3,
    line_width_spread=0.3,
    color_error_fraction=0.03,
    grain_levels=1.3,
    captions=True,
    jpeg_quality=88,
)
STUDIO = ArtistOptions(
    body=BodyErrors(
        head_turn_deg=6.0, arm_swing_deg=8.0, face_turn_deg=4.0, field_height_fraction=0.008
    ),
    line_width_spread=0.35,
    height_lines=6,
    title=True,
)
PAINTER = ArtistOptions(
    body=BodyErrors(head_turn_deg=3.0, arm_swing_deg=4.0, field_height_fraction=0.006),
    line_width_spread=0.3,
    grain_levels=1.0,
    jpeg_quality=90,
    brush=Brushwork(soft_light=0.6, hollows=0.5, strokes=0.05, line_tint=0.35),
)
CONDITIONS: dict[str, SynthOptions] = {
    "plain": SynthOptions(),
    "artist": SynthOptions(
        yaw_jitter_deg=5.0,
        elevation_deg=4.0,
        distance_heights=8.0,  # nearly orthographic
        label_lines=False,
        warp_percent=0.7,  # of the cell: 0.8 % of a figure's height
        background="#f4f1e8",  # off-white paper
        artist=ARTIST,
    ),
    "studio": SynthOptions(
        views=4,
        turn="half",
        yaw_jitter_deg=4.0,
        distance_heights=14.0,  # nearly orthographic
        label_lines=False,
        warp_percent=0.5,  # of the cell: 0.6 % of a figure's height
        artist=STUDIO,
    ),
    "painted": SynthOptions(
        views=4,
        turn="half",
        yaw_jitter_deg=4.0,
        distance_heights=14.0,  # nearly orthographic
        outline_px=1.5,  # half as wide as a cartoon's
        label_lines=False,
        warp_percent=0.4,
        background="#f7f6f3",
        artist=PAINTER,
    ),
}
