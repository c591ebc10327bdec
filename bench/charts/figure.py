"""A drawn figure as a file: PNG to look at, SVG to print; the same figure gives the same bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Form = Literal["png", "svg"]
FORMS: tuple[Form, ...] = ("png", "svg")
DPI = 110
DARK, LIGHT = "#444444", "#dddddd"  # words beside the data; the grid
FEW = 5.0  # high over low, up to which ticks are evenly apart in value
# text stays text, element names do not depend on the run, no date
DRAWN: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "toonset"}
WITHOUT_DATE: dict[Form, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that lays itself out."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def figure_bytes(figure: Figure, form: Form) -> bytes:
    """Return the figure as a file of this form."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context(DRAWN):
        figure.savefig(buffer, format=form, metadata=WITHOUT_DATE[form])
    return buffer.getvalue()


def log_ticks(axis: Axis, low: float, high: float) -> None:
    """Write plain numbers along a logarithmic axis from low to high: few, and no powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    subs = (1.0, 2.0, 5.0) if high / low < 1000 else (1.0,)
    axis.set_major_locator(
        MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
        if high / low < FEW
        else LogLocator(subs=subs, numticks=12)
    )
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
