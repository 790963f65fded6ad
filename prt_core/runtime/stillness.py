"""Threads of ours that keep still while Blender works without Python's lock.

Blender's operators let go of the lock. In a context of their own (`temp_override`) they then look
into Python's dictionary of that context, and until Python 3.12 take a lock that any other thread
holds for their own: Blender crashes when that thread lets go in between.
"""

import sys
import threading
import time
from contextlib import contextmanager

_here = threading.local()
_changed = threading.Condition()
_at_work, _asked = 0, 0
# Since 3.12 every thread knows itself whether it holds the lock.
_NEEDED = sys.version_info < (3, 12)
# A thread that has ended its work, or handed over what it read, may still be on its way out.
_TAIL = 0.002


def working(function, *arguments):
    """The result of a function that a thread of ours is busy with until it returns."""
    if works():
        return function(*arguments)
    _count(1)
    _here.works = True
    try:
        return function(*arguments)
    finally:
        _here.works = False
        _count(-1)


def works():
    """Whether the calling thread is one of ours at work."""
    return getattr(_here, "works", False)


@contextmanager
def waiting():
    """What a thread waits for here runs no Python of its own; it wakes when others may work."""
    if not works():
        yield
        return
    _count(-1)
    try:
        yield
    finally:
        global _at_work
        with _changed:
            _changed.wait_for(lambda: not _asked)
            _at_work += 1


def rest():
    """Where a thread at work can stop: does so for as long as others have to keep still."""
    if _asked:
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
        yield
    finally:
        with _changed:
            _asked -= 1
            _changed.notify_all()


def _count(more):
    global _at_work
    with _changed:
        _at_work += more
        _changed.notify_all()
