"""`toonset consistency`: which drawings of a sheet disagree with the others, and where."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from toonset.cli.common.output import ForceFlag, JsonFlag, Printer, QuietFlag

WRITTEN = ("consistency.json", "consistency.png")
STANDS_OUT = 3  # exit code: done, but look


def consistency(
    bundle: Annotated[
        Path, typer.Argument(help="A bundle, or any transforms.json with RGBA pictures.")
    ] = Path("bundle"),
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write into; default: BUNDLE/consistency."),
    ] = None,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Say per drawing how far it is shifted, sized and bent against the others, and show where.

    Writes consistency.json and consistency.png: what no shape that all drawings share explains,
    from yellow to red. Exit code 3 where a drawing stands out.
    """
    from toonset.dataset.bundle.read_scene import read_scene
    from toonset.dataset.images.picture import encode_png
    from toonset.nerf.prepare.consistency import consistency_of, consistency_picture
    from toonset.write import check_output, new_folder, write_bytes, write_json

    printer = Printer(as_json, quiet)
    folder = out or (bundle if bundle.is_dir() else bundle.parent) / "consistency"
    scene = read_scene(bundle)
    check_output(folder, [bundle], WRITTEN, force=force)
    found = consistency_of(scene)
    report = found.to_json()
    with new_folder(folder, force=force) as place:
        write_json(place / "consistency.json", report)
        write_bytes(place / "consistency.png", encode_png(consistency_picture(found)))
    printer.result(report | {"out": str(folder)}, _table(report, folder))
    if found.odd:
        raise typer.Exit(STANDS_OUT)


def _table(report: dict[str, Any], folder: Path) -> str:
    lines = [f"{'view':<20}{'shift px':>14}{'size':>9}{'bend px':>9}{'agreement':>18}"]
    for view in report["views"]:
        dx, dy = view["shift_px"]
        before, after = view["agreement_iou"]
        size = f"{100 * (view['scale'] - 1):+.1f} %"
        shift, agreed = f"{dx:+.1f} {dy:+.1f}", f"{before:.3f} -> {after:.3f}"
        line = f"{view['name'][:19]:<20}{shift:>14}{size:>9}{view['bend_rms_px']:>9.1f}{agreed:>18}"
        lines.append(line + "  look" * (view["name"] in report["odd"]))
    return "\n".join([*lines, f"look at {folder / 'consistency.png'}"])
