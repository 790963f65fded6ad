"""Matrix products of threads of ours use one thread each, and as many as before afterwards."""

import threading

import numpy as np
import pytest

from prt_core.runtime.machine import limit_blas, one_blas_thread
from prt_core.runtime.threads import on_all_cores


def threads():
    from threadpoolctl import threadpool_info

    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.fixture
def three():
    before = max(threads())
    limit_blas(3)
    yield
    limit_blas(before)


def test_pieces_on_all_cores_have_one_each(three):
    assert on_all_cores(lambda _: threads(), range(4)) == [{1}] * 4
    assert threads() == {3}


def test_the_last_that_leaves_gives_back_what_there_was(three):
    entered, leave = threading.Event(), threading.Event()

    def other():
        with one_blas_thread():
            entered.set()
            leave.wait()

    thread = threading.Thread(target=other)
    with one_blas_thread():
        thread.start()
        entered.wait()
    assert threads() == {1}
    leave.set()
    thread.join()
    assert threads() == {3}


def test_an_error_gives_back_too(three):
    def fails(_):
        np.ones(3) @ np.ones(4)

    with pytest.raises(ValueError):
        on_all_cores(fails, range(4))
    assert threads() == {3}
