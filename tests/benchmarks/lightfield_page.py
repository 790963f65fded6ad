"""docs/benchmarks/lightfield.md: the tables of light fields, on fields that Cycles was asked for.

    python tests/benchmarks/results.py --only lightfield

Fields are those of `lightfield_scenes.py`, tables those of `lightfield_tables.py`.
"""

import contextlib
import io
from functools import partial

from tests.benchmarks import lightfield_tables
from tests.benchmarks.lightfield_scenes import (
    ALPHAS,
    CASES,
    PEAK,
    ROOT,
    arrays_of,
    beside_cycles,
    captured,
    compressed,
    denoised,
    write_sheet,
)

PAGE = "lightfield"
SPHERE = "sphere_0.05"
LIKE_FIGURE_1 = [name for name, case in CASES.items() if case.paper_percent is not None]
# What figure 4 is judged by.
COUNTS = (16, 32)
SHOWN = ["soft_materials", SPHERE, *LIKE_FIGURE_1]
# Annealing takes minutes a count: it stands beside the hard memberships under Training.
CURVES = {name: curve for name, curve in lightfield_tables.CURVES.items() if "annealed" not in name}
# What the figure is held against: decibels at 16 and 32 coefficients, and beyond PCA at 16.
FLOORS = {0.5: (62.0, 66.0, None), 0.05: (36.5, 41.0, 15.0), 0.005: (37.5, 41.5, 20.0)}
# Sixty copies of each HRDF need not be trained on.
FEW_TRAINED = "ceob:share=0.01"
# An eighth of the paper's share, at its PSNR.
SHARE = 1 / 8


def table(rows):
    """Lines of Markdown of dicts with the same keys."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        lightfield_tables.printed(rows)
    return text.getvalue().splitlines()


def captures():
    """What was captured of every scene, how fast, and how noisy."""
    rows = []
    for name in CASES:
        report = captured(name).report
        rows.append(
            {
                "scene": name,
                "points": report["points"],
                "samples": report["samples"],
                "k paths a second": f"{report['paths_per_second'] / 1e3:.0f}",
                "seconds": f"{report['seconds']:.0f}",
                "noise of two seeds": f"{report['noise']:.1%}",
                "denoised": f"{report['denoised']:.0%}",
                "energy of all denoised": f"{denoised(name)[1]:.3f}",
            }
        )
    return [
        "`python tests/benchmarks/lightfield_scenes.py`: 32 x 16 angles, all lamps together. Noise "
        "is relative L2 of one seed before the denoiser, whose result the capture takes for "
        "objects that keep their energy within 1 %. All tables below are of the field denoised "
        "everywhere, with the energy of the last column: noise would be an error larger than the "
        "codings'. "
        "Seconds under the load of other work.",
        "",
        *table(rows),
    ]


def coefficients(alpha):
    """Figure 4 at a roughness."""
    luma = lightfield_tables.luma_of(arrays_of(f"sphere_{alpha}")[0])
    return coefficient_lines(alpha, lightfield_tables.coefficients(luma, PEAK, COUNTS, CURVES))


def coefficient_lines(alpha, measured):
    """Decibels by coefficients, and whether floors and the figure's order hold.

    Parameters
    ----------
    alpha : float
    measured : iterable of (str, list of float, float)
        See `lightfield_tables.coefficients`.
    """
    rows = {name: (figures, seconds) for name, figures, seconds in measured}
    shown = (
        {"method": name, **{f"{n}": f"{v:.1f}" for n, v in zip(COUNTS, figures, strict=True)},
         "CPU s": f"{seconds:.1f}"}
        for name, (figures, seconds) in rows.items()
    )  # fmt: skip
    return [
        f"`sphere_{alpha}`: PSNR of equation 5 of the luma (peak {PEAK:g}, the lamps' radiance; "
        f"per sample it is 27.1 dB higher) with {' and '.join(map(str, COUNTS))} coefficients: "
        "32 x 32 points, 32 x 16 angles, one cluster, 16 pairs. Seconds of CPU are of all counts.",
        "",
        *table(shown),
        "",
        *_judged(rows, *FLOORS[alpha]),
    ]


def _judged(rows, few, many, beyond):
    """Sentences on the floors and on the order of methods."""
    at = {name: figures[COUNTS.index(16)] for name, (figures, _) in rows.items()}
    ours = [rows["CEOB, hard"][0][COUNTS.index(count)] for count in (16, 32)]
    for count, value, floor in zip((16, 32), ours, (few, many), strict=True):
        yield f"- CEOB at {count}: {value:.1f} dB, floor {floor:g}: {_met(value >= floor)}."
    if beyond is not None:
        gain = ours[0] - at["PCA"]
        yield f"- Above PCA at 16: {gain:.1f} dB, floor {beyond:g}: {_met(gain >= beyond)}."
    best = sorted(at, key=at.get, reverse=True)
    above = [name for name in best if at[name] > at["CEOB, hard"]]
    order = f"above CEOB at 16 are {', '.join(above)}" if above else "CEOB is above all at 16"
    yield f"- Order: {order} ({', '.join(f'{name} {at[name]:.1f}' for name in best)})."


def _met(good):
    return "met" if good else "**missed**"


def sizes():
    """Bytes at one error by method."""
    radiance, frames, _ = arrays_of(SPHERE)
    rows = [
        {key: f"{v:.2f}" if isinstance(v, float) else v for key, v in row.items()}
        for row in lightfield_tables.sizes(radiance, frames, PEAK)
    ]
    return [
        f"`{SPHERE}`, R, G and B, {len(radiance):,} points, one cluster, 40 dB of equation 5 (67 a "
        "sample); percent of raw float32. A dictionary is of so many points here; with four times "
        "as many it weighs a quarter. Methods that cannot reach 40 dB are left out.",
        "",
        *table(rows),
    ]


def like_figure_1():
    """Table 1: sizes at the paper's PSNR, and views beside Cycles."""
    rows = []
    for name in LIKE_FIGURE_1:
        case, radiance = CASES[name], captured(name).radiance[0]
        # The floor's back is black: it costs nothing, so it does not count.
        raw = radiance[radiance.any(axis=(1, 2, 3))].nbytes
        floor = SHARE * case.paper_percent
        model, error, seconds = compressed(name, case.psnr)
        coded, fixed = (100 * n / raw for n in (model.coded_nbytes, model.nbytes))
        rows.append(
            {
                "scene": name, "lit points": raw // radiance[0].nbytes,
                "raw MB": f"{raw / 1e6:.1f}", "dB": f"{error.psnr:.1f}",
                "luma dB": f"{error.luma_psnr:.1f}", "a sample": f"{error.psnr_per_sample:.1f}",
                "fixed %": f"{fixed:.2f}", "coded %": f"{coded:.2f}",
                "the paper's %": f"{case.paper_percent:g}", "an eighth": f"{floor:.2f}",
                "floor": _met(coded <= floor), "fit s": f"{seconds:.0f}",
            }
        )  # fmt: skip
    return [
        f"Three scenes like the paper's figure 1 (peak {PEAK:g}), points at vertices, one cluster, "
        "compressed by CEOB to the PSNR of the paper's table 1. What is coded at such decibels is "
        "the noise that the captures' samples leave: see above.",
        "",
        *table(rows),
    ]


def pictures():
    """Rebuilt views beside Cycles renders of the same camera."""
    rows = []
    for name in SHOWN:
        measured, shown = beside_cycles(name)
        write_sheet(ROOT / "docs" / f"lightfield_{name.replace('.', '_')}.png", shown)
        rows += [
            {
                "scene": f"{name}: {item}", "PSNR": f"{CASES[name].psnr:g}",
                "light field": f"{away:.1%}", "Cycles, other seed": f"{noise:.1%}",
                "ratio": f"{away / noise:.1f}", "at most 1.3": _met(away <= 1.3 * noise),
            }
            for item, (away, noise) in measured.items()
        ]  # fmt: skip
    return [
        "Relative L2 against Cycles at 64 samples, of pixels that show captured surfaces alone, "
        "and that of Cycles with another seed. `soft_materials` is what points and angles like "
        "these are for: lobes and shadows wider than both. What a light field of few points and "
        "512 angles cannot show are edges finer than its points and reflections finer than some "
        "six degrees: in the other scenes that, and the denoiser on few samples, not the coding, "
        "is what is seen.",
        "",
        *table(rows),
        "",
        *(f"![{name}](../lightfield_{name.replace('.', '_')}.png)" for name in SHOWN),
    ]


def training():
    """Seconds of hard and annealed memberships."""
    luma = lightfield_tables.luma_of(arrays_of(SPHERE)[0])
    (row,) = lightfield_tables.training(luma, n_clusters=4)
    return [
        f"`lightfield_tables.py training` on `{SPHERE}`: {len(luma):,} HRDFs in 4 clusters, 16 "
        "pairs, 24 coefficients; seconds of CPU. Hard against annealed: "
        f"{row['hard'] / row['annealed']:.2f} of the time (floor a third: "
        f"{_met(row['hard'] <= row['annealed'] / 3)}).",
        "",
        *table([{key: f"{value:.3g}" for key, value in row.items()}]),
    ]


def frames():
    """Milliseconds of a view of 60,000 points."""
    radiance, frames, positions = arrays_of(SPHERE)
    rows = list(
        lightfield_tables.frames_table(radiance, frames, positions, PEAK, method=FEW_TRAINED)
    )
    decoded = rows[0]
    shown = [
        {key: f"{value:.1f}" if isinstance(value, float) else value for key, value in row.items()}
        for row in rows
    ]
    return [
        f"`lightfield_tables.py frames` on `{SPHERE}`, its points again and again up to 60,000, "
        "32 coefficients, R, G and B, bilinear, 24 views half a degree apart; medians. The load is "
        "that of the machine's two cores, which other work shared: wall time counts waiting for "
        f"them. From decoded blocks a view takes {decoded['wall ms']:.1f} ms of wall time (floor "
        f"15 ms: {_met(decoded['wall ms'] <= 15)} at a load of {decoded['load']:.0f}), "
        f"{decoded['CPU ms']:.1f} ms of CPU over all threads.",
        "",
        *table(shown),
    ]


def flicker():
    """Second differences over half degrees."""
    (row,) = lightfield_tables.flicker(*arrays_of(SPHERE), PEAK)
    return [
        f"`lightfield_tables.py flicker` on `{SPHERE}`: the root mean square second difference "
        "over 24 views half a degree apart, bilinear in angle against the nearest cell; floor a "
        f"fifth: {_met(row['ratio'] <= 0.2)}.",
        "",
        *table([row]),
    ]


SECTIONS = {
    "Captures": captures,
    **{f"Figure 4, alpha {alpha}": partial(coefficients, alpha) for alpha in ALPHAS},
    "Sizes at one error": sizes,
    "Scenes like figure 1": like_figure_1,
    "Views beside Cycles": pictures,
    "Training": training,
    "A frame": frames,
    "Flicker": flicker,
}
