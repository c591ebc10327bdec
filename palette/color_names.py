"""Name colours as people do, and tell the paints of one palette apart by name.

A colour is called what the nearest colour of a survey is called: R. Munroe, "Color Survey Results"
(blog.xkcd.com, 2010), names that 222,500 people typed for colours on their own screens; the list
is in the public domain (CC0 1.0). Its names are folded to the noun that they end in, or to the
plain word for it ("dusty teal" to teal, "aubergine" to purple), 768 of 949; those without ("puke",
"dusk") are left out. ISCC-NBS and CSS were the other lists: the first says "moderate yellowish
brown", which nobody types; the second has no olive drab or skin but a "papayawhip".

Nearest is meant in OKLab with a and b of dark colours over the root of lightness, for in the dark a
little chroma is a plain hue; then lightness is weighed half and hue double: a dark brown is still
a brown. What has next to no chroma has no hue. "Light" and "dark" begin half way between what the
survey calls so and what it calls otherwise (medians of OKLab lightness).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Float, UInt8

from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb

SURVEY = {
    "green": """
        002d04 005249 009337 014600 019529 01a049 01ff07 02590f 028f1e 02ab2e 02c14d 033500
        044a05 048243 05480d 05ffa6 062e03 06470c 089404 08ff08 0a481e 0add08 0aff02 0b4008
        0bf77d 0cff0c 11875d 12e193 154406 15b01a 1bfc06 1fa774 20c073 21c36f 21fc0d 25ff29
        287c37 2a7e19 2baf6a 2cfa1f 2dfe54 2fef10 33b864 35530a 35ad6b 388004 39ad48 3ae57f
        3d9973 3eaf76 3f9b0b 40fd14 419c03 4b6113 4da409 4efd54 4f9153 50a747 51b73b 526525
        53fca1 53fe5c 548d44 56ae57 58bc08 598556 5c8b15 5ca904 5cb200 5fa052 606602 61de2a
        61e160 638b27 63b365 657432 658b38 658d6d 65fe08 667c3e 667e2c 699d4c 69d84f 6a6e09
        6ba353 6c7a0e 6f6c0a 6f7c00 6fc276 706c11 70b23f 728639 728f02 748500 749551 74a662
        758000 75b84f 75fd63 76a973 76cd26 76fda8 789b73 7a9703 7bb274 7ebd01 7efbb3 82a67d
        84b701 87a922 87ae73 87fd05 889717 88b378 89a203 89fe05 8cfd7e 8cff9e 8eab12 8ee53f
        8f9805 8fae22 8ffe09 90fda9 94a617 94ac02 94b21c 96b403 96f97b 98f6b0 99cc04 9aae07
        9af764 9be5aa 9db92c 9dc100 9dff00 a0bf16 a6c875 a7ffb5 a8b504 a8ff04 a9be70 a9f971
        aaff32 adf802 aefd6c aeff6e b0dd16 b0ff9d b1d27b b1fc99 b1ff65 b2fba5 b6c406 b7e1a1
        b9ff66 bcecac bcf5a6 bdf8a3 befd73 bff128 bffe28 c0fb2d c1f80a c2ff89 c4fe82 c7fdb5
        c8fd3d c8ffb0 ccfd7f cffdbc d1ffbd
    """,
    "blue": """
        000133 00035b 004577 010fcc 014182 015482 0165fc 016795 01c08d 0203e2 02066f 021bf9
        02ccfe 030aa7 0339f8 0343df 03719c 040273 040348 047495 0485d1 04d9ff 0504aa 056eee
        0652ff 069af3 0804f9 0a437a 0c06f7 0d75f8 0e87cc 107ab0 152eff 1805db 1f3b4d 214761
        2242c7 247afd 26538d 26f7fd 276ab3 29465b 2c6fbb 31668a 3778bf 3a18b1 3a2efe 3b5b92
        3b719f 3c73a8 3d7afd 3e82fc 3f829d 436bad 448ee4 475f94 49759c 4984b8 4b57db 4e7496
        4f738e 507b9c 510ac9 5170d7 5684ae 56fca2 5a7d9a 5a86ad 5b7c99 5d21d0 5e819d 5f34e7
        601ef9 6140ef 632de9 63f7b4 6488ea 658cbb 661aee 6b8ba4 75bbfd 78d1b6 7bf2da 8ab8fe
        8af1fe 8b88f8 8f99fb 95d0fc 98eff9 9dbcd4 a2bffe a2cffe acc2d9 b1d1fc bdf6fe c3fbf4
        c4fff7 c6fcff cafffb d0fefe d4ffff d5ffff d6fffe d7fffe
    """,
    "purple": """
        1f0954 280137 2a0134 34013f 35063e 36013f 380282 380835 3d0734 3f012c 430541 490648
        4b006e 4e0550 533cc6 5729ce 580f41 5a06ef 5d06e9 5d1451 6241c7 6d5acf 703be7 720058
        734a65 751973 76424e 7e1e9c 805b87 820747 825f87 826d8c 84597e 874c62 887191 894585
        895b7b 910951 916e99 952e8f 9900fa 9a0eea 9d5783 9e0168 9e43a2 a00498 a442a0 a552e6
        a55af4 a66fb5 aa23ff ad03de ad0afd ae7181 b790d4 bc13fe be03fd bf77f6 c071fe c292a1
        c94cbe ca9bf7 caa0ff cb00f5 ceaefa d648d7 d6b4fc db4bda ef1de7 f6cefc fed0fc
    """,
    "pink": """
        b5485d ba6873 c0737a c27e79 c3909b c74767 c77986 c83cb9 c87f89 c88d94 ca7b80 cb0162
        cb416b cc7a8b cd7584 ce5dae cf6275 d1768f d5869d d58a94 d725de d90166 da467d dd85d7
        de9dac df4ec8 e03fd8 e78ea5 f075e6 f36196 f6688e f7879a fa2a55 fb5581 fb5ffc fdb0c0
        fdc1c5 fe019a fe01b1 fe02a2 fe2c54 fe46a5 fe828c fe83cc ff028d ff0490 ff0789 ff63e9
        ff69af ff6f52 ff7fa7 ff81c0 ffb2d0 ffb7ce ffbacd ffc5cb ffcfdc ffd1df
    """,
    "brown": """
        1d0200 341c02 3d1c02 410200 411900 544e03 60460f 653700 673a3f 696006 696112 6b4247
        7a5901 7a6a4f 7b5804 7d7103 7f2b0a 7f4e1e 7f5112 7f684e 7f7053 836539 876e4b 885f01
        886806 8b3103 947706 964e02 9b7a01 9d7651 a87900 ab7e4c ac7e04 ad8150 ad900d b16002
        b17261 b1916e b25f03 b2713d b27a01 b79400 b9a281 be6400
    """,
    "yellow": """
        b29705 b5ce08 bfac05 c2b709 c2be0e c6f808 c7c10c c9b003 c9ff27 cdc50a cdfd02 cfff04
        d0c101 d0e429 d0fe1d d2bd0a d5ab09 d5b60a ddd618 eedc5b f1f33f fafe4b fce166 fdee73
        fdff38 fdff52 fedf08 feff7f ffda03 ffdf22 fff917 fffd01 fffd37 fffd74 fffe40 fffe71
        fffe7a ffff14 ffff84
    """,
    "red": """
        7b0323 840000 850e04 8c000f 980002 990147 9a0200 9f2305 a50055 a90308 aa2704 b0054b
        b9484e bb3f3f be0119 be013c c0022f d3494e d9544d db5856 e50000 ec2d01 f10c45 f43605
        f5054f f7022a fa4224 fc2647 fd411e fe0002 fe2f4a ff000d ff073a ff474c
    """,
    "teal": """
        00555a 014d4e 017371 017374 017a79 01889f 01f9c6 029386 045c5a 05696b 06b48b 08787f
        0a888a 0b8b87 0cb577 0cdc73 0f9b8e 10a674 137e6d 1f6357 23c48b 24bca8 25a36f 2bb179
        32bf84 42b395 4c9085 5e9b8a 5f9e8f 719f91 82cbb2 90e4c1
    """,
    "grey": """
        343837 363737 3c4142 516572 59656d 607c8e 647d8e 6b7c85 6f828a 748b97 758da3 77926f
        7a687f 7d7f7c 7ea07a 866f85 86775f 86a17d 89a0b0 8d8468 929591 947e94 95a3a6 96ae8d
        978a84 997570 b7c9e2 c8aca9 d8dcd6 fdfdfe
    """,
    "orange": """
        b96902 c04e01 c14a09 c45508 c65102 c87606 ca6b02 cb7723 cd5909 d8863b dc4d01 e17701
        f0833a f0944d f8481c f97306 fb7d07 fd3c06 fdaa48 fe4b03 ff5b00 ff724c ff9408 ff964f
        ffa62b ffa756
    """,
    "turquoise": """
        00fbb0 00ffff 02d8e9 04d8b2 04f489 06b1c4 06c2ac 0bf9ea 0ffef9 13eac9 2afeb7 41fdfe
        7bfdc7 7ef4cc 8cffdb a5fbd5 acfffc b7fffa b8ffeb
    """,
    "lavender": """
        665fd1 856798 8d5eb7 8e82fe 966ebd 9c6da5 ac86a8 c1c6fc c760ff c79fef c95efb cea2fd
        dfc5fe e4cbff edc8ff eecffe
    """,
    "gold": """
        b59410 dbb40c f5bf03 f9bc08 fac205 fcb001 fcc006 fdb915 fddc5c fdde6c feb209 feb308
        fec615 ffab0f ffad01 ffc512
    """,
    "tan": """
        9b8f55 aaa662 af884a bccb7a c4a661 cba560 d1b26f d3b683 d99b82 e6f2a2 fbeeac fcfc81
        ffe36e
    """,
    "rust": "6e1005 8b2e16 8f1402 922b05 9a6200 9e3623 a03623 a83c09 a9561e af2f0d b04e0f ca6641",
    "olive": "373e02 3c4d03 4b5d16 645403 677a04 6e750e 6f7632 9cbb04 a4be5c acbf69 b9cc81",
    "magenta": "960056 9d0759 a0025c c20078 d767ad ed0dd9 f504c9 fa5ff7 ff08e8",
    "salmon": "c85a53 cf524e fc5a50 fe7b7c fea993 ff6163 ff796c ff9a8a ffb19a",
    "mint": "1fb57a 48c072 7af9ab 80f9ad 8fff9f 9ffeb0 a0febf a6fbb2 b6ffbb",
    "navy": "00022e 000435 001146 01153e 01386a 020035 155084 2e5a88",
    "mustard": "a88905 ae8b0c bf9005 bf9b0c c69c04 cb9d06 ceb301 f7d560",
    "maroon": "3c0008 610023 650021 80013f 8c0034 a24857 a8415b",
    "cream": "feffca ffe5ad fff39a ffffc2 ffffcb ffffd4 ffffe4",
    "beige": "a88f59 ac9362 c9d179 e2ca76 e6daa6 fffeb6",
    "peach": "de7e5d ffb07c ffb16d ffd8b1",
    "black": "000000 070d0d",
    "white": "ffffff",
}
DARK_LIGHT = {
    "green": (0.59, 0.81),
    "blue": (0.39, 0.69),
    "purple": (0.39, 0.62),
    "pink": (0.62, 0.78),
    "brown": (0.39, 0.59),
    "yellow": (0.84, 0.94),
    "red": (0.48, 0.59),
    "teal": (0.57, 0.74),
    "grey": (0.47, 0.77),
    "orange": (0.63, 0.73),
    "turquoise": (0, 0.89),
    "lavender": (0.62, 0.78),
    "tan": (0.71, 0.86),
    "olive": (0.44, 0.67),
    "beige": (0.75, 0.91),
    "peach": (0.76, 0.86),
}
_NOUNS = tuple(SURVEY)
_CODES = [(noun, code) for noun, codes in SURVEY.items() for code in codes.split()]
_NOUN_OF = np.array([_NOUNS.index(noun) for noun, _ in _CODES])
_COLORS = np.array([list(bytes.fromhex(code)) for _, code in _CODES], dtype=np.uint8)
LIGHTNESS, HUE = 0.5, 2.0  # weights of the distance, beside chroma's 1
MIDDLE, DARKEST = 0.6, 0.1  # lightness from which chroma is as in OKLab; none grows below the other
NO_HUE = JUST_NOTICEABLE  # of chroma
BLACK = (0.2, 0.05)  # lightness and chroma: below both nobody sees a hue
GREYS = (("black", 0.24), ("dark grey", 0.47), ("grey", 0.75), ("light grey", 0.95), ("white", 9))
STEPS = ("very dark ", "dark ", "", "light ", "very light ")
PLAIN = STEPS.index("")
TOLD_APART = 2 * JUST_NOTICEABLE  # of lightness: paints nearer than that are not "dark" and "light"
PARTS = ((0.25, "head"), (0.55, "torso"), (0.88, "legs"), (1.0, "feet"))  # of the height, from top

RGB = tuple[int, int, int]


def name_of(rgb: RGB) -> str:
    """Return what people call an 8-bit sRGB colour, e.g. "dark green"."""
    place = _hued(np.array(rgb, dtype=np.uint8))
    if _has_no_hue(rgb):
        return next(name for name, end in GREYS if place[0] < end)
    noun = _NOUNS[_NOUN_OF[_distances(place).argmin()]]
    dark, light = DARK_LIGHT.get(noun, (0.0, 1.0))
    step = "dark " if place[0] < dark else "light " if place[0] > light else ""
    return step + noun


def part_of(height: float) -> str:
    """Return the part of a figure at a height, 0 (top) to 1 (ground): "head" to "feet"."""
    return next(name for end, name in PARTS if height <= end or end == PARTS[-1][0])


def distinct_names(
    colors: Sequence[RGB], parts: Callable[[], Sequence[str]] | None = None
) -> tuple[str, ...]:
    """Return a name per colour, no two alike.

    Colours of one noun are told apart by lightness ("dark", "light"), the same lightness by chroma
    ("greyish"), then by the part that they lie in ("brown (legs)"), at last by their code.

    Args:
        colors: 8-bit sRGB, each once.
        parts: returns the part of the figure that each mostly lies in, "" for none; asked only
            where nothing else tells colours apart.
    """
    names = [name_of(rgb) for rgb in colors]
    for tell in (_by_lightness, _by_chroma):
        for noun in sorted({_noun(name) for name in names}):
            own = [i for i, name in enumerate(names) if _noun(name) == noun]
            if _doubles([names[i] for i in own]):
                told = tell([colors[i] for i in own], [names[i] for i in own], noun)
                for i, name in zip(own, told, strict=True):
                    names[i] = name
    if parts is not None and _doubles(names):
        names = _with(names, parts())
    return with_codes(names, colors)


def with_codes(names: Sequence[str], colors: Sequence[RGB]) -> tuple[str, ...]:
    """Return the names, those that several colours have with the colour's code."""
    return tuple(_with(names, ["#{:02x}{:02x}{:02x}".format(*rgb) for rgb in colors]))


def meant_by(text: str, names: Sequence[str]) -> list[int]:
    """Return which of a palette's names a person may mean: one of them, or several, or none.

    The name itself goes first; else every name that has all the words typed, in any order ("brown
    legs" or "legs" for "dark brown (legs)"), and of these those without others if there are any.
    """
    wanted = _words(text)
    alike = [i for i, name in enumerate(names) if _words(name) == wanted]
    return alike or [i for i, name in enumerate(names) if wanted and wanted <= _words(name)]


def _words(text: str) -> frozenset[str]:
    plain = text.lower().replace("gray", "grey")
    return frozenset("".join(c if c.isalnum() or c == "#" else " " for c in plain).split())


def _has_no_hue(rgb: RGB) -> bool:
    lightness, *ab = oklab_from_rgb(np.array(rgb, dtype=np.uint8))
    chroma = float(np.hypot(*ab))
    return chroma < NO_HUE or (lightness < BLACK[0] and chroma < BLACK[1])


def _hued(colors: UInt8[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return OKLab with a and b of dark colours over the root of lightness."""
    place = oklab_from_rgb(colors)
    place[..., 1:] *= np.sqrt(MIDDLE / np.clip(place[..., :1], DARKEST, MIDDLE))
    return place


_PLACES = _hued(_COLORS)


def _distances(place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " named"]:
    """Return squared distances to the survey's colours."""
    lightness, chroma = _PLACES[:, 0] - place[0], np.hypot(_PLACES[:, 1], _PLACES[:, 2])
    chroma -= np.hypot(place[1], place[2])
    across = ((_PLACES[:, 1:] - place[1:]) ** 2).sum(axis=1)
    hue = np.maximum(across - chroma**2, 0)
    return (LIGHTNESS * lightness) ** 2 + chroma**2 + HUE**2 * hue


def _noun(name: str) -> str:
    return name.split(" ")[-1]


def _doubles(names: Sequence[str]) -> set[str]:
    return {name for name, count in Counter(names).items() if count > 1}


def _with(names: Sequence[str], more: Sequence[str]) -> list[str]:
    """Return the names, with something more in brackets where that tells all of one name apart."""
    again = {
        name
        for name in _doubles(names)
        if "" not in (own := [e for n, e in zip(names, more, strict=True) if n == name])
        and not _doubles(own)
    }
    return [
        f"{name} ({extra})" if name in again else name
        for name, extra in zip(names, more, strict=True)
    ]


def _by_lightness(colors: Sequence[RGB], names: Sequence[str], noun: str) -> list[str]:
    """Return names with the steps of lightness that fit best and differ where lightness does."""
    lightness = oklab_from_rgb(np.array(colors, dtype=np.uint8))[:, 0]
    order = np.argsort(-lightness, kind="stable")[::-1]
    apart = np.diff(lightness[order]) >= TOLD_APART
    level = np.concatenate([[0], np.cumsum(apart)])  # colours as light as each other share one
    if level[-1] >= len(STEPS) or noun in ("black", "white"):
        return list(names)
    own = [STEPS.index(names[int(i)].removesuffix(noun)) for i in order]
    best = min(
        combinations(range(len(STEPS)), int(level[-1]) + 1),
        key=lambda steps: (sum(abs(steps[n] - o) for n, o in zip(level, own, strict=True)), steps),
    )
    told = list(names)
    for place, number in zip(order, level, strict=True):
        told[place] = STEPS[best[number]] + noun
    return told


def _by_chroma(colors: Sequence[RGB], names: Sequence[str], noun: str) -> list[str]:
    """Return names with "greyish" for the duller of two that have one name, "off" for white."""
    place = oklab_from_rgb(np.array(colors, dtype=np.uint8))
    chroma = np.hypot(place[:, 1], place[:, 2])
    told = list(names)
    if noun == "white" and len(names) == 2:
        told[int(place[:, 0].argmin())] = "off white"
        return told
    for name in _doubles(names):
        own = sorted((i for i, one in enumerate(names) if one == name), key=lambda i: chroma[i])
        if len(own) == 2 and chroma[own[1]] - chroma[own[0]] >= TOLD_APART and chroma[own[0]]:
            told[own[0]] = f"greyish {name}"
    return told
