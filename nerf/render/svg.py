from __future__ import annotations

import numpy as np

from toonset.nerf.render.vectors import Vectors


def encode_svg(vectors: Vectors, names=None) -> bytes:
    w, h = vectors.size_wh
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}">'
    ]
    last = None
    for r in vectors.regions:
        if r.paint != last:
            if last is not None:
                out.append("</g>")
            out.append(f'<g id="p{r.paint}">')
            last = r.paint
        out.append('<g fill="#%02x%02x%02x">' % r.rgb)
        for shape in r.shapes:
            out.append('<path d="%s"/>' % "".join(path(c) for c in shape))
        out.append("</g>")
    if last is not None:
        out.append("</g>")
    out.append("</svg>")
    return "\n".join(out).encode()


def path(curve):
    pts = np.rint(curve * 100).astype(int)
    at = pts[-1, 2]
    words = ["M" + num(at[0]) + " " + num(at[1]) + "c"]
    nums = []
    for seg in pts:
        for p in seg:
            nums += [num(p[0] - at[0]), num(p[1] - at[1])]
        at = seg[2]
    return words[0] + " ".join(nums) + "z"


def num(v):
    return f"{v / 100:g}"
