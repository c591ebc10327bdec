"""Format the summary that `toonset train` prints at its end."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any


def summary(run: Path, metrics: dict[str, Any], verbose: bool = False) -> str:
    """Return the content of metrics.json for people; the evidence only if `verbose`."""
    fit, seconds = metrics["train"], sum(metrics["seconds"].values())
    counts = metrics["counts"]
    size = f", {counts['rays']} rays, {counts['parameters']} parameters" if verbose else ""
    after = ["toonset", "view", str(run)]
    held_out = [f"held-out views: {_figures(metrics['test'])}"] if metrics["test"] else []
    return "\n".join(
        [
            f"{counts['views']} views{size}; {metrics['steps']} steps in {seconds:.1f} s",
            *_mannequin(metrics["drawings"]["mannequin"], verbose=verbose),
            *_drawings(metrics["drawings"], verbose=verbose),
            *_symmetry(metrics["symmetry"]),
            *(_hull(metrics) + _planes(metrics["planes"]) if verbose else []),
            f"fit to the drawings{_set_right(metrics['drawings'])}: {_figures(fit)}",
            *held_out,
            _verdict(metrics["verdict"], verbose=verbose),
            f"{run}: look at preview.png; next: {shlex.join(after)}",
        ]
    )


def _chosen(found: dict[str, Any] | None) -> bool:
    return found is not None and bool(found["chosen"])


def _mannequin(found: dict[str, Any] | None, *, verbose: bool) -> list[str]:
    """Return whether the mannequin gives the shape; if verbose, on what evidence."""
    if found is None or not (verbose or found["chosen"]):
        return []
    what = (
        "the mannequin's"
        if found["chosen"]
        else "the drawings' hull, the mannequin is another body"
    )
    if not verbose:
        return [f"shape: {what}"]
    others, left = found["drawings_off"], found["parts_left"]
    hull = "" if others is None else f", by the other drawings {_percent(others)}"
    parts = f", {_percent(left)} unexplained by bends" if left else ""
    off = f"outlines predicted {_percent(found['mannequin_off'])} off{hull}{parts}"
    return [f"shape: {what} ({off})"]


def _hull(metrics: dict[str, Any]) -> list[str]:
    """Return how many drawings may contradict the hull, and why so many."""
    if _chosen(metrics["drawings"]["mannequin"]):
        return []
    hull = metrics["hull"]
    tried = ", ".join(f"{100 * iou:.1f} %" for iou in hull["left_out_iou"])
    evidence = f" (left-out views' outlines met with 0, 1 against: {tried})" if tried else ""
    return [f"hull: filled where at most {hull['missing']} views say background{evidence}"]


def _verdict(found: dict[str, Any], *, verbose: bool) -> str:
    """Return the run's verdict and its reasons."""
    if not verbose:
        return f"verdict: {found['verdict']}"
    off = found["off_height"]
    worst = max(off["views"], key=off["views"].__getitem__, default=None)
    if worst is None:
        return f"verdict: {found['verdict']}; too few drawings to predict one from the others"
    found_off = f"{worst} is off by {_percent(off['worst'])} of the height from what the others"
    return f"verdict: {found['verdict']}; {found_off} make of it ({_percent(off['bound'])} is ok)"


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %"


def _drawings(found: dict[str, Any], *, verbose: bool) -> list[str]:
    """Return what was done to the drawings; if verbose, on what evidence, and what was not."""
    lines = []
    for name, done in (("registration", "moved and sized"), ("unwarping", "bent back")):
        step = found[name]
        if step is None or not (verbose or step["applied"]):
            continue
        before, after = step["apart_px"]
        if name == "unwarping" and _chosen(found["mannequin"]):
            done = "bent to the mannequin"
        moved = f"drawings {done}: outlines {before:.2f} px apart, {after:.2f} px after"
        kept = f"drawings not {done}: outlines {before:.2f} px apart"
        more = "" if step["applied"] or step["gain_nats"] <= 0 else ", not the best explanation"
        gain = f" ({step['gain_nats']:+.0f} nats{more})" if verbose else ""
        lines.append(f"{moved if step['applied'] else kept}{gain}")
    return lines


def _planes(found: dict[str, Any] | None) -> list[str]:
    """Return how fine the planes are, and what finer and coarser ones predict."""
    if found is None:
        return []
    cells = f"planes: {found['cells']} cells along the longest side"
    if found["untried"]:
        return [f"{cells}, the usual two thirds of one per pixel (not tried: {found['untried']})"]
    tried = ", ".join(f"{c['cells']}: {c['left_out_psnr']:.2f} dB" for c in found["candidates"])
    return [
        f"{cells}, the fewest within {found['tolerance_db']:g} dB of the best (predicted "
        f"{' and '.join(found['left_out'])} from the others; {tried})"
    ]


def _set_right(found: dict[str, Any]) -> str:
    """Return which drawings the fit is measured on, if not on those that were given."""
    if found["without_outlines"]:
        return " without their outlines"
    steps = [found[name] for name in ("registration", "unwarping")]
    return " as set right" if any(step and step["applied"] for step in steps) else ""


def _symmetry(found: dict[str, Any] | None) -> list[str]:
    """Return what stands in for the side that nobody drew."""
    from toonset.nerf.prepare.symmetry import LEAST_ALIKE

    if found is None:
        return []
    alike = [f"left and right are {100 * share:.0f} % alike" for share in sorted(found["alike"])]
    seen = alike[0] if alike else "no drawing shows left and right together"
    if not found["mirrored"]:
        return [f"{seen}: nothing is mirrored (--symmetric on does it all the same)"]
    sources = ", ".join(found["mirrored"])
    said = [f"the side that nobody drew is the mirror image of {sources} ({seen})"]
    if min(found["alike"], default=1.0) < LEAST_ALIKE:
        said.append("left and right are drawn differently: --symmetric off mirrors nothing")
    return said


def _figures(means: dict[str, float | None]) -> str:
    """Return the figures of some views."""
    inside = means["psnr_mask"]
    in_masks = "" if inside is None else f", inside the masks {inside:.2f} dB"
    return f"PSNR {means['psnr']:.2f} dB{in_masks}"
