"""Arrays of states are checked as they are read."""

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.compress.state import array_of


@pytest.mark.parametrize(
    "kind, wrong", [("float16", np.inf), ("float16", np.nan), ("float32", -1e20), ("float64", 1e20)]
)
def test_numbers_that_no_product_can_take_are_refused(kind, wrong):
    values = np.array([1.5, 2.5], kind)
    np.testing.assert_array_equal(array_of({"a": values}, "a", (2,), kind), values)
    values[1] = wrong
    with pytest.raises(PRTError, match="'a' holds what it cannot"):
        array_of({"a": values}, "a", (2,), kind)


def test_arrays_of_other_shapes_and_types_and_indices_are_refused():
    state = {"a": np.arange(3)}
    assert len(array_of(state, "a", (None,), "int64", below=3)) == 3
    for name, shape, kind, below in (
        ("b", (3,), "int64", None), ("a", (2,), "int64", None),
        ("a", (3,), "int32", None), ("a", (3,), "int64", 2),
    ):  # fmt: skip
        with pytest.raises(PRTError, match="compress again"):
            array_of(state, name, shape, kind, below)
