"""What all sections of the panel have in common."""

# Lines of a text that the panel shows before it is cut off, and of notes.
_MOST_LINES, _MOST_NOTES = 2, 8


class Panel:
    """Where the panels are."""

    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "PRT"

    def split(self):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout


def lines(layout, text, icon, context):
    """Text of any length, cut between words to the panel's width."""
    _draw(layout, _cut(text, context.region.width, context), icon)


def clipped_lines(layout, text, icon, context):
    """The beginning of a text: as much as fits into two lines."""
    parts = _cut(text, context.region.width, context)
    if len(parts) > _MOST_LINES:
        parts[_MOST_LINES - 1 :] = [parts[_MOST_LINES - 1] + " …"]
    _draw(layout, parts, icon)


def wide_lines(layout, text, icon, width, context):
    """Text of any length in a dialog that is so many pixels wide."""
    scale = context.preferences.system.ui_scale
    _draw(layout, _cut(text, width * scale, context), icon)


def _cut(text, pixels, context):
    width = max(20, int(pixels / (7 * context.preferences.system.ui_scale)) - 4)
    parts, line = [], ""
    for word in text.split():
        if line and len(line) + len(word) >= width:
            parts.append(line)
            line = ""
        line = f"{line} {word}".strip()
    return [*parts, line]


def _draw(layout, parts, icon):
    column = layout.column(align=True)
    column.scale_y = 0.8
    for index, part in enumerate(parts):
        column.label(text=part, icon="BLANK1" if index else icon)


def notes(layout, text, context):
    """What a bake has to say of itself, a line each."""
    texts = text.split("\n") if text else []
    for each in texts[:_MOST_NOTES]:
        lines(layout, each, "DOT", context)
    if len(texts) > _MOST_NOTES:
        layout.label(text=f"and {len(texts) - _MOST_NOTES} more")


def seconds(value):
    """A time in words."""
    return f"{max(value, 1):.0f} s" if value < 120 else f"{value / 60:.0f} min"


def megabytes(value):
    """A size in words."""
    return f"{value / 1e6:.0f} MB" if value < 2e9 else f"{value / 1e9:.1f} GB"
