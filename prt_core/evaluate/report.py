"""A measurement as files: rows as JSON and CSV, plots as PNG, and one HTML page that holds it all.

    report = Report("Sampling", rows, columns, plots={"error": png}, pictures=[("truth", image)])
    write_report(folder, report)

Nothing here knows what was measured; plots and pictures come as PNG bytes and pixel arrays.
"""

import base64
import csv
import html
import io
import json
import time
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from prt_core.errors import PRTError, expect_path
from prt_core.evaluate.png import png_bytes
from prt_core.runtime.files import new_folder, written

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 1240px; color: #222; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px; }
th, td { padding: 3px 9px; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap; }
th { position: sticky; top: 0; background: #fff; } td.text, th.text { text-align: left; }
.wide { overflow-x: auto; } img { max-width: 100%; }
figure { display: inline-block; margin: 0 8px 12px 0; vertical-align: top; }
figcaption { font-size: 12px; color: #555; max-width: 400px; }
details { margin: 1em 0; } pre { font-size: 12px; overflow-x: auto; background: #f6f6f6; }
"""


@dataclass
class Report:
    """What a benchmark hands over.

    Attributes
    ----------
    title : str
    rows : list of dict
        One for each measurement; values are numbers, strings, None, or dicts of such.
    columns : list of (str, str)
        Key and format of the columns that the page's table shows, such as `("rays", ",d")`. A
        dot in a key reaches into a dict.
    notes : list of str
        Sentences above the table.
    plots : dict of str -> bytes
        PNG files by their names.
    pictures : list of (str, list of (str, (height, width, 3) uint8))
        Headings, and under each captioned pictures side by side.
    """

    title: str
    rows: list
    columns: list
    notes: list = field(default_factory=list)
    plots: dict = field(default_factory=dict)
    pictures: list = field(default_factory=list)


def write_report(folder, report):
    """Write rows.json, rows.csv, NAME.png of each plot and report.html.

    Parameters
    ----------
    folder : str or Path
        Made where it is missing.
    report : Report

    Returns
    -------
    Path
        Of the page, which needs no other file.
    """
    flat = [flattened(row) for row in report.rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, names)
    writer.writeheader()
    writer.writerows(flat)
    files = {
        "rows.json": (json.dumps(report.rows, indent=1) + "\n").encode(),
        "rows.csv": table.getvalue().encode(),
        **{f"{name}.png": data for name, data in report.plots.items()},
        "report.html": _page(report, flat).encode(),
    }
    folder = expect_path("report", folder)
    with new_folder(folder), ExitStack() as parts:
        # Named at the end: a report that is there stays whole until this one is.
        for name, data in files.items():
            parts.enter_context(written(folder / name)).write_bytes(data)
    return folder / "report.html"


def flattened(row, prefix=""):
    """A row without dicts inside: {"seconds": {"dense": 1}} becomes {"seconds.dense": 1}."""
    flat = {}
    for key, value in row.items():
        if isinstance(value, dict):
            flat.update(flattened(value, f"{prefix}{key}."))
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def curve_plot(rows, x, y, panels, series, labels=None, logarithmic=("x", "y")):
    """One panel for each value of a key: y against x, a line for each value of another.

    Parameters
    ----------
    rows : list of dict
        Flat.
    x : str or list of str
        With several, a column of panels for each.
    y, panels, series : str
        Keys; rows without a number above zero for x or y are left out of that panel.
    labels : dict of str -> str, optional
        Axis labels by key.
    logarithmic : tuple of {"x", "y"}

    Returns
    -------
    bytes
        PNG.

    Raises
    ------
    PRTError
        matplotlib is not installed.
    """
    figure_class = _matplotlib()
    keys = [x] if isinstance(x, str) else list(x)
    labels = labels or {}
    names = list(dict.fromkeys(row[panels] for row in rows))
    groups = list(dict.fromkeys(row[series] for row in rows))
    figure = figure_class(figsize=(5.2 * len(keys), 3.6 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), len(keys), squeeze=False)
    for i, name in enumerate(names):
        for j, key in enumerate(keys):
            axis = axes[i, j]
            for place, group in enumerate(groups):
                points = sorted(
                    (row[key], row[y])
                    for row in rows
                    if row[panels] == name and row[series] == group and _drawn(row, (key, y))
                )
                if points:
                    axis.plot(*zip(*points, strict=True), "o-", label=group, color=f"C{place % 10}")
            for way in logarithmic:
                _logarithmic(axis, way)
            axis.set(title=name, xlabel=labels.get(key, key), ylabel=labels.get(y, y))
            axis.grid(True, which="both", alpha=0.25)
    _legend(figure, axes)
    return _png(figure)


def _legend(figure, axes):
    """All series of all panels, above them, where no point is hidden."""
    lines = {}
    for axis in axes.flat:
        for line in axis.get_lines():
            lines.setdefault(line.get_label(), line)
    # In points, at the size of the text: some of them for a letter, and for the line beside it.
    widest = 4.2 * max(map(len, lines), default=1) + 45
    columns = max(1, int(72 * figure.get_figwidth() / widest))
    figure.legend(
        lines.values(), lines.keys(), fontsize=8, ncols=columns, loc="outside upper center"
    )


def _logarithmic(axis, way):
    """A logarithmic axis whose numbers are written out: 0.2, 0.5, 1, 2, 5 …; fewer on long ones."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    getattr(axis, f"set_{way}scale")("log")
    ticks = getattr(axis, f"{way}axis")
    least, most = getattr(axis, f"get_{way}lim")()
    ticks.set_major_locator(LogLocator(subs=(1, 2, 5) if most < 300 * least else (1,)))
    ticks.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ticks.set_minor_formatter(NullFormatter())


def _drawn(row, keys):
    return all(isinstance(row.get(key), int | float) and row[key] > 0 for key in keys)


def heat_colours(values, low=None, high=None, logarithmic=False):
    """Values as colours, dark blue to yellow.

    Parameters
    ----------
    values : (n,) float
    low, high : float, optional
        Ends of the scale; default: those of the values.
    logarithmic : bool

    Returns
    -------
    (n, 3) float32
        Linear Rec.709, as the view renderer takes radiance.
    """
    values = np.asarray(values, np.float64)
    if logarithmic:
        values = np.log(np.maximum(values, 1e-12))
        low = None if low is None else np.log(low)
        high = None if high is None else np.log(high)
    low = values.min() if low is None else low
    high = values.max() if high is None else high
    place = np.clip((values - low) / max(high - low, 1e-12), 0, 1)
    _matplotlib()
    from matplotlib import colormaps

    shown = colormaps["viridis"](place)[:, :3]
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


def _matplotlib():
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise PRTError(
            f"report: plots need matplotlib ({error}); pip install 'prt-core[report]'"
        ) from error
    return Figure


def expect_plots():
    """Raise `PRTError` where plots cannot be drawn: before the work that they are to show."""
    _matplotlib()


def _png(figure):
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _page(report, flat):
    parts = [
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(report.title)}"
        f"</title><style>{_STYLE}</style><h1>{html.escape(report.title)}</h1>",
        f"<p>{time.strftime('%Y-%m-%d %H:%M')}</p>",
        *(f"<p>{html.escape(note)}</p>" for note in report.notes),
        _table(flat, report.columns),
    ]
    for name, data in report.plots.items():
        parts.append(f"<h2>{html.escape(name)}</h2>{_image(data, name)}")
    for heading, pictures in report.pictures:
        parts.append(f"<h2>{html.escape(heading)}</h2>")
        for caption, image in pictures:
            parts.append(
                f"<figure>{_image(png_bytes(image), caption)}"
                f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            )
    rows = html.escape(json.dumps(report.rows, indent=1))
    parts.append(f"<details><summary>All rows as JSON</summary><pre>{rows}</pre></details></html>")
    return "\n".join(parts)


def _table(flat, columns):
    numbers = {key for key, _ in columns if any(_is_number(row.get(key)) for row in flat)}

    def cell(tag, key, text):
        kind = "" if key in numbers else " class=text"
        return f"<{tag}{kind}>{html.escape(text)}</{tag}>"

    lines = ["<div class=wide><table><tr>"]
    lines += [cell("th", key, key.replace("_", " ").replace(".", ": ")) for key, _ in columns]
    for row in flat:
        lines.append("</tr><tr>")
        lines += [cell("td", key, _shown(row.get(key), style)) for key, style in columns]
    return "".join(lines) + "</tr></table></div>"


def _is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(value, style):
    if value is None:
        return ""
    return format(value, style) if _is_number(value) else str(value)


def _image(data, name):
    text = base64.b64encode(data).decode()
    return f'<img alt="{html.escape(name)}" src="data:image/png;base64,{text}">'
