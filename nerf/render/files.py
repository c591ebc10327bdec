"""Encode a rendering's files: a picture per camera and layer, and whole turns."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.animation import Pictures, encode_gif, encode_mp4, encode_webp, smaller
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.depth import DepthLevels
from toonset.nerf.render.open_raster import PaintLayer, check_layered, encode_ora, layered
from toonset.nerf.render.sprite_sheet import feet, sprite_json, sprite_sheet
from toonset.nerf.render.svg import check_traced, svg_of
from toonset.nerf.render.views import render

ANIMATIONS = {"gif": encode_gif, "webp": encode_webp, "mp4": encode_mp4}
LOOPS = ("gif", "webp")  # which may be smaller than the pictures
SPRITES, LAYERED, TRACED = "sprites", "ora", "svg"
UNSEEN = 0.05  # of a view in the drawn look: worth a word
DEPTH_FILE = "depth.json"  # the scale of depth pictures


def render_files(
    trained: TrainedField,
    named: Sequence[tuple[str, Camera]],
    layers: Sequence[str] = ("rgb",),
    formats: Sequence[str] = (),
    animated_px: int | None = None,
    progress: Callable[[str], None] = lambda line: None,
    say: Callable[[str], None] = lambda line: None,
) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of every file that `toonset render` writes.

    Args:
        trained: what is rendered.
        named: cameras with the names of their pictures, without ending.
        layers: names out of LAYERS; several are written as NAME-LAYER.png.
        formats: names out of `nerf.options.FORMATS`: files of the first layer, of all views
            together but for "svg".
        animated_px: see `turntable_files`.
        progress: told which view is rendered.
        say: told which view shows most that is in no drawing.

    Raises:
        ToonsetError: see `Rendering.picture`, `turntable_files` and `encode_ora`.
    """
    in_layers: list[tuple[str, list[PaintLayer]]] = []
    traced: dict[str, bytes] = {}
    if LAYERED in formats:
        check_layered(layers[0])
    if TRACED in formats:
        check_traced(layers[0])
    baked, turning, depths = Baked.of(trained), [], []
    cameras = [camera for _, camera in named]
    levels = DepthLevels.of(trained.hull, cameras)
    kept_px = animated_px if set(formats) <= {*LOOPS, TRACED} else None  # whole turns are large
    unseen: dict[str, float] = {}
    for number, (stem, camera) in enumerate(named):
        progress(f"rendering {number + 1} of {len(named)}")
        view = render(baked, camera)
        if TRACED in formats:
            traced[f"{stem}.{TRACED}"] = svg_of(view, stem)
        for layer in layers:
            data, picture = view.png(layer, levels=levels)
            name = f"{stem}.png" if len(layers) == 1 else f"{stem}-{layer}.png"
            yield name, data
            depths += [name] if layer == "depth" else []
            if layer == layers[0]:
                turning.append(smaller(picture, kept_px))
                in_layers += [(stem, layered(view, layer, picture))] if LAYERED in formats else []
            if layer == "drawn":
                unseen[stem] = view.drawn.by_field
    worst = max(unseen, key=unseen.__getitem__, default="")
    if worst and unseen[worst] > UNSEEN:
        guessed = "is in no drawing and goes on with the paint beside it"
        say(f"{worst}: {unseen[worst]:.0%} of it {guessed}")
    if depths:
        yield DEPTH_FILE, _json(levels.to_json(depths))
    yield from traced.items()
    of_pictures = [name for name in formats if name not in (LAYERED, TRACED)]
    yield from turntable_files(of_pictures, turning, trained, cameras, animated_px).items()
    if in_layers:
        yield f"turntable.{LAYERED}", encode_ora(in_layers, turning)


def turntable_files(
    formats: Iterable[str],
    pictures: Pictures,
    trained: TrainedField,
    cameras: Sequence[Camera],
    animated_px: int | None = None,
) -> dict[str, bytes]:
    """Return turntable.gif, .webp, .mp4 and sprites.png with sprites.json, by name.

    Args:
        formats: names out of `nerf.options.FORMATS`, but for layers and SVG.
        pictures: one per camera, in the order of the turn.
        trained: what they show.
        cameras: that saw them.
        animated_px: longest side of .gif and .webp; None: as large as the pictures.

    Raises:
        OutputError: the pictures differ in size or do not fit into a texture.
        SetupError: "mp4" without its extra.
    """
    files = {}
    for name in formats:
        if name == SPRITES:
            sheet = sprite_sheet(pictures)
            about = sprite_json(sheet, f"{SPRITES}.png", [feet(trained, c) for c in cameras])
            files[f"{SPRITES}.png"] = encode_png(sheet.rgba)
            files[f"{SPRITES}.json"] = _json(about)
        else:
            most_px = animated_px if name in LOOPS else None
            shown = [smaller(picture, most_px) for picture in pictures]
            files[f"turntable.{name}"] = ANIMATIONS[name](shown)
    return files


def _json(content: dict[str, Any]) -> bytes:
    return json.dumps(content, indent=2, allow_nan=False).encode() + b"\n"
