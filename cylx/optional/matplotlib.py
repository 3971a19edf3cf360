"""Figures of matplotlib, which is an extra; made without a display and without the state of pyplot."""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING, Literal

from cylx.optional.extras import require

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_pictures() -> None:
    """Check that matplotlib is installed, before anything is computed.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    try:
        require("matplotlib", place="the picture")
    except ValueError:  # MPLBACKEND names the window of a notebook that is not installed here; we need none
        os.environ["MPLBACKEND"] = "agg"
        for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
            del sys.modules[name]  # half imported
        require("matplotlib", place="the picture")


def new_figure(inches: tuple[float, float], dpi: int, *, layout: Literal["constrained"] | None = None) -> Figure:
    """Make an empty figure.

    Parameters
    ----------
    inches : pair of float
        Width and height.
    dpi : int
        Pixels per inch.
    layout : {'constrained'}, optional
        Layout engine; by default the parts of the figure set their own positions.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    check_pictures()
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  an extra
    from matplotlib.figure import Figure  # noqa: PLC0415  an extra

    class ShownFigure(Figure):  # type: ignore[misc, unused-ignore]  # without matplotlib it has no types
        """A figure that a notebook shows although pyplot does not know it."""

        def _repr_png_(self) -> bytes:
            picture = io.BytesIO()
            self.savefig(picture, format="png")
            return picture.getvalue()

    figure = ShownFigure(figsize=inches, dpi=dpi, layout=layout)
    FigureCanvasAgg(figure)
    return figure
