"""`toonset render`: render a trained run from given cameras or all round."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.errors import counted
from toonset.nerf.options import RenderOptions
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.camera import Camera
    from toonset.nerf.fields.trained_field import TrainedField

    Named = list[tuple[str, Camera]]

DEPTH_FILE = "depth.json"
WRITTEN = ("*.png", "*.svg", "turntable.*", "sprites.json", DEPTH_FILE)


def render(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    options: RenderOptions,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Folder for the pictures.", rich_help_panel=OUTPUT_PANEL),
    ],
    threads: Annotated[
        int | None,
        typer.Option("--threads", min=1, max=1024, help="CPU threads (default: all cores)."),
    ] = None,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Render a trained run: one PNG per camera and layer, SVG, and files of a whole turntable.

    A turntable passes through the drawings, at their elevation and size, unless --elevation or
    --size say otherwise; its GIF and WebP are 1024 px at most without --size. `drawn`, the default,
    puts views together from the drawings and draws their outline anew. `rgb` is the field's own
    colour; `palette` shows palette colours only; `normal` codes x, y, z of the world as red, green,
    blue, `normal-camera` right, up and towards the viewer; `depth` has 16 bits, which depth.json
    turns into world units. Several layers are written as NAME-LAYER.png. `--format svg` writes each
    view of `drawn` as smooth paths, too: a group per paint, and lines.
    """
    options.check()
    import torch

    from toonset.nerf.render.animation import ANIMATED_PX, check_mp4
    from toonset.nerf.render.files import render_files
    from toonset.nerf.render.layers import default_layer
    from toonset.nerf.render.recolor import change_pen, recolor_run, repaint_run
    from toonset.nerf.run.folder import read_field
    from toonset.write import new_folder, write_bytes

    if "mp4" in options.together:
        check_mp4()
    if threads is not None:
        torch.set_num_threads(threads)
    trained = recolor_run(read_field(run), options.recolor)
    if options.palette:
        trained = repaint_run(trained, options.palette, nearest=options.nearest)
    layers: list[str] = [*options.layers] or [default_layer(trained)]
    layers = ["palette"] if options.repaints and layers == ["rgb"] else layers
    trained = _style(trained, layers, lines=options.lines)
    trained = change_pen(trained, options.ink_width, options.ink_color)
    named = _cameras(trained, options)
    check_output(out, [run, options.cameras], WRITTEN, force=force)
    most_px = ANIMATED_PX if options.cameras is None and options.size is None else None
    files = render_files(
        trained, named, layers, options.together, most_px, printer.progress, printer.say
    )
    sizes: dict[str, int] = {}
    with new_folder(out, force=force) as folder:
        for name, data in files:
            write_bytes(folder / name, data)
            sizes[name] = len(data)
    _report(out, layers, sizes, len(named), printer)


def _report(
    out: Path, layers: list[str], sizes: dict[str, int], views: int, printer: Printer
) -> None:
    """Print what was written: pictures per view and layer, SVGs, and files of all views."""
    names = [name for name in sizes if name != DEPTH_FILE]
    files, others = names[: views * len(layers)], names[views * len(layers) :]
    traced = [name for name in others if name.endswith(".svg")]
    together = [name for name in others if name not in traced]
    extra = [f"{name} ({math.ceil(sizes[name] / 1000)} kB)" for name in together]
    if traced:
        extra.insert(
            0, f"{len(traced)} SVG ({math.ceil(sum(sizes[name] for name in traced) / 1000)} kB)"
        )
    shown = f"{counted(len(files), 'picture')} ({', '.join(layers)})"
    values = {"out": out, "layer": layers[0], "layers": layers, "files": files, "svg": traced}
    said = ", ".join([f"{out}: {shown}", *extra])
    printer.result({**values, "together": together}, said)


def _style(trained: TrainedField, layers: list[str], *, lines: bool) -> TrainedField:
    """Return the field with the lines that the pictures should have.

    Raises:
        BundleError: an ink layer of drawings without lines, or a drawn one without drawings.
    """
    from dataclasses import replace

    from toonset.errors import BundleError
    from toonset.nerf.fields.trained_field import NO_DRAWINGS, NO_LINES

    drawings = trained.drawings
    lined = drawings is not None and drawings.outline is not None
    if "ink" in layers and not (lined and lines):
        raise BundleError(NO_LINES)
    if {"drawn", "source"} & set(layers) and drawings is None:
        raise BundleError(NO_DRAWINGS)
    if lines or drawings is None:
        return trained
    return replace(trained, drawings=replace(drawings, pen=None))


def _cameras(trained: TrainedField, options: RenderOptions) -> Named:
    from toonset.dataset.bundle.transforms_read import read_cameras
    from toonset.errors import BundleError
    from toonset.nerf.render.turntable import turntable

    cameras = options.cameras
    if cameras is None:
        turn = turntable(trained, options.turntable or 1, options.elevation, options.size)
        return [(f"{i:03d}", camera) for i, camera in enumerate(turn)]
    named = [(Path(path).stem, camera) for path, camera in read_cameras(cameras)]
    names = [name for name, _ in named]
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise BundleError(f"{cameras}: two frames would be written as {double}.png; rename one")
    return named
