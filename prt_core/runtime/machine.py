"""What the machine tells about itself and this process."""

import os
import sys
import threading
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from threadpoolctl import ThreadpoolController

from prt_core.errors import expect

_changing = threading.Lock()
_inside, _before = 0, []

# Where Linux says how much a container may take.
_CONTAINER = Path("/sys/fs/cgroup/memory.max")


def memory_bytes():
    """Memory that this process may take at all, in bytes: the machine's, or its container's."""
    if sys.platform == "win32":
        return _windows_memory()
    most = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        return min(most, int(_CONTAINER.read_text()))
    except (OSError, ValueError):
        # No container, or one without a bound.
        return most


def expect_memory(what, n_bytes, advice):
    """Raise `PRTError` where something needs more memory than there is.

    Parameters
    ----------
    what : str
    n_bytes : float
        An estimate of what it needs.
    advice : str
        What to do about it.
    """
    most = memory_bytes()
    expect(
        n_bytes < most,
        f"{what}: needs about {n_bytes / 1e9:,.1f} GB of memory, there are {most / 1e9:,.1f}; "
        f"{advice}",
    )


def peak_bytes():
    """Most memory this process has held so far (resident set), in bytes."""
    if sys.platform == "win32":
        return _windows_peak()
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts in KiB, macOS in bytes.
    return peak if sys.platform == "darwin" else peak * 1024


def reset_peak():
    """Let `peak_bytes` count from now on. False where the system cannot: only Linux does."""
    try:
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")
    except OSError:
        return False
    return True


def return_memory():
    """Give memory that was freed back to the system, where the C library keeps it (glibc does).

    After large arrays came and went it keeps about as much as the largest of them took together.
    """
    if sys.platform.startswith("linux"):
        import ctypes

        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)


def _windows_peak():
    import ctypes
    from ctypes import wintypes

    class Counters(ctypes.Structure):
        _fields_ = [("cb", wintypes.DWORD), ("PageFaultCount", wintypes.DWORD)] + [
            (name, ctypes.c_size_t)
            for name in (
                "PeakWorkingSetSize",
                "WorkingSetSize",
                "QuotaPeakPagedPoolUsage",
                "QuotaPagedPoolUsage",
                "QuotaPeakNonPagedPoolUsage",
                "QuotaNonPagedPoolUsage",
                "PagefileUsage",
                "PeakPagefileUsage",
            )
        ]

    counters = Counters(cb=ctypes.sizeof(Counters))
    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    query = kernel.K32GetProcessMemoryInfo
    query.argtypes = [wintypes.HANDLE, ctypes.POINTER(Counters), wintypes.DWORD]
    kernel.GetCurrentProcess.restype = wintypes.HANDLE
    if not query(kernel.GetCurrentProcess(), ctypes.byref(counters), counters.cb):
        raise ctypes.WinError(ctypes.get_last_error())
    return int(counters.PeakWorkingSetSize)


def _windows_memory():
    import ctypes
    from ctypes import wintypes

    class Status(ctypes.Structure):
        _fields_ = [("length", wintypes.DWORD), ("load", wintypes.DWORD)] + [
            (name, ctypes.c_ulonglong)
            for name in (
                "TotalPhys",
                "AvailPhys",
                "TotalPageFile",
                "AvailPageFile",
                "TotalVirtual",
                "AvailVirtual",
                "AvailExtendedVirtual",
            )
        ]

    status = Status(length=ctypes.sizeof(Status))
    if not ctypes.WinDLL("kernel32", use_last_error=True).GlobalMemoryStatusEx(
        ctypes.byref(status)
    ):
        raise ctypes.WinError(ctypes.get_last_error())
    return int(status.TotalPhys)


def limit_blas(threads):
    """Let matrix products use so many threads from now on."""
    with _changing:
        _set_threads([threads] * len(_libraries()))


@contextmanager
def one_blas_thread():
    """A context in which matrix products use one thread: for callers that make threads themselves.

    Threads that each ask a threaded BLAS wait for one another: six times slower with some. Several
    threads may be in it; the last that leaves gives back what there was.
    """
    global _inside, _before
    with _changing:
        if not _inside:
            _before = [library.num_threads for library in _libraries()]
            _set_threads([1] * len(_before))
        _inside += 1
    try:
        yield
    finally:
        with _changing:
            _inside -= 1
            if not _inside:
                _set_threads(_before)


@cache
def _libraries():
    found = ThreadpoolController().lib_controllers
    return [library for library in found if library.user_api == "blas"]


def _set_threads(numbers):
    for library, number in zip(_libraries(), numbers, strict=True):
        # The plain way does nothing for any but the first thread of Python that asked.
        getattr(library, "_real_set_num_threads", library.set_num_threads)(number)
