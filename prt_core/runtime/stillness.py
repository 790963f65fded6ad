"""Threads of ours that keep still while Blender works without Python's lock.

Blender's operators let go of the lock. In a context of their own (`temp_override`) they then look
into Python's dictionary of that context, and until Python 3.12 take a lock that any other thread
holds for their own: Blender crashes when that thread lets go in between.
"""

import sys
import threading
import time
from contextlib import contextmanager
from functools import partial

_here = threading.local()
_changed = threading.Condition()
_at_work, _asked = 0, 0
# Since 3.12 every thread knows itself whether it holds the lock.
_NEEDED = sys.version_info < (3, 12)
# A thread that has ended its work, or handed over what it read, may still be on its way out.
_TAIL = 0.002


def as_work(function):
    """What a thread of ours calls for a function: begins when it need not keep still.

    Nobody waits for itself: what the thread that others keep still for gives out begins at once.
    """
    return partial(_work, function, keeps_others_still())


def _work(function, keeps, *arguments):
    if works():
        return function(*arguments)
    _here.keeps = keeps
    _begin()
    _here.works = True
    try:
        return function(*arguments)
    finally:
        _here.works, _here.keeps = False, 0
        _end()


def works():
    """Whether the calling thread is one of ours at work."""
    return getattr(_here, "works", False)


@contextmanager
def waiting():
    """What a thread waits for here runs no Python of its own; it wakes when others may work."""
    if not works():
        yield
        return
    _end()
    try:
        yield
    finally:
        _begin()


def rest():
    """Where a thread at work can stop: does so for as long as others have to keep still."""
    if _asked and not keeps_others_still():
        with waiting():
            pass


@contextmanager
def others_still():
    """While it lasts, no thread of ours runs Python; waits until they have come to rest.

    For the main thread.
    """
    if not _NEEDED:
        yield
        return
    global _asked
    with _changed:
        _asked += 1
        _changed.wait_for(lambda: not _at_work)
    try:
        time.sleep(_TAIL)
        _here.keeps = keeps_others_still() + 1
        try:
            yield
        finally:
            _here.keeps -= 1
    finally:
        with _changed:
            _asked -= 1
            _changed.notify_all()


def keeps_others_still():
    """In how many `others_still` the calling thread is, or works for one that is."""
    return getattr(_here, "keeps", 0)


def _begin():
    global _at_work
    with _changed:
        _changed.wait_for(lambda: keeps_others_still() or not _asked)
        _at_work += 1


def _end():
    global _at_work
    with _changed:
        _at_work -= 1
        _changed.notify_all()
