"""`toonset evaluate` and `consistency`: score renderings, and drawings against each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.errors import UsageError
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.dataset.bundle.scene import Scene
    from toonset.nerf.score.evaluate import ScoredView

WRITTEN = ("evaluation.json", "evaluation.png")
CONSISTENCY_WRITTEN = ("consistency.json", "consistency.png")
STANDS_OUT = 3  # exit code: done, but look
COLUMNS = {  # of the table: heading, number format
    "psnr": ("PSNR dB", "{:.2f}"),
    "psnr_mask": ("in mask", "{:.2f}"),
    "psnr_shift": ("+-2 px", "{:.2f}"),
    "psnr_blocks": ("blocks", "{:.2f}"),
    "ssim": ("SSIM", "{:.4f}"),
    "flip": ("FLIP", "{:.4f}"),
    "sharpness": ("sharp", "{:.2f}"),
    "dirt": ("dirt", "{:.2f}"),
    "lpips": ("LPIPS", "{:.4f}"),
    "silhouette_iou": ("outline", "{:.1%}"),
    "label_accuracy": ("labels", "{:.1%}"),
    "label_miou": ("mIoU", "{:.1%}"),
    "label_miou_shift": ("mIoU+-2", "{:.1%}"),
    "ink_f1": ("lines", "{:.2f}"),
}


def evaluate(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    test: Annotated[
        Path | None,
        typer.Option("--test", help="A transforms.json with RGBA pictures, or its folder."),
    ] = None,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out",
            help="Instead of --test: for each drawing of the bundle train anew on all others, with "
            "the run's options, and compare it with what they predict. As long as a training each.",
        ),
    ] = False,
    bundle: Annotated[
        Path | None,
        typer.Option(
            "--bundle", help="The bundle it was trained on (default: the run's parent folder)."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            help="Write evaluation.json and evaluation.png into this folder.",
            rich_help_panel=OUTPUT_PANEL,
        ),
    ] = None,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Compare renderings with held-out pictures, and apart from them with the training drawings.

    Everything over white; "in mask" counts the pixels that the drawing covers. "+-2 px" is the best
    PSNR over shifts of the whole picture by up to 2 px, "blocks" the same with a shift for every
    block of 16 px, "sharp" the mean gradient over the truth's, "dirt" the gradient where the truth
    is flat (levels per px), "outline" the overlap of the silhouettes, "labels" the share of unmixed
    pixels with the right palette colour, "mIoU" the same as mean intersection over union, "mIoU+-2"
    with the best shift of the whole picture, "lines" the F1 of dark lines that may be off by 2 px
    of a figure of 260. "-": the run or the picture has no such thing, or a package is missing; the
    JSON says why.

    With --leave-one-out a drawing is left out of the training alone: its camera, the mannequin and
    the palette are the bundle's, which were found with all drawings.
    """
    from toonset.dataset.bundle.read_scene import read_scene
    from toonset.nerf.run.folder import read_field
    from toonset.nerf.score.evaluate import report, score_views
    from toonset.nerf.score.metrics_view import load_judges

    if leave_one_out == (test is not None):
        raise UsageError("give --test with held-out views, or --leave-one-out")
    if test is None:
        _leave_one_out(run, bundle, out, printer, force=force)
        return
    trained, held_out = read_field(run), read_scene(test)
    seen, why_unseen = _training_scene(run, bundle)
    if out is not None:
        check_output(out, [run, test, bundle], WRITTEN, force=force)
    if seen is not None and _same_pictures(held_out, seen):
        printer.say(f"{test}: holds pictures that the run was trained on; they are not held out")
    judges = load_judges()
    scored = score_views(trained, held_out, judges, printer.progress)
    own = () if seen is None else score_views(trained, seen, judges, printer.progress)
    absent = judges.absent | ({} if why_unseen is None else {"training": why_unseen})
    result = report(scored, own, absent)
    if out is not None:
        sections = (("held-out views", scored), ("training views", own))
        _write(out, result, sections, force=force)
    printer.result(result, _text(result))


def _leave_one_out(
    run: Path, bundle: Path | None, out: Path | None, printer: Printer, *, force: bool
) -> None:
    """Compare each drawing of a run's bundle with what trainings without it predict."""
    from toonset.errors import BundleError
    from toonset.nerf.leave_one_out import leave_one_out
    from toonset.nerf.run.folder import read_field, read_options

    trained, options = read_field(run), read_options(run)
    scene, why_unseen = _training_scene(run, bundle)
    if scene is None:
        raise BundleError(f"{why_unseen}")
    if out is not None:
        check_output(out, [run, bundle], WRITTEN, force=force)
    with_palette = trained.palette is not None
    found = leave_one_out(scene, options, palette=with_palette, listener=printer)
    result = found.to_json()
    if out is not None:
        _write(out, result, (("drawings left out of training", found.views),), force=force)
    printer.result(result, _text(result))


def _write(
    out: Path,
    result: dict[str, Any],
    sections: tuple[tuple[str, tuple[ScoredView, ...]], ...],
    *,
    force: bool,
) -> None:
    from toonset.dataset.images.picture import encode_png
    from toonset.nerf.score.evaluation_picture import contact_sheet
    from toonset.write import new_folder, write_bytes, write_json

    errors_are = "mean difference" if "flip" in result["absent"] else "FLIP"
    with new_folder(out, force=force) as folder:
        write_json(folder / "evaluation.json", result)
        write_bytes(folder / "evaluation.png", encode_png(contact_sheet(sections, errors_are)))


def _training_scene(run: Path, bundle: Path | None) -> tuple[Scene | None, str | None]:
    """Return the frames that the run was trained on, or why they are not known."""
    from toonset.dataset.bundle.read_scene import read_scene
    from toonset.errors import BundleError, ToonsetError
    from toonset.json_file import read_json
    from toonset.nerf.score.evaluate import chosen_frames

    place = bundle or run / ".."  # as it was given: evaluation.json names no place of a machine
    if bundle is None and not (place / "transforms.json").is_file():
        return None, f"{place} holds no transforms.json; pass --bundle"
    config = read_json(run / "config.json")
    try:
        scene = chosen_frames(read_scene(place), config)
        if not scene.frames:
            raise BundleError(f"{place}: has none of the run's views; pass its --bundle")
    except ToonsetError as error:
        if bundle is not None:
            raise
        return None, str(error)
    return scene, None


def _same_pictures(held_out: Scene, seen: Scene) -> bool:
    known = {frame.rgba.tobytes() for frame in seen.frames}
    return any(frame.rgba.tobytes() in known for frame in held_out.frames)


def _text(result: dict[str, Any]) -> str:
    """Return the tables for people; the last line is what counts, the held-out views' mean."""
    lines = [f"{name}: {reason}" for name, reason in result["absent"].items()]
    for name, section in (("training", result["training"]), ("held-out", result)):
        if section is not None:
            lines += [*([""] if lines else []), f"{name} views", *_table(section)]
    return "\n".join(lines)


def _table(section: dict[str, Any]) -> list[str]:
    from toonset.nerf.score.evaluate import LAYERS

    layers = [name for name in LAYERS if section[name] is not None]
    shown = {
        key: column
        for key, column in COLUMNS.items()
        if any(section[layer][key] is not None for layer in layers)
    }
    head = "".join(f"{title:>9}" for title, _ in shown.values())
    lines = [f"{'view':<20}{'layer':<9}{head}"]
    for view in section["views"]:
        lines += [_row(view["name"], layer, view[layer], shown) for layer in layers]
    return [*lines, *(_row("mean", layer, section[layer], shown) for layer in layers)]


def _row(
    name: str, layer: str, values: dict[str, float | None], shown: dict[str, tuple[str, str]]
) -> str:
    cells = [
        "-" if (value := values[key]) is None else form.format(value)
        for key, (_, form) in shown.items()
    ]
    return f"{name[:19]:<20}{layer:<9}" + "".join(f"{cell:>9}" for cell in cells)


def consistency(
    bundle: Annotated[
        Path, typer.Argument(help="A bundle, or any transforms.json with RGBA pictures.")
    ] = Path("bundle"),
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write into; default: BUNDLE/consistency."),
    ] = None,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Say per drawing how far it is shifted, sized and bent against the others, and show where.

    Writes consistency.json and consistency.png: what no shape that all drawings share explains,
    from yellow to red. Exit code 3 where a drawing stands out.
    """
    from toonset.dataset.bundle.read_scene import read_scene
    from toonset.dataset.images.picture import encode_png
    from toonset.nerf.prepare.consistency import consistency_of, consistency_picture
    from toonset.write import check_output, new_folder, write_bytes, write_json

    folder = out or (bundle if bundle.is_dir() else bundle.parent) / "consistency"
    scene = read_scene(bundle)
    check_output(folder, [bundle], CONSISTENCY_WRITTEN, force=force)
    found = consistency_of(scene)
    report = found.to_json()
    with new_folder(folder, force=force) as place:
        write_json(place / "consistency.json", report)
        write_bytes(place / "consistency.png", encode_png(consistency_picture(found)))
    printer.result(report | {"out": str(folder)}, _drawings_table(report, folder))
    if found.odd:
        raise typer.Exit(STANDS_OUT)


def _drawings_table(report: dict[str, Any], folder: Path) -> str:
    lines = [f"{'view':<20}{'shift px':>14}{'size':>9}{'bend px':>9}{'agreement':>18}"]
    for view in report["views"]:
        dx, dy = view["shift_px"]
        before, after = view["agreement_iou"]
        size = f"{100 * (view['scale'] - 1):+.1f} %"
        shift, agreed = f"{dx:+.1f} {dy:+.1f}", f"{before:.3f} -> {after:.3f}"
        line = f"{view['name'][:19]:<20}{shift:>14}{size:>9}{view['bend_rms_px']:>9.1f}{agreed:>18}"
        lines.append(line + "  look" * (view["name"] in report["odd"]))
    return "\n".join([*lines, f"look at {folder / 'consistency.png'}"])
