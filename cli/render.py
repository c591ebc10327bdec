"""`toonset render`: pictures of a trained run from given cameras or all round."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.output import OUTPUT_PANEL, ForceFlag, JsonFlag, Printer, QuietFlag, check_output

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

    from toonset.camera import Camera
    from toonset.nerf.trained import TrainedField

    Picture = UInt8[np.ndarray, "height width 4"]
    Named = list[tuple[str, Camera]]

WRITTEN = ("*.png", "turntable.gif")
LAYER_NAMES = ("rgb", "palette", "depth", "labels", "alpha")


def render(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Folder for the pictures.", rich_help_panel=OUTPUT_PANEL),
    ],
    cameras: Annotated[
        Path | None, typer.Option("--cameras", help="A transforms.json: one picture per frame.")
    ] = None,
    views: Annotated[
        int | None, typer.Option("--turntable", min=1, max=3600, help="N views all round.")
    ] = None,
    elevation: Annotated[
        float | None,
        typer.Option("--elevation", min=-90, max=90, help="Turntable: degrees, > 0 looks down."),
    ] = None,
    size: Annotated[
        int | None, typer.Option("--size", min=8, max=4096, help="Side in px of a turntable view.")
    ] = None,
    layer: Annotated[
        str, typer.Option("--layer", help="rgb, palette, depth, labels or alpha.")
    ] = "rgb",
    recolor: Annotated[
        list[str] | None,
        typer.Option("--recolor", help="OLD=NEW, e.g. '#aa0000=#00aa00'; repeatable; palette."),
    ] = None,
    gif: Annotated[
        bool | None, typer.Option("--gif/--no-gif", help="turntable.gif (default: turntables).")
    ] = None,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, help="CPU threads (default: all cores).")
    ] = None,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Render a trained run: one PNG per camera, and a GIF of a turntable.

    The default layer is the field's own colour; `--layer palette` (implied by --recolor) shows
    palette colours only.
    """
    printer = Printer(as_json, quiet)
    layer = "palette" if recolor and layer == "rgb" else layer
    _check_arguments(cameras, views, layer, recolor)
    if cameras is not None and (elevation is not None or size is not None):
        raise typer.BadParameter("--elevation and --size belong to --turntable")

    from toonset.files import new_folder, write_bytes
    from toonset.nerf.recolor import recolored
    from toonset.nerf.run_folder import read_field
    from toonset.nerf.threads import use_threads

    use_threads(threads)
    check_output(out, [run, cameras], WRITTEN, force=force)
    trained = recolored(read_field(run), recolor or [])
    named = _cameras(trained, cameras, views, math.radians(elevation or 0.0), size)
    animate = gif if gif is not None else views is not None
    pictures = []
    with new_folder(out, force=force) as folder:
        for number, (name, camera) in enumerate(named):
            printer.progress(f"rendering {number + 1} of {len(named)}")
            data, picture = _layer(trained, camera, layer)
            write_bytes(folder / name, data)
            pictures.append(picture)
        if animate:
            from toonset.nerf.animation import encode_gif

            write_bytes(folder / "turntable.gif", encode_gif(pictures))
    extra = " and turntable.gif" if animate else ""
    files = [name for name, _ in named]
    printer.result(
        {"out": out, "layer": layer, "files": files, "gif": animate},
        f"{out}: {len(files)} {'picture' if len(files) == 1 else 'pictures'} ({layer}){extra}",
    )


def _check_arguments(
    cameras: Path | None, views: int | None, layer: str, recolor: list[str] | None
) -> None:
    if (cameras is None) == (views is None):
        raise typer.BadParameter("give either --cameras transforms.json or --turntable N")
    if layer not in LAYER_NAMES:
        names = ", ".join(LAYER_NAMES)
        raise typer.BadParameter(f"{layer!r} is none of {names}", param_hint="--layer")
    if recolor and layer != "palette":
        raise typer.BadParameter("colours can be replaced on --layer palette only")


def _cameras(
    trained: TrainedField,
    cameras: Path | None,
    views: int | None,
    elevation: float,
    size: int | None,
) -> Named:
    from toonset.dataset.transforms import read_cameras
    from toonset.errors import BundleError
    from toonset.nerf.turntable import turntable

    if cameras is None:
        turn = turntable(trained, views or 1, elevation, size)
        return [(f"{i:03d}.png", camera) for i, camera in enumerate(turn)]
    named = [(f"{Path(path).stem}.png", camera) for path, camera in read_cameras(cameras)]
    names = [name for name, _ in named]
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise BundleError(f"{cameras}: two frames would be written as {double}; rename one")
    return named


def _layer(trained: TrainedField, camera: Camera, layer: str) -> tuple[bytes, Picture]:
    """Return the PNG of one view, and the picture that a GIF shows."""
    import numpy as np

    from toonset.dataset.picture import encode_indexed_png, encode_png
    from toonset.nerf import layers
    from toonset.nerf.views import render as render_view
    from toonset.palette.labels import UNLABELLED

    view = render_view(trained, camera)
    if layer == "labels":
        labels = layers.label_picture(view)
        palette = trained.palette
        assert palette is not None  # label_picture has refused a run without palette
        colors = np.concatenate([palette, np.zeros((256 - len(palette), 3), np.uint8)])[labels]
        alpha = np.where(labels == UNLABELLED, 0, 255).astype(np.uint8)
        return encode_indexed_png(labels, palette), np.dstack([colors, alpha])
    if layer == "palette":
        picture = layers.palette_picture(view, trained.palette)
    elif layer == "depth":
        picture = layers.depth_picture(view)
    elif layer == "alpha":
        picture = layers.alpha_picture(view)
    else:
        picture = layers.color_picture(view.rgb, view.alpha)
    return encode_png(picture), picture
