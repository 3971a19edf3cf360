"""The display of a result: an HTML report, pictures, and the output in a notebook."""

from __future__ import annotations

from cylx.optional.matplotlib import check_pictures
from cylx.report.notebook import NotebookView, show
from cylx.report.page import html_of
from cylx.report.picture import plot_scene, png_of
from cylx.report.plots import plot_radii, plot_residuals

__all__ = [
    "NotebookView",
    "check_pictures",
    "html_of",
    "plot_radii",
    "plot_residuals",
    "plot_scene",
    "png_of",
    "show",
]
