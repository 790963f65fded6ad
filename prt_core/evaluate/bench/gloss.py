"""All forms of view-dependent transport side by side: speed, bytes and error on one set of points.

Light is that of the sky alone, on the texels of the bake's own cube map, for all forms; surfaces
send none to each other. What each is measured against is the dense sum over the same texels.
"""

from prt_core.errors import expect, expect_all, expect_number, shown
from prt_core.evaluate.bench.in_out import in_out_steps
from prt_core.evaluate.bench.incoming import LABEL, MAPPED, incoming_steps
from prt_core.evaluate.bench.lobe_samples import dense_steps, lobe_sample_steps
from prt_core.evaluate.bench.reflection_maps import reflection_map_steps
from prt_core.evaluate.bench.transfer import transfer_steps
from prt_core.evaluate.bench.triple import triple_steps
from prt_core.evaluate.report import Report, curve_plot
from prt_core.reflectance import Microfacet, Phong, alphas

# Name -> what measures it: the dense sum is what all others are held against.
METHODS = {
    "dense": dense_steps,
    "default": incoming_steps,
    "terms": in_out_steps,
    "maps": reflection_map_steps,
    "harmonics": transfer_steps,
    "triple": triple_steps,
    "samples": lobe_sample_steps,
}
_FAMILIES = (
    "field of incoming light", "in-out terms", "reflection map", "harmonics", "triple product",
    "lobe samples",
)  # fmt: skip
_COLUMNS = [
    ("reflectance", ""), ("form", ""), ("view_us", ".2f"), ("view_ms", ".1f"), ("light_ms", ".1f"),
    ("seconds", ".1f"), ("megabytes", ".1f"), ("l2_mean", ".2%"), ("l2_worst", ".2%"),
    ("worst_light", ""), ("negative", ".1%"), ("facing", ",d"), ("points", ",d"), ("warning", ""),
]  # fmt: skip
_LABELS = {
    "view_us": "CPU microseconds a seen point and view",
    "light_ms": "CPU milliseconds a light, all points",
    "error": "error, %",
}


def gloss_reflectances(roughness=(0.3, 0.5, 0.7), exponents=(10.0,)):
    """White lobes by name.

    Parameters
    ----------
    roughness : sequence of float
        Sliders of GGX lobes, above 0 to 1.
    exponents : sequence of float
        Of Phong's lobes.

    Returns
    -------
    dict of str -> Reflectance

    Raises
    ------
    PRTError
        There are none, or one is out of range.
    """
    lobes = {}
    for slider in roughness:
        expect_number("roughness", slider, above=0, most=1)
        lobes[f"GGX {slider:g}"] = Microfacet(*alphas(slider))
    for exponent in exponents:
        expect_number("phong", exponent, 0, 1e6)
        lobes[f"Phong {exponent:g}"] = Phong(float(exponent))
    expect(lobes, "roughness, phong: give at least one of them")
    return lobes


def expect_methods(methods):
    """The methods as a list; `PRTError` where there are none or one is not of `METHODS`."""
    methods = expect_all("methods", methods, str, "names")
    bad = [name for name in methods if name not in METHODS]
    wanted = ", ".join(METHODS)
    expect(methods and not bad, f"methods: expected some of {wanted}; got {shown(bad or methods)}")
    return list(dict.fromkeys(methods))


def gloss_steps(task, methods=tuple(METHODS), settings=None):
    """Measure methods for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
    methods : sequence of str
        Of `METHODS`.
    settings : dict of str -> dict, optional
        Of methods, by name: what their steps take besides the task.

    Returns
    -------
    list of dict
        See `measured_steps`; method, and view_us, megabytes: microseconds of a view for each
        seen point, and 1e6 bytes. By reflectance, then by method.
    """
    rows = []
    for method in expect_methods(methods):
        more = (settings or {}).get(method, {})
        for row in (yield from METHODS[method](task, **more)):
            rows.append(
                {
                    "method": method,
                    **row,
                    "view_us": 1e3 * row["view_ms"] / row["facing"],
                    "megabytes": row["bytes"] / 1e6,
                    "warning": row.get("warning"),
                }
            )
    order = list(task.reflectances)
    return sorted(rows, key=lambda row: order.index(row["reflectance"]))


def nearer_and_quicker(rows):
    """Rows that are both quicker in a view and nearer than one of the default's, by reflectance.

    Parameters
    ----------
    rows : list of dict

    Returns
    -------
    list of (dict, dict)
        The row, and the default's; of the default those that another one of its own beats do not
        count.
    """

    def beats(row, other):
        if row["reflectance"] != other["reflectance"]:
            return False
        return row["view_us"] < other["view_us"] and row["l2_mean"] < other["l2_mean"]

    own = [row for row in rows if row["form"] in (LABEL, MAPPED)]
    best = [row for row in own if not any(beats(other, row) for other in own)]
    pairs = [(row, other) for row in rows for other in best if beats(row, other)]
    return [(row, other) for row, other in pairs if row not in own]


def gloss_plot(rows):
    """PNG: error against the time of a view and of a light, panels for each reflectance."""
    flat = [
        {**row, "error": 100 * row["l2_mean"], "family": family_of(row["form"])}
        for row in rows
        if row["method"] != "dense"
    ]
    return curve_plot(flat, ["view_us", "light_ms"], "error", "reflectance", "family", _LABELS)


def family_of(form):
    """What forms that differ in a number have in common; its line in the plot."""
    (family,) = (name for name in _FAMILIES if form.startswith(name))
    if family == "harmonics":
        family += ", clustered" if "components" in form else ", whole matrices"
    elif "clustered" in form:
        family += ", clustered"
    return family + _suffix(form)


def _suffix(form):
    if form.endswith(" texels apart"):
        return "" if form.endswith(" 0 texels apart") else ", bright texels apart"
    return ""


def gloss_report(task, rows, name):
    """A `Report` of what `gloss_steps` returned.

    Parameters
    ----------
    task : GlossTask
    rows : list of dict
    name : str
        Of the scene.

    Returns
    -------
    Report
    """
    transport = task.transport
    notes = [
        f"{name}: {transport.n_points:,} points, {task.n_facing:,} of them seen, "
        f"{transport.n_directions:,} texels of light, {len(task.lights)} lights: "
        f"{', '.join(task.lights)}.",
        "Direct light of the sky alone; all forms read the same texels. Errors are relative L2 "
        f"against the dense sum at {len(task.sample):,} of the seen points, mean and worst over "
        "the lights. A view is of all points, or of the sample's (see points); view us is for each "
        "seen point.",
    ]
    if any(row["method"] == "default" for row in rows):
        better = nearer_and_quicker(rows)
        said = "; ".join(f"{row['reflectance']}: {row['form']}" for row, _ in better)
        notes.append(f"Quicker in a view and nearer than the default: {said or 'none'}.")
    drawn = [row for row in rows if row["method"] != "dense"]
    plots = {"speed_error": gloss_plot(rows)} if drawn else {}
    return Report(f"Gloss: {name}", rows, _COLUMNS, notes, plots)
