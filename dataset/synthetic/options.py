"""Define the options of a synthetic turnaround. Imports nothing heavy."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from toonset.dataset.synthetic.artist_options import (
    ArtistOptions,
    BodyErrors,
    Brushwork,
    check_ranges,
)
from toonset.dataset.synthetic.directions import MOST_OF_HALF, Turn
from toonset.errors import SheetError

MAX_SAMPLES = 4096  # px a side of a supersampled cell: what off-screen buffers hold in < 1 GiB
HEX_COLOR = re.compile(r"#?[0-9a-fA-F]{6}")


@dataclass(frozen=True)
class SynthOptions:
    """Options of `toonset.dataset.synthetic.turnaround.make_turnaround`.

    Attributes:
        views: drawings; 8 is the usual turnaround.
        turn: which directions they show (`directions`); unless it is even, the seed says whether
            the character's left or right side is drawn first.
        cell_px: width and height of one drawing's cell; 300 shows every colour of a character.
        columns: drawings in a row of the sheet; 0 = all in one row, as artists mostly draw.
        yaw_jitter_deg: each view is turned too far or too little by up to this; front and back
            of a half turn are not.
        elevation_deg: all cameras look down by this; 0 is the drawing board's view.
        distance_heights: camera distance in body heights; 0 = orthographic, as sheets mostly are.
        outline_px: width of the silhouette's black line, 0 = no lines; inner lines are 0.6 of it.
            2.5 is about 1 % of a 300 px cell, a usual brush.
        label_lines: draw inner lines between colours, too, not only at depth jumps.
        warp_percent: root mean square of the smooth drawing error over the figure, in percent of
            the cell; 0 is perfect, 0.5 to 1.5 are careful hands.
        scale_error_percent: each view is drawn larger or smaller by up to this.
        following_parts: mesh parts that keep facing the viewer (the ears of a famous mouse).
        background: "white", "transparent" or a colour such as "#aabbcc"; artists export white.
        supersample: samples per pixel and axis for anti-aliasing; 3 gives 10 levels or more.
        artist: what artists do besides: other bodies, shadow, paper.
    """

    views: int = 8
    turn: Turn = "even"
    cell_px: int = 300
    columns: int = 0
    yaw_jitter_deg: float = 0.0
    elevation_deg: float = 0.0
    distance_heights: float = 0.0
    outline_px: float = 2.5
    label_lines: bool = True
    warp_percent: float = 0.0
    scale_error_percent: float = 0.0
    following_parts: tuple[str, ...] = ()
    background: str = "white"
    supersample: int = 3
    artist: ArtistOptions = ArtistOptions()

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            SheetError: a number is out of its range, the background is not a colour, or there is no
                paper for what would be on it.
        """
        limits = {
            "views": (1, MOST_OF_HALF if self.turn == "half" else 360),
            "cell_px": (16, MAX_SAMPLES // max(self.supersample, 1)),
            "columns": (0, self.views),
            "yaw_jitter_deg": (0, 180),
            "elevation_deg": (-89, 89),
            "distance_heights": (0, 1e6),
            "outline_px": (0, self.cell_px / 10),
            "warp_percent": (0, 5),
            "scale_error_percent": (0, 50),
            "supersample": (1, 16),
        }
        check_ranges(self, limits)
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
