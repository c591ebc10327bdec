"""Write a view as SVG: a group per paint, a class per colour, lines on top.

    <style>.teal{fill:#268a8c}.teal_2{fill:#1c6b6d}</style>
    <g id="teal" inkscape:label="teal" inkscape:groupmode="layer">
      <g class="teal" fill="#268a8c"><path d="..."/></g>
      <g class="teal_2" fill="#1c6b6d">...</g>
    </g>

A class holds a colour once: changing it there recolours the view. The attribute says the same for
readers that know no style sheets (cutters, some importers); where both are read the class counts.

Source: W3C, "Scalable Vector Graphics (SVG) 2", sections 6.4 (style sheets) and 9.3 (path data).
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from toonset.errors import UsageError
from toonset.nerf.render.bezier import Curve
from toonset.nerf.render.layers import Rendering
from toonset.nerf.render.open_raster import LINES as LINES_NAME
from toonset.nerf.render.open_raster import paint_names
from toonset.nerf.render.stack import LINES, Region
from toonset.nerf.render.vectors import Vectors, trace

TRACED = "drawn"  # the layer that can be
STEPS = 100  # of a coordinate per pixel
HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg"'
    ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    ' width="{0}" height="{1}" viewBox="0 0 {0} {1}">'
)


def check_traced(layer: str) -> None:
    """Refuse, before any work, what is no drawn look.

    Raises:
        UsageError: see above.
    """
    if layer != TRACED:
        raise UsageError(
            f"layer {layer!r}: cannot be written as SVG; let the first layer be {TRACED}"
        )


def svg_of(view: Rendering, title: str) -> bytes:
    """Return a view in the drawn look as an SVG file.

    Args:
        view: the view.
        title: what readers call it.

    Raises:
        BundleError: the run holds no drawings.
    """
    drawn, drawings = view.drawn, view.field.drawings
    assert drawings is not None  # view.drawn has refused a run without drawings
    larger = view.camera.scale / min(one.camera.scale for one in drawings.views)
    pen = drawings.pen and replace(drawings.pen, width_px=drawings.pen.width_px * larger)
    names = paint_names(drawings.new_paints, len(drawings.paints) - len(drawings.palette))
    return encode_svg(trace(drawn, drawings.new_paints, pen, larger), names, title)


def encode_svg(vectors: Vectors, names: Sequence[str], title: str) -> bytes:
    """Return a traced view as an SVG file: the same regions, the same bytes.

    Args:
        vectors: the regions.
        names: of the paints, each otherwise.
        title: what readers call it.
    """
    groups = [
        (paint, list(regions))
        for paint, regions in itertools.groupby(vectors.regions, key=lambda one: one.paint)
    ]
    called = [LINES_NAME if paint == LINES else names[paint] for paint, _ in groups]
    idents = _identifiers(called)
    lines = [HEAD.format(*vectors.size_wh), f"<title>{escape(title)}</title>"]
    styles, body = [], []
    for (_, regions), name, ident in zip(groups, called, idents, strict=True):
        label = quoteattr(name)
        body.append(f'<g id="{ident}" inkscape:label={label} inkscape:groupmode="layer">')
        for number, region in enumerate(regions, start=1):
            of_class = ident if number == 1 else f"{ident}_{number}"
            fill = "#{:02x}{:02x}{:02x}".format(*region.rgb)
            styles.append(f".{of_class}{{fill:{fill}}}")
            body += [f'<g class="{of_class}" fill="{fill}">', *_paths(region), "</g>"]
        body.append("</g>")
    style = [f"<style>{''.join(styles)}</style>"] if styles else []
    return "\n".join([*lines, *style, *body, "</svg>\n"]).encode()


def _identifiers(names: Sequence[str]) -> list[str]:
    """Return names as XML and CSS take them, each otherwise: letters, digits and hyphens."""
    found: list[str] = []
    for name in names:
        word = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
        ident = word if word[:1].isalpha() else f"paint-{word}"
        while ident in found:
            ident += "x"
        found.append(ident)
    return found


def _paths(region: Region) -> list[str]:
    """Return a path per connected part."""
    return [f'<path d="{"".join(map(_data, shape))}"/>' for shape in region.shapes]


def _data(curve: Curve) -> str:
    """Return a closed curve as path data, from its last end on, each segment by its own start."""
    whole = np.rint(curve * STEPS).astype(int)
    starts = np.roll(whole[:, 2], 1, axis=0)
    away = (whole - starts[:, None]).reshape(-1).tolist()
    moves = " ".join(map(_number, starts[0].tolist())), " ".join(map(_number, away))
    return f"M{moves[0]}c{moves[1]}z".replace(" -", "-")


def _number(steps: int) -> str:
    return f"{steps / STEPS:.2f}".rstrip("0").rstrip(".")
