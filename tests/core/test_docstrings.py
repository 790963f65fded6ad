"""Public docstrings say what the code takes and gives: see `tests/docstrings.py` for the rules.

All that a package exports, and `prt_core.api`, is documented whole, parameter by parameter. Other
public names of modules have a docstring, and what it lists is what the signature says.
"""

import inspect

import prt_core
import prt_core.api
from tests.docstrings import exported, faults, modules, public


def test_what_is_exported_is_documented_whole():
    things = {**exported(prt_core), **public(prt_core.api)}
    assert len(things) > 150
    result = [fault for name, thing in things.items() for fault in faults(name, thing)]
    assert not result, "\n".join(result)


def test_all_public_names_have_docstrings_that_fit():
    things = {}
    for module in modules(prt_core):
        things.update(public(module))
    assert len(things) > 400
    result = [fault for name, thing in things.items() for fault in faults(name, thing, False)]
    assert not result, "\n".join(result)


def good(points, count=3):
    """Something of points.

    Parameters
    ----------
    points : (n, 3) float32
    count : int

    Returns
    -------
    (n,) float32
    """
    return points[:count]


def short(points, count=3):
    """(n, 3) float32 of the first `count` of points."""
    return points[:count]


def refers(points, count=3):
    """`good` as a generator of `Progress`.

    Parameters
    ----------
    count : int
    """
    yield points
    return count


class Thing:
    """What is made of points.

    Parameters
    ----------
    points : (n, 3) float32

    Attributes
    ----------
    size : int
    """

    def __init__(self, points):
        self.size = len(points)

    def many(self, times):
        """(n,) float32 so many `times`."""
        return times * self.size


def changed(function, old, new):
    """A function whose docstring has something else in it."""
    text = inspect.cleandoc(function.__doc__)
    assert old in text
    copy = type(function)(
        function.__code__, function.__globals__, function.__name__, function.__defaults__
    )
    copy.__doc__ = text.replace(old, new)
    return copy


def test_the_check_passes_what_is_right():
    for thing in (good, short, refers, Thing):
        assert not list(faults("x", thing)), thing


def test_the_check_finds_each_kind_of_fault():
    for function, old, new, fault in (
        (good, "count : int\n", "counts : int\n", "documents (points, counts), takes (points, c"),
        (good, "count : int\n", "", "documents (points), takes (points, count)"),
        (good, "points : (n, 3) float32", "points : float32", "points is an array without a shape"),
        (good, "(n,) float32", "float32", "float32 is an array without a shape"),
        (good, "Returns", "Gives", "there is no section Gives"),
        (good, "Parameters\n----------", "Raises\n------\nx\n\nParameters\n---",
         "sections are in the order Raises, Parameters, Returns"),
        (good, "Returns\n-------\n(n,) float32", "", None),
        (short, "`count`", "some", "says nothing of count"),
        (short, "(n, 3) float32 of the first", "Take the first", "does not say what it returns"),
        (refers, "`good` as a generator of `Progress`", "Something",
         "documents (count), takes (points, count)"),
    ):  # fmt: skip
        result = list(faults("x", changed(function, old, new)))
        assert (fault is None and not result) or any(fault in text for text in result), (
            old,
            result,
        )

    def silent(points):
        return points

    assert list(faults("x", silent)) == ["x: has no docstring"]


def test_the_check_finds_faults_of_classes(monkeypatch):
    monkeypatch.setattr(Thing, "__doc__", Thing.__doc__.replace("points : (n", "places : (n"))
    monkeypatch.setattr(Thing.many, "__doc__", None)
    assert list(faults("x", Thing)) == [
        "x: documents (places), takes (points)",
        "x.many: has no docstring",
    ]
