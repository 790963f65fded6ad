"""What a result looks like and how far it is from the truth."""

from prt_core.evaluate.metrics import colour_error
from prt_core.evaluate.view import auto_camera, contact_sheet, render_view, to_srgb, write_png

__all__ = [
    "auto_camera",
    "colour_error",
    "contact_sheet",
    "render_view",
    "to_srgb",
    "write_png",
]
