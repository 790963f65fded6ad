"""What a result looks like and how far it is from the truth."""

from prt_core.evaluate.metrics import colour_error
from prt_core.evaluate.png import to_display, to_srgb, to_whole, write_png
from prt_core.evaluate.view import contact_sheet, render_view

__all__ = [
    "colour_error",
    "contact_sheet",
    "render_view",
    "to_display",
    "to_srgb",
    "to_whole",
    "write_png",
]
