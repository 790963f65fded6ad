"""Compressed surface light fields: the tables of docs/benchmarks, as Markdown.

    python tests/benchmarks/lightfield_tables.py coefficients FIELD.npz ...   # figure 4
    python tests/benchmarks/lightfield_tables.py sizes FIELD.npz [PSNR]       # bytes at one error
    python tests/benchmarks/lightfield_tables.py clusters FIELD.npz [PSNR]    # clusters and pairs
    python tests/benchmarks/lightfield_tables.py dictionary FIELD.npz [PSNR]  # bits, training set
    python tests/benchmarks/lightfield_tables.py code FIELD.npz [PSNR]        # coders of numbers
    python tests/benchmarks/lightfield_tables.py wavelets4d FIELD.npz         # over points as well
    python tests/benchmarks/lightfield_tables.py training FIELD.npz           # hard and annealed
    python tests/benchmarks/lightfield_tables.py frames FIELD.npz [N_POINTS]  # milliseconds a view
    python tests/benchmarks/lightfield_tables.py flicker FIELD.npz            # over half degrees

A FIELD.npz has `radiance` (n_points, m1, m2, 3), `frames` (n_points, 3, 3), `positions`
(n_points, 3) and `peak`, the radiance of the brightest lamp; the functions take the arrays.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core import PRTError, run  # noqa: E402
from prt_core.basis import PointHaar  # noqa: E402
from prt_core.compress.dictionaries.exemplar import cost_of, train_pairs_steps  # noqa: E402
from prt_core.compress.dictionaries.sparsity import Sparsity  # noqa: E402
from prt_core.lightfield import (  # noqa: E402
    METHODS,
    SurfaceLightField,
    cluster_hrdfs_steps,
    to_ycbcr,
)
from prt_core.lightfield.code import SparseRows, entropy_coded  # noqa: E402
from prt_core.lightfield.compressor import rounded  # noqa: E402
from prt_core.lightfield.hrdf import FROM_YCBCR  # noqa: E402
from prt_core.lightfield.rivals.haar import haar_basis  # noqa: E402
from prt_core.runtime.machine import peak_bytes, reset_peak  # noqa: E402

COUNTS = (4, 8, 16, 32, 64)
# CEOB's rows of the table: memberships, and what figure 4 counts with.
CURVES = {
    "CEOB, annealed as published": ("ceob", {"training": "annealed", "bits": 12}),
    "CEOB, hard": ("ceob", {"bits": 12}),
    "PCA": ("cpca", {"bits": 16}),
    "K-SVD, 64 atoms": ("ksvd", {}),
    "harmonics": ("harmonics", {}),
    "2D Haar": ("haar", {}),
    "2D cosines": ("dct", {}),
}
SIZED = ("ceob", "cpca", "ksvd", "harmonics", "haar", "dct")
PSNR = 40.0


def read_field(path):
    """The arrays of a file: radiance, frames, positions, peak."""
    with np.load(path) as file:
        return {name: file[name] for name in ("radiance", "frames", "positions")} | {
            "peak": float(file["peak"])
        }


def luma_of(radiance):
    """(n, m1, m2) float32."""
    return np.ascontiguousarray(to_ycbcr(radiance)[..., 0])


def decibels(model, hrdfs, peak):
    """PSNR of equation 5 of one channel."""
    error = np.square(model.decode(slice(None)) - hrdfs, dtype=np.float64).sum() / len(hrdfs)
    return 20 * np.log10(peak / np.sqrt(error))


def coefficients(hrdfs, peak, counts=COUNTS, curves=CURVES):
    """Figure 4: PSNR by the number of coefficients, one cluster; rows of (name, figures, seconds).

    Each count has a dictionary of its own, trained with it.
    """
    for name, (method, settings) in curves.items():
        figures, began = [], time.process_time()
        for count in counts:
            model = METHODS[method](n_coefficients=count, **settings).fit(hrdfs)
            figures.append(decibels(model, hrdfs, peak))
        yield name, figures, time.process_time() - began


def sizes(radiance, frames, peak, psnr=PSNR, methods=SIZED, n_clusters=1):
    """Share of raw float32 at one error, at fixed width and coded; a row a method."""
    for method in methods:
        began = time.process_time()
        field = SurfaceLightField(method, psnr=psnr, peak=peak, n_clusters=n_clusters)
        try:
            field.fit(radiance, frames)
        except PRTError as error:
            print(f"{method}: {error}", file=sys.stderr)
            continue
        error = field.error(radiance)
        numbers = [m.n_numbers_ / len(radiance) for m in field.compressors_[0]]
        dictionary = sum(m.dictionary_nbytes for m in field.compressors_[0])
        yield {
            "method": method,
            "psnr": error.psnr,
            "luma": error.luma_psnr,
            "per sample": error.psnr_per_sample,
            "fixed %": 100 * field.nbytes / radiance.nbytes,
            "coded %": 100 * field.coded_nbytes / radiance.nbytes,
            "dictionary %": 100 * dictionary / radiance.nbytes,
            "numbers Y, Cb, Cr": "/".join(f"{n:.1f}" for n in numbers),
            "CPU s": time.process_time() - began,
        }


def clusters(radiance, frames, peak, psnr=PSNR, counts=(1, 2, 4, 8, 16, 32), pairs=(4, 8, 16, 32)):
    """Coded share of raw for numbers of clusters and pairs; a row a number of clusters."""
    for n_clusters in counts:
        row = {"clusters": n_clusters}
        for n_pairs in pairs:
            text = f"ceob:n_pairs={n_pairs}"
            (size,) = sizes(radiance, frames, peak, psnr, [text], n_clusters)
            row[f"{n_pairs} pairs"] = size["coded %"]
        yield row


def dictionary(radiance, frames, peak, psnr=PSNR):
    """What bits of the dictionary, the training set and its coefficients do; a row a setting."""
    for setting in (
        "bits=6", "bits=8", "bits=10", "bits=12", "bits=16", "share=0.2", "share=0.5",
        "share=1.0", "n_training=12", "n_training=16", "n_training=32", "n_training=48",
    ):  # fmt: skip
        (row,) = sizes(radiance, frames, peak, psnr, [f"ceob:{setting}"])
        yield row


def code(radiance, frames, peak, psnr=PSNR):
    """Bytes of each plane of a CEOB field's luma, and what its entropy alone would be."""
    field = SurfaceLightField("ceob", psnr=psnr, peak=peak).fit(radiance, frames)
    model = field.compressors_[0][0]
    rows, n_places = model.rows_, model.shape_[0] * model.shape_[1]
    state = model.state()
    kept = 0.0
    for basis in range(len(model.left_)):
        members = np.flatnonzero(rows.basis == basis)
        counts = np.bincount(rows.some(members).places, minlength=n_places)
        kept += sum(binary_entropy(counts / max(len(members), 1))) * len(members)
    sizes_of = np.abs(rows.numbers)
    exponents = np.frexp(sizes_of.astype(float))[1] - 1
    ideal = {
        "kept": kept / 8,
        "exponents": entropy(exponents) * len(exponents) / 8,
        "signs": len(sizes_of) / 8,
        "low_bits": exponents.sum() / 8,
        "pair": entropy(rows.basis) * len(rows.basis) / 8,
    }
    for name, nbytes in ideal.items():
        yield {"plane": name, "zstd, bytes": state[name].nbytes, "entropy, bytes": nbytes}


def wavelets4d(radiance, frames, positions, peak, psnr=PSNR, depths=(0, 2, 4, 8, None)):
    """Haar wavelets over points as well as angles, one threshold, the same coder; a row a depth.

    Depth 0 is 2D Haar; None are all levels of the tree of points. Decoding one point then takes
    the whole path of the tree, which a view of all points shares.
    """
    points, strengths = PointHaar(positions, frames[:, 2]), np.linalg.norm(FROM_YCBCR, axis=1)
    bases = [haar_basis(size).astype(np.float32) for size in radiance.shape[1:3]]
    channels = (
        np.moveaxis(to_ycbcr(radiance), -1, 0) * (strengths / np.sqrt(3))[:, None, None, None]
    )
    tables = [(bases[0].T @ channel @ bases[1]).reshape(len(radiance), -1) for channel in channels]
    budget = len(radiance) * peak**2 * 10 ** (-psnr / 10)
    for depth in depths:
        steps = points.depth if depth is None else min(depth, points.depth)
        spread = [points.forward(table.T, steps).T.astype(np.float32) for table in tables]
        low, high = 1e-4 * peak, peak
        while high / low > 1.005:
            middle = np.sqrt(low * high)
            numbers = [rounded(np.where(np.abs(t) > middle, t, 0), 1.25 * middle) for t in spread]
            error = sum(
                np.square(t - n * (1.25 * middle), dtype=np.float64).sum()
                for t, n in zip(spread, numbers, strict=True)
            )
            low, high = (middle, high) if error <= budget else (low, middle)
        numbers = [rounded(np.where(np.abs(t) > low, t, 0), 1.25 * low) for t in spread]
        levels = points.scales(steps).astype(np.int32)
        coded = 0
        for table in numbers:
            rows = SparseRows.of_table(levels, table)
            planes = entropy_coded(rows, int(levels.max()) + 1, table.shape[1])
            coded += sum(plane.nbytes for plane in planes.values())
        yield {
            "levels of points": steps,
            "numbers Y, Cb, Cr": "/".join(f"{np.count_nonzero(n) / len(n):.1f}" for n in numbers),
            "coded %": 100 * coded / radiance.nbytes,
        }


def entropy(symbols):
    """Bits a symbol."""
    share = np.unique(symbols, return_counts=True)[1] / len(symbols)
    return -(share * np.log2(share)).sum()


def binary_entropy(shares):
    """Bits of yes or no, by the share of yes."""
    inside = shares[(shares > 0) & (shares < 1)]
    return -(inside * np.log2(inside) + (1 - inside) * np.log2(1 - inside))


def training(hrdfs, n_clusters=32, n_pairs=16, count=24, seed=0):
    """CPU seconds to cluster, and to train the same clusters with either kind of memberships."""
    reset_peak()
    before = peak_bytes()
    began = time.process_time()
    labels = run(cluster_hrdfs_steps(hrdfs, n_clusters, seed))
    seconds = {"clusters": time.process_time() - began}
    for kind in ("hard", "annealed"):
        began, error = time.process_time(), 0.0
        for cluster in range(labels.max() + 1):
            members = hrdfs[labels == cluster]
            pairs = run(train_pairs_steps(members, n_pairs, Sparsity(count), kind, seed))
            error += least_error(members, pairs, Sparsity(count))
        seconds[kind] = time.process_time() - began
        seconds[f"{kind}: mean squared error"] = error / len(hrdfs)
    seconds["memory, GB"] = (peak_bytes() - before) / 1e9
    yield seconds


def least_error(members, pairs, sparsity):
    return np.min([cost_of(members, p, sparsity) for p in zip(*pairs, strict=True)], axis=0).sum()


def copies(radiance, frames, positions, n_points):
    """So many points: those that are there, again and again."""
    index = np.arange(n_points) % len(radiance)
    return radiance[index], frames[index], positions[index]


def orbit(positions, n_views=24, degrees=0.5, distance=4.0):
    """(n_views, n_points, 3) float32: directions to viewers half a degree apart."""
    middle, size = positions.mean(axis=0), np.ptp(positions, axis=0).max() / 2
    angles = np.radians(degrees * np.arange(n_views))
    for angle in angles:
        eye = middle + distance * size * np.array([np.cos(angle), np.sin(angle), 0.6])
        ways = eye - positions
        yield (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)


def frames_table(radiance, frames, positions, peak, n_points=60_000, count=32, method="ceob"):
    """Milliseconds of a view of so many points: decoded, and from coefficients, by turns."""
    radiance, frames, positions = copies(radiance, frames, positions, n_points)
    field = SurfaceLightField(method, n_coefficients=count, peak=peak).fit(radiance, frames)
    began = time.perf_counter()
    decoded = field.viewer(most_bytes=1 << 40)
    seconds = time.perf_counter() - began
    viewers = {"decoded once": decoded, "from coefficients": field.viewer(most_bytes=0)}
    times = {name: [] for name in viewers}
    for ways in orbit(positions):
        for name, viewer in viewers.items():
            wall, cpu = time.perf_counter(), time.process_time()
            viewer.toward(ways)
            times[name].append((time.perf_counter() - wall, time.process_time() - cpu))
    for name, measured in times.items():
        # The first view makes what later ones use.
        wall, cpu = np.median(measured[1:], axis=0) * 1e3
        best = 1e3 * min(wall for wall, _ in measured[1:])
        yield {
            "view": name, "wall ms": wall, "best ms": best, "CPU ms": cpu,
            "decode s": seconds if name == "decoded once" else 0.0, "load": os.getloadavg()[0],
        }  # fmt: skip


def flicker(radiance, frames, positions, peak, psnr=PSNR):
    """Second difference of points that face all of 24 views: bilinear, and the nearest cell."""
    field = SurfaceLightField("ceob", psnr=psnr, peak=peak).fit(radiance, frames)
    table = field.decode(slice(None)).reshape(len(radiance), -1, 3)
    smooth, steps, every = [], [], np.arange(len(radiance))
    facing = np.ones(len(radiance), bool)
    for ways in orbit(positions):
        smooth.append(field.toward(ways))
        local = np.einsum("nij,nj->ni", frames, ways)
        facing &= local[:, 2] > 0
        steps.append(table[every, field.layout_.nearest(local)])
    bilinear, nearest = (
        float(np.sqrt(np.square(np.diff(views, 2, axis=0)[:, facing]).mean()))
        for views in (smooth, steps)
    )
    yield {"bilinear": bilinear, "nearest": nearest, "ratio": bilinear / nearest}


def printed(rows):
    """A Markdown table of dicts with the same keys."""
    for i, row in enumerate(rows):
        if not i:
            print("| " + " | ".join(row) + " |\n|" + "---|" * len(row))
        cells = (f"{v:.3f}" if isinstance(v, float) else str(v) for v in row.values())
        print("| " + " | ".join(cells) + " |", flush=True)


def main(table, path, *rest):
    field = read_field(path)
    radiance, frames, positions, peak = (
        field[name] for name in ("radiance", "frames", "positions", "peak")
    )
    if table == "coefficients":
        for each in (path, *rest):
            field = read_field(each)
            print(f"\n{Path(each).stem}: {', '.join(map(str, COUNTS))} coefficients\n")
            rows = coefficients(luma_of(field["radiance"]), field["peak"])
            named = (
                {"method": name, "dB": " ".join(f"{v:.1f}" for v in figures), "CPU s": seconds}
                for name, figures, seconds in rows
            )
            printed(named)
    elif table in ("sizes", "clusters", "dictionary", "code"):
        printed(globals()[table](radiance, frames, peak, *map(float, rest)))
    elif table == "wavelets4d":
        printed(wavelets4d(radiance, frames, positions, peak))
    elif table == "training":
        printed(training(luma_of(radiance)))
    elif table == "frames":
        printed(frames_table(radiance, frames, positions, peak, *map(int, rest)))
    elif table == "flicker":
        printed(flicker(radiance, frames, positions, peak))
    else:
        raise SystemExit(__doc__)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
