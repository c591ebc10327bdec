"""Apply a person's corrections to a palette and its label maps.

Every colour that was found has colours that it becomes: itself; the one that it is merged into;
those that it is split into; all that are left, if it is dropped. A pixel that was labelled with it
gets the nearest of them (on painted sheets: the one on whose ramp it lies), so no other pixel
changes. Shares and tones go the same way. Labels are numbered anew, since colours stand by their
share, after those that the sheet prints in their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.errors import PaletteError
from toonset.palette.color_names import name_of, with_codes
from toonset.palette.corrections import PaletteCorrections, Stroke
from toonset.palette.extract import IN_LIGHT, PaintMap, in_light, maps_in_light
from toonset.palette.names import RGB, hex_of, rgb_of_hex
from toonset.palette.palette import MOST_TONES, ContourColor, Palette, PaletteColor, Tone
from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.cel_tones import step_tones
from toonset.palette.pixels.labels import UNLABELLED, Space, nearest_colors
from toonset.palette.pixels.ramp_labels import Ramp, plain_ramp, ramp_of
from toonset.palette.pixels.shadow import DRAWN, apply_shadow
from toonset.palette.printed import printed_places
from toonset.palette.shaded import shaded_labels, with_own_tones

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]

NEAR_LEVELS = 6  # in every channel: a palette that is found anew can differ by that much
BY_HAND = "; corrected by hand"  # of a palette's rule
LEAST_PART = 0.01  # of a painted colour's pixels that each part of a split gets
FRACTION_BITS = 4  # of a pixel, in which strokes are drawn


@dataclass(frozen=True, eq=False)
class _Plan:
    """Plan of what every colour becomes.

    Attributes:
        old: colours as found.
        becomes: per old colour, what its pixels may become.
        final: all that they become.
        where: the file and "palette", for messages.
    """

    old: tuple[RGB, ...]
    becomes: tuple[tuple[RGB, ...], ...]
    final: tuple[RGB, ...]
    where: str

    def number(self, text: str, key: str) -> int:
        """Return which of the final colours is meant; one that was merged is where it went."""
        meant = [(rgb, rgb) for rgb in self.final]
        meant += [(o, to[0]) for o, to in zip(self.old, self.becomes, strict=True) if len(to) == 1]
        found = meant[_nearest([rgb for rgb, _ in meant], text, f"{self.where}.{key}")]
        return self.final.index(found[1])


def correct_palette(
    pictures: Sequence[Picture],
    contours: Sequence[Map],
    found: Palette,
    wanted: PaletteCorrections,
    strokes: Sequence[Sequence[tuple[int, Stroke]]] = (),
    *,
    where: str = "corrections",
    space: Space = "rgb",
) -> tuple[Palette, list[PaintMap]]:
    """Return a palette as corrected, and labels and tones of its pictures.

    `keep` is not looked at: it says how a palette is found (`PaletteRule`).

    Args:
        pictures: sRGB with straight alpha.
        contours: how far drawn lines cover their pixels, of 255.
        found: the palette of these pictures.
        wanted: what a person corrects of it.
        strokes: of the label brush on every picture, with their number in the file, in its own
            pixels; empty for none.
        where: the file, for messages.
        space: in which nearest is meant.

    Raises:
        PaletteError: a colour that the palette does not have, two corrections of one colour, or
            none is left; the message names file and key.
    """
    lit, dark = in_light(pictures, contours, found.shadow)
    maps = maps_in_light(lit, dark, contours, found, space)
    plan = _plan(found, wanted, f"{where}: palette")
    ramps = _ramps(found, plan)
    moved = [
        _moved(one.labels, light, plan, space, ramps) for one, light in zip(maps, lit, strict=True)
    ]
    labels = [own for own, _ in moved]
    pixels = np.sum([counts for _, counts in moved], axis=0)
    colors = _colors(found, plan, pixels)
    if ramps:
        _check_splits(plan, wanted, pixels)
        colors = with_own_tones(colors, pictures, labels)
    names = {plan.number(color, f"names.{color}"): name for color, name in wanted.names.items()}
    told = with_codes([one.name for one in colors], [one.rgb for one in colors])
    colors = [replace(one, name=names.get(i, told[i])) for i, one in enumerate(colors)]
    ink, is_paint = _ink(found, plan)
    for number, (own, contour) in enumerate(zip(labels, contours, strict=True)):
        free = (pictures[number][..., 3] >= OPAQUE) & (contour < DRAWN)
        for at, stroke in strokes[number] if strokes else ():
            color = plan.number(stroke.color, f"strokes.{at}.color")
            own[_covered(stroke, own.shape) & free] = color
        if not is_paint:
            own[contour >= DRAWN] = UNLABELLED
    place, last = printed_places([one.rgb for one in colors], found.printed), len(found.printed)
    order = sorted(range(len(colors)), key=lambda i: (place.get(i, last), -colors[i].share))
    anew = np.full(256, UNLABELLED, dtype=np.uint8)
    anew[order] = np.arange(len(order))
    palette = replace(
        found,
        colors=tuple(colors[i] for i in order),
        rule=found.rule.removesuffix(BY_HAND) + BY_HAND,
        contour=ink,
        features=tuple(rgb for rgb in found.features if rgb in plan.final),
    )
    labels = [anew[own] for own in labels]
    if palette.stepped:
        pairs = zip(lit, labels, strict=True)
        return palette, [PaintMap(own, step_tones(light, own, palette)) for light, own in pairs]
    parts = zip(maps, labels, strict=True)
    return palette, [_with_tones(before, own) for before, own in parts]


def _plan(found: Palette, wanted: PaletteCorrections, where: str) -> _Plan:
    """Plan what every colour becomes; `where` is the file and "palette"."""
    old = tuple(color.rgb for color in found.colors)
    gone: dict[int, str] = {}
    becomes: dict[int, tuple[RGB, ...]] = {i: (rgb,) for i, rgb in enumerate(old)}

    def take(text: str, key: str) -> int:
        number = _nearest(old, text, f"{where}.{key}")
        if number in gone:
            raise PaletteError(
                f"{where}.{key}: {text} goes elsewhere by {gone[number]}, too; remove one"
            )
        gone[number] = key
        return number

    dropped = [take(text, f"drop.{i}") for i, text in enumerate(wanted.drop)]
    for i, one in enumerate(wanted.split):
        into = tuple(dict.fromkeys(rgb_of_hex(text, "split") for text in one.into))
        becomes[take(one.color, f"split.{i}.color")] = into
    for i, group in enumerate(wanted.merge):
        for j, text in enumerate(group[1:], start=1):
            number = take(text, f"merge.{i}.{j}")
            becomes[number] = (old[_nearest(old, group[0], f"{where}.merge.{i}.0")],)
    for i, group in enumerate(wanted.merge):
        stays = _nearest(old, group[0], f"{where}.merge.{i}.0")
        if stays in gone:
            raise PaletteError(
                f"{where}.merge.{i}.0: {group[0]} is to stay, but goes elsewhere by {gone[stays]}; "
                "remove one"
            )
    left = tuple(dict.fromkeys(rgb for i in becomes if i not in dropped for rgb in becomes[i]))
    if not left:
        raise PaletteError(f"{where}.drop: leaves no colour; keep at least one")
    for number in dropped:
        becomes[number] = left
    return _Plan(old, tuple(becomes.values()), left, where)


def _nearest(colors: Sequence[RGB], text: str, key: str) -> int:
    """Return which colour is meant.

    Raises:
        PaletteError: none is within `NEAR_LEVELS`.
    """
    wanted = np.array(rgb_of_hex(text, key))
    off = np.abs(np.array(colors) - wanted).max(axis=1)
    best = int(off.argmin())
    if off[best] > NEAR_LEVELS:
        raise PaletteError(
            f"{key}: {text} is no colour of the palette; the nearest is {hex_of(colors[best])}: "
            "correct it"
        )
    return best


def _ramps(found: Palette, plan: _Plan) -> list[Ramp]:
    """Return the ramps of the final colours of a painted sheet; none of any other.

    That of a colour which was more before may be of all that; it is the ray through black.
    """
    if not found.has_ramps or found.stepped:
        return []
    own = {o: ramp_of(one) for o, one in zip(plan.old, found.colors, strict=True)}
    whole = {rgb for rgb, targets in zip(plan.old, plan.becomes, strict=True) if targets == (rgb,)}
    return [own[rgb] if rgb in whole else plain_ramp(np.array(rgb, np.uint8)) for rgb in plan.final]


def _check_splits(
    plan: _Plan, wanted: PaletteCorrections, pixels: Int[np.ndarray, "old final"]
) -> None:
    """Refuse a split of a painted sheet's colour that parts nothing: its ramps would be one.

    Raises:
        PaletteError: hardly a pixel goes to one of the colours.
    """
    for at, split in enumerate(wanted.split):
        key = f"{plan.where}.split.{at}"
        own = pixels[_nearest(plan.old, split.color, f"{key}.color")]
        for number, text in enumerate(split.into):
            part = own[plan.final.index(rgb_of_hex(text, key))]
            if part < LEAST_PART * own.sum():
                raise PaletteError(
                    f"{key}.into.{number}: hardly a pixel of {split.color} is {text}; give colours "
                    "that lie in it, farther apart, or use the label brush"
                )


def _moved(
    labels: Map, picture: Picture, plan: _Plan, space: Space, ramps: Sequence[Ramp]
) -> tuple[Map, Int[np.ndarray, "old final"]]:
    """Return labels by final colours, and how many pixels of each colour went where.

    Args:
        labels: by old colours.
        picture: in light.
        plan: what every colour becomes.
        space: in which nearest is meant.
        ramps: of the final colours; empty where the sheet is not painted.
    """
    moved = np.full_like(labels, UNLABELLED)
    counts = np.zeros((len(plan.old), len(plan.final)), dtype=np.int64)
    found: dict[tuple[RGB, ...], Map] = {}
    for number, targets in enumerate(plan.becomes):
        own = labels == number
        at = np.array([plan.final.index(rgb) for rgb in targets], dtype=np.uint8)
        if ramps and len(at) > 1 and own.any():
            if targets not in found:
                found[targets] = shaded_labels([picture], [ramps[i] for i in at])[0]
            pick = found[targets][own]
        else:
            colors = np.array(targets, dtype=np.uint8)
            pick = nearest_colors(picture[own][:, :3], colors, space=space)
        moved[own] = at[pick]
        counts[number] = np.bincount(at[pick], minlength=len(plan.final))
    return moved, counts


def _colors(
    found: Palette, plan: _Plan, pixels: Int[np.ndarray, "old final"]
) -> list[PaletteColor]:
    """Return the final colours, what they are made of moved to them; others as they were."""
    parts = pixels / np.maximum(pixels.sum(axis=1, keepdims=True), 1)
    for number, targets in enumerate(plan.becomes):
        if not pixels[number].any():
            parts[number, plan.final.index(targets[0])] = 1
    total = np.array([color.share for color in found.colors]) @ parts
    dark = np.array([sum(tone.share for tone in color.tones[1:]) for color in found.colors]) @ parts
    colors = []
    for number, rgb in enumerate(plan.final):
        same = plan.old.index(rgb) if rgb in plan.old else None
        if same is not None and parts[same, number] == 1 and parts[:, number].sum() == 1:
            colors.append(found.colors[same])
            continue
        name = name_of(rgb) if same is None else found.colors[same].name
        share, in_shadow = float(total[number]), float(dark[number])
        tones: tuple[Tone, ...] = ()
        factor = None if same is None else found.colors[same].factor
        if found.shadow is not None:
            dark_rgb = apply_shadow(np.array(rgb), factor or found.shadow.factor)
            red, green, blue = dark_rgb.tolist()
            both = Tone(rgb, share - in_shadow), Tone((red, green, blue), in_shadow)
            tones = both if in_shadow > 0 else both[:1]
        if found.stepped:
            tones = _united_tones(found, plan, rgb, share)
        colors.append(PaletteColor(rgb, share, name, tones, factor=factor))
    return colors


def _united_tones(found: Palette, plan: _Plan, rgb: RGB, share: float) -> tuple[Tone, ...]:
    """Return the tones of all that a colour is made of, from light to dark; it is the lightest."""
    parts = zip(found.colors, plan.becomes, strict=True)
    tones = [tone for color, targets in parts if targets == (rgb,) for tone in color.tones]
    tones = [tone for tone in tones if tone.rgb != rgb and sum(tone.rgb) < sum(rgb)]
    tones = sorted(tones, key=lambda tone: -sum(tone.rgb))[: MOST_TONES - 1]
    return (Tone(rgb, share - sum(tone.share for tone in tones)), *tones)


def _ink(found: Palette, plan: _Plan) -> tuple[ContourColor | None, bool]:
    """Return the lines' colour, and False if it was a paint and no longer is."""
    ink = found.contour
    if ink is None or ink.rgb not in plan.old:
        return ink, True
    targets = plan.becomes[plan.old.index(ink.rgb)]
    if len(targets) == 1 and targets[0] != ink.rgb:
        return replace(ink, rgb=targets[0], name=name_of(targets[0])), True
    return ink, ink.rgb in plan.final


def _covered(stroke: Stroke, shape: tuple[int, ...]) -> Bool[np.ndarray, "height width"]:
    """Return which pixels of a picture a stroke covers."""
    mask = np.zeros(shape, dtype=np.uint8)
    unit = 1 << FRACTION_BITS
    points = np.rint((np.array(stroke.points) - 0.5) * unit).astype(np.int32)
    thick = max(1, round(2 * stroke.radius))
    cv2.polylines(mask, [points], False, 1, thick, shift=FRACTION_BITS)
    for x, y in points[[0, -1]].tolist():
        cv2.circle(mask, (x, y), round(stroke.radius * unit), 1, cv2.FILLED, shift=FRACTION_BITS)
    return mask > 0


def _with_tones(before: PaintMap, labels: Map) -> PaintMap:
    """Return labels with their tones; what had no paint before lies in light."""
    if before.tones is None:
        return PaintMap(labels, None)
    tones = np.where(before.tones == UNLABELLED, IN_LIGHT, before.tones)
    tones[labels == UNLABELLED] = UNLABELLED
    return PaintMap(labels, tones.astype(np.uint8))
