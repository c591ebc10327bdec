"""Take off what turns the colours of a whole drawing: its own light, white balance or layer.

Each channel of a drawing is another one's times a gain. The gain is what brings most of the
drawing's large flat colours onto colours of one other, five of them at least; where no
gain does that much better than none, the drawings are left as they are. Among the drawings the
median gain is one, so that the colours stay what most drawings have.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from toonset.palette.pixels.antialias import OPAQUE

MOST_COLORS = 12  # of a drawing, the largest
LEAST_SHARE = 0.015  # of a drawing: a smaller colour may be a blend
MERGED = 8  # levels: shades of one flat colour
DARK = 48  # level of the lightest channel: a gain shows too little of darker colours
MOST_GAIN = 1.3
FLAT = 0.7  # of a drawing that its large flat colours must be: less in a gradient
SAME = 5.0  # levels: a colour brought onto another
FEWEST = 5  # colours that must agree; of shaded sheets without a gain up to 4 do
AGREE = 0.85  # of the lit colours' share that must agree
BETTER = 1.5  # times what agrees without a gain
WORTH = 0.06  # a smaller gain clustering takes as one paint

Picture = UInt8[np.ndarray, "height width 4"]
Gain = Float[np.ndarray, " 3"]


def view_gains(pictures: Sequence[Picture]) -> Float[np.ndarray, "pictures 3"] | None:
    """Return what each drawing's channels are to be multiplied with; None where nothing is.

    Args:
        pictures: sRGB with straight alpha, of one character.
    """
    if len(pictures) < 2:
        return None
    flat = [_flat_colors(picture) for picture in pictures]
    first = int(np.argmax([len(colors) for colors, _ in flat]))
    gains = np.array([_gain(*own, flat[first][0]) for own in flat])
    gains /= np.median(gains, axis=0)
    return gains if np.abs(gains - 1).max() >= WORTH else None


def with_gains(
    pictures: Sequence[Picture], gains: Float[np.ndarray, "pictures 3"] | None
) -> list[Picture]:
    """Return the drawings with their channels multiplied; the same ones without gains."""
    if gains is None:
        return list(pictures)
    levels = np.arange(256)[:, None]
    even = []
    for picture, gain in zip(pictures, gains, strict=True):
        table = np.rint(levels * gain).clip(0, 255).astype(np.uint8)
        channels = [table[picture[..., i], i] for i in range(3)]
        even.append(np.dstack([*channels, picture[..., 3]]))
    return even


def gain_notes(gains: Float[np.ndarray, "pictures 3"] | None) -> tuple[str, ...]:
    """Return what a person should know of drawings in other light."""
    if gains is None:
        return ()
    turned = np.flatnonzero(np.abs(gains - 1).max(axis=1) >= WORTH)
    named = ", ".join(map(str, turned))
    return (
        f"the colours of picture {named} differ as a whole from the others', by up to "
        f"{100 * float(np.abs(gains - 1).max()):.0f} %, as in other light: taken off before "
        "colours were told",
    )


def _flat_colors(rgba: Picture) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Return a drawing's largest flat colours, and their shares."""
    words = np.ascontiguousarray(rgba).view("<u4")[..., 0]
    flat = rgba[..., 3] >= OPAQUE
    flat[:, 1:] &= words[:, 1:] == words[:, :-1]
    flat[1:] &= words[1:] == words[:-1]
    codes, counts = np.unique(words[flat] & 0xFFFFFF, return_counts=True)
    order = np.argsort(-counts, kind="stable")[: 16 * MOST_COLORS]
    codes, counts = codes[order], counts[order]
    rgb = np.stack([codes & 255, codes >> 8 & 255, codes >> 16], axis=1).astype(np.float64)
    colors: list[np.ndarray] = []
    amounts: list[float] = []
    for color, amount in zip(rgb, counts.tolist(), strict=True):
        near = [i for i, other in enumerate(colors) if np.abs(other - color).max() <= MERGED]
        if near:
            amounts[near[0]] += amount
        else:
            colors.append(color)
            amounts.append(float(amount))
    share = np.array(amounts) / max(sum(amounts), 1.0)
    kept = np.argsort(-share)[:MOST_COLORS]
    kept = kept[share[kept] >= LEAST_SHARE]
    lit = [i for i in kept if colors[i].max() >= DARK]
    return np.array([colors[i] for i in lit]).reshape(-1, 3), share[lit]


def _gain(own: np.ndarray, share: np.ndarray, others: np.ndarray) -> Gain:
    """Return the gain that brings most of a drawing's colours onto another's; ones if none does."""
    none = np.ones(3)
    if len(own) < FEWEST or len(others) < FEWEST or share.sum() < FLAT:
        return none
    best, most = none, _agreeing(none, own, share, others)
    plain = most[0]
    for color in own:
        for other in others:
            able = (color > 0) & (color < 255) & (other < 255)
            gain = np.where(able, other / np.maximum(color, 1), 1.0)
            if able.any() and gain.min() > 0 and np.abs(np.log(gain)).max() <= np.log(MOST_GAIN):
                now = _agreeing(gain, own, share, others)
                if now > most:
                    best, most = gain, now
    enough = most[1] >= FEWEST and most[0] >= max(AGREE * share.sum(), BETTER * plain)
    return _refined(best, own, share, others) if enough else none


def _agreeing(
    gain: Gain, own: np.ndarray, share: np.ndarray, others: np.ndarray
) -> tuple[float, int]:
    """Return how much of the colours, and how many, a gain brings onto the others."""
    moved = np.minimum(own * gain, 255)
    away = np.abs(moved[:, None] - others).max(axis=2)
    near = away.min(axis=1) <= SAME
    return float(share[near].sum()), len(set(away.argmin(axis=1)[near].tolist()))


def _refined(gain: Gain, own: np.ndarray, share: np.ndarray, others: np.ndarray) -> Gain:
    """Return the gain that fits all colours that agree, by least squares."""
    moved = np.minimum(own * gain, 255)
    away = np.abs(moved[:, None] - others).max(axis=2)
    near, meant = away.min(axis=1) <= SAME, others[away.argmin(axis=1)]
    use = near[:, None] & (meant < 255) & (own < 255)
    weight = share[:, None] * use
    return np.where(
        use.any(axis=0),
        (weight * own * meant).sum(axis=0) / np.maximum((weight * own**2).sum(axis=0), 1e-9),
        gain,
    )
