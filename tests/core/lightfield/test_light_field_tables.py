"""The functions behind the tables of light fields, on a field of a few points."""

import numpy as np

from tests.benchmarks import lightfield_tables as tables

PEAK = 4.0


def test_tables_are_made_of_arrays(field):
    radiance, frames, positions = field
    radiance = radiance[0]
    luma = tables.luma_of(radiance)
    curves = {"haar": ("haar", {}), "pairs": ("ceob", {"n_pairs": 3, "bits": 12})}
    rows = {name: figures for name, figures, _ in tables.coefficients(luma, PEAK, (2, 9), curves)}
    assert all(low < high for low, high in rows.values())
    assert rows["pairs"][0] > rows["haar"][0]
    (size,) = tables.sizes(radiance, frames, PEAK, 25.0, ["haar"])
    assert 25 <= size["psnr"] < 26 and 0 < size["coded %"] < 100
    planes = list(tables.code(radiance, frames, PEAK, 25.0))
    assert len(planes) == 5 and all(row["entropy, bytes"] >= 0 for row in planes)
    plain, over_points = tables.wavelets4d(radiance, frames, positions, PEAK, 25.0, (0, 2))
    assert plain["levels of points"] == 0 and over_points["coded %"] > 0
    (seconds,) = tables.training(luma, 2, 3, 4)
    assert seconds["hard"] > 0 and seconds["annealed"] > 0
    (ratio,) = tables.flicker(radiance, frames, positions, PEAK, 25.0)
    assert ratio["bilinear"] < 0.2 * ratio["nearest"]
    views = list(tables.frames_table(radiance, frames, positions, PEAK, 70, 4))
    assert [row["view"] for row in views] == ["decoded once", "from coefficients"]


def test_a_file_is_read_as_it_was_written(field, tmp_path):
    radiance, frames, positions = field
    path = tmp_path / "field.npz"
    np.savez(path, radiance=radiance[0], frames=frames, positions=positions, peak=PEAK)
    read = tables.read_field(path)
    assert np.array_equal(read["radiance"], radiance[0]) and read["peak"] == PEAK
    assert np.array_equal(read["frames"], frames)
    assert np.array_equal(read["positions"], positions)
