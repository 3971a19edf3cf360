"""A result to look at: a page that explains itself, and a picture."""

from __future__ import annotations

from cylx.report.page import html_of
from cylx.report.picture import check_pictures, png_of

__all__ = ["check_pictures", "html_of", "png_of"]
