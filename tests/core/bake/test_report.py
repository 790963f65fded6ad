"""A bake's report in words: all of a few, the gravest of many."""

from prt_core.bake.report_lines import object_lines, origin_lines, report_lines


def estimate(error):
    return {"error": error, "low": error / 2, "high": error * 2}


def report(n_groups):
    certificate = [
        {"name": f"group {i}", "matrix": estimate(0.05), "relit": {"sky": estimate(i / 1e4)}}
        for i in range(n_groups)
    ]
    return {
        "points": 7, "directions": 54, "rays": 11, "back_end": "embree", "rays_per_second": 3.0,
        "seconds": {"visibility": 1.0}, "bytes": 5, "peak_bytes": 13, "method": "agreement",
        "entries_percent": 2.0, "hemisphere_percent": 4.0, "certificate": certificate,
        "visibility_error": (n_groups - 1) / 1e4, "tolerance": 0.01, "tolerance_met": True,
        "error": None, "messages": [],
    }  # fmt: skip


def test_few_groups_are_all_written_out_in_their_order():
    lines = [line for line in report_lines("a.prt", report(5)) if "group" in line]
    assert [line.split(":")[0].split()[-1] for line in lines] == list("01234")


def test_of_many_groups_the_worst_are_written_out():
    lines = list(report_lines("a.prt", report(480)))
    shown = [line for line in lines if "group" in line]
    assert len(lines) < 20 and len(shown) == 8 and "group 479" in shown[0]
    assert any("and 472 more: at most 4.71%" in line for line in lines)


def test_objects_are_summed_up():
    objects = [{"name": f"o{i}", "n_corners": i, "receives": i % 2 == 0} for i in range(494)]
    lines = list(object_lines(objects))
    assert len(lines) == 10 and "o493" in lines[0]
    others = [item for item in objects if item["n_corners"] < 486]
    for kind, receives in (("receives", True), ("casts and bounces only", False)):
        subset = [item["n_corners"] for item in others if item["receives"] == receives]
        assert f"  object  and {len(subset):,} more: {sum(subset):,} corners, {kind}" in lines
    assert len(list(object_lines(objects[:3]))) == 3


def test_what_is_to_be_said_is_counted():
    lines = list(report_lines("a.prt", report(5) | {"messages": ["one", "two", "three"]}))
    assert lines[-4:] == [
        "  notes   3, those that concern most of the scene first",
        "  note    one",
        "  note    two",
        "  note    three",
    ]
    silent = report_lines("a.prt", report(5) | {"messages": []})
    assert not any("note" in line for line in silent)


def test_the_frame_is_told_where_it_is_known():
    origin = {"file": "../b/a.blend", "scene": "Shot 1", "frame": "7"}
    lines = list(report_lines("a.prt", report(5), origin))
    assert lines[1] == "  scene   'Shot 1' of a.blend at frame 7"
    assert list(origin_lines({**origin, "file": ""})) == [
        "  scene   'Shot 1' of a file without a name at frame 7"
    ]
    for silent in (None, {}, {"file": "a.blend", "scene": "Scene"}):
        assert list(report_lines("a.prt", report(5), silent)) == lines[:1] + lines[2:]
