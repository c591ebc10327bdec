"""`toonset mesh`: write a trained run as a mesh in palette colours."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.nerf.options import ORIGINAL, MeshOptions


def mesh(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", help="File to write: .glb, .obj or .ply.", rich_help_panel=OUTPUT_PANEL
        ),
    ],
    options: MeshOptions = MeshOptions(),
    threads: Annotated[
        int | None,
        typer.Option("--threads", min=1, max=1024, help="CPU threads (default: all cores)."),
    ] = None,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Turn a trained run into a closed mesh in palette colours, with crisp borders.

    It lies in the mannequin's frame: +Y up, the character faces +Z. Blender turns GLB and OBJ
    upright; its importer does not turn a PLY, which is written +Y up, too: rotate it by 90 degrees
    about X there. An OBJ comes with a material and the palette as a picture, NAME.mtl and NAME.png.

    With --texture the picture holds the drawn look: every patch is painted by the one drawing that
    shows it best, without contour lines. --outline puts an inverted hull round it, in the sheet's
    ink and as wide as its line.

    --variants puts more palettes into one GLB, as variants (KHR_materials_variants) that viewers
    and engines switch between: the run's own, "original", first, then one per file.
    """
    options.check()
    import torch

    from toonset.nerf.render.recolor import recolor_run, variants_of
    from toonset.nerf.run.folder import read_field
    from toonset.nerf.surface.files import check_mesh_files, mesh_files, write_mesh_files
    from toonset.nerf.surface.surface import surface_of
    from toonset.nerf.surface.texture import texture_surface
    from toonset.nerf.surface.textured_files import check_textured_files, encode_textured_files

    trained = recolor_run(read_field(run), options.recolor)
    check = check_mesh_files
    if options.texture:
        check = partial(check_textured_files, outline=options.outline)
    check(out, force=force, variants=bool(options.variants))
    others = variants_of(trained, options.variants, nearest=options.nearest)
    if threads is not None:
        torch.set_num_threads(threads)

    def progress(step: str, done: float) -> None:
        printer.progress(f"{step} {done:.0%}")

    values: dict[str, Any] = {}
    if options.texture:
        textured = texture_surface(
            trained, options.faces, progress, outline=options.outline, variants=others
        )
        surface, files = textured.surface, encode_textured_files(textured, out)
        values["texture"] = list(textured.atlas.size_wh)
        values["by_field"] = float((textured.source < 0).mean())
    else:
        surface = surface_of(trained, options.faces, progress, variants=others)
        files = mesh_files(surface, out)
    write_mesh_files(files, out, force=force)
    if others:
        values["variants"] = [ORIGINAL, *(name for name, _ in others)]
    values |= {"faces": len(surface.faces), "vertices": len(surface.vertices)}
    values["bytes"] = {name: len(data) for name, data in files.items()}
    printer.result({"out": out, **values}, _text(out, values, options.faces))


def _text(out: Path, values: Mapping[str, Any], faces: int) -> str:
    """Return in a line what was written; `faces` were asked for."""
    parts = [f"{values['faces']} faces{' (fewer would open it)' * (values['faces'] > faces)}"]
    if "texture" in values:
        width, height = values["texture"]
        unseen = f"{values['by_field']:.0%} of the faces in no drawing"
        parts.append(f"texture of {width} x {height} px, {unseen}")
    if "variants" in values:
        parts.append(f"in the colours {', '.join(values['variants'])}")
    sizes = (f"{name} {size / 1e3:.0f} kB" for name, size in values["bytes"].items())
    return f"{out}: {'; '.join([*parts, ', '.join(sizes)])}"
