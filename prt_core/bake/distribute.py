"""Blocks of a planned bake by the workers of a Dask cluster, one machine or a thousand.

The client plans and finishes the bake, and is the only one who writes what is said of it. Workers
are sent a store, a stage and a number, and no data: what they compute they put into the store,
which all must see under the same name (a disk of the network, an object store). A block that is
lost with its worker is done by another; what is done is done, whoever is lost.
"""

import importlib
import logging
import os
import queue
import time
import uuid
from collections import Counter
from contextlib import contextmanager, suppress

from prt_core.bake.blocks import compute
from prt_core.bake.plan import finish_steps
from prt_core.bake.stages import BlocksMissing
from prt_core.errors import PRTError, expect, expect_number, expect_offers, shown
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.cores import THREADS, keep_to_share, n_cores
from prt_core.runtime.progress import Progress
from prt_core.store import BakeStore
from prt_core.version import __version__

# This process among those of all machines, whose numbers are not their own.
_PROCESS = uuid.uuid4().hex
_INSTALL = "pip install 'prt-core[cluster]'"
_AGAIN = "what is done is kept, run the same command again and it goes on"
# Seconds between two looks, and to connect to a scheduler.
_POLL, _CONNECT = 0.2, 10
# Seconds that a cluster may be without a worker: those of a queue come and go.
PATIENCE = 60.0
# How often a block whose workers die is given to others. Each time several have died already.
_LIVES = 4
# Workers of this machine at most.
_MOST_LOCAL = 1024


def distribute_steps(path, cluster, memory=None, patience=PATIENCE):
    """Compute the blocks of a planned bake on a Dask cluster, and finish it; yields `Progress`.

    Parameters
    ----------
    path : str, Path or Address
        `NAME.prt`, planned (see `plan_steps`), where all workers see it.
    cluster : str or distributed.Client
        See `cluster_client`.
    memory : float, optional
        Gigabytes that finishing may take (see `finish_steps`).
    patience : float
        Seconds that are waited for a worker where there is none.

    Returns
    -------
    dict
        The report (see `bake_steps`).

    Raises
    ------
    PRTError
        Dask is not installed, there is no such scheduler, no worker came or all are lost, one does
        not see the store or has another version; or what a block raised. What is done stays.
    """
    path = expect_store_path("bake", path).absolute()
    patience = expect_number("patience", patience, least=0)
    with cluster_client(cluster) as client:
        yield from _wait_steps(client, patience)
        _expect_same(client, path)
        missing = None
        while True:
            try:
                return (yield from finish_steps(path, memory))
            except BlocksMissing as error:
                before = missing and (missing.stage, missing.blocks)
                expect(
                    before != (error.stage, error.blocks),
                    f"{path}: workers have computed blocks that are not there; give a store that "
                    "is the same for all machines",
                )
                missing = error
            yield from _compute_steps(client, path, missing.stage, missing.blocks, patience)


@contextmanager
def cluster_client(cluster):
    """A client of a cluster; both are closed afterwards where they were made here.

    Parameters
    ----------
    cluster : str or distributed.Client
        "local:N": N workers on this machine, which share its cores; the address of a scheduler, as
        tcp://HOST:8786; the scheduler's file, NAME.json; or a client.

    Yields
    ------
    distributed.Client
    """
    expect_cluster(cluster)
    if not isinstance(cluster, str | os.PathLike):
        yield cluster
        return
    import dask
    from distributed import Client, LocalCluster

    text = os.fspath(cluster)
    kind, _, rest = text.partition(":")
    if kind != "local":
        where = {"scheduler_file": text} if _is_file(text) else {"address": text}
        try:
            client = Client(**where, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise PRTError(
                f"{text}: no scheduler of Dask answers there ({_line(error)}); start one with "
                "'dask scheduler'"
            ) from error
        with _quiet(), client:
            yield client
        return
    # Dask's own count of deaths would give a block up that had bad luck only.
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 10}),
        _quiet(),
        LocalCluster(
            n_workers=int(rest),
            threads_per_worker=1,
            memory_limit=None,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
            env={THREADS: str(max(1, n_cores() // int(rest)))},
        ) as made,
        Client(made, set_as_default=False) as client,
    ):
        yield client


@contextmanager
def _quiet():
    """Nothing of what Dask logs of lost connections: it is said in a line, here."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    loggers = [logging.getLogger(name) for name in (*names, "tornado.application", "asyncio")]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def expect_cluster(cluster):
    """Raise `PRTError` unless something names a cluster, or is a client, and Dask is installed.

    Parameters
    ----------
    cluster : str or distributed.Client
        See `cluster_client`.
    """
    if not isinstance(cluster, str | os.PathLike):
        offered = "submit", "nthreads", "run", "cancel"
        expect_offers("dask", cluster, offered, "text or a distributed.Client")
        return
    text = os.fspath(cluster)
    kind, _, rest = text.partition(":")
    if kind == "local":
        good = rest.isdecimal() and 0 < int(rest) <= _MOST_LOCAL
    else:
        good = rest or _is_file(text)
    expect(
        good,
        "dask: expected local:N, an address as tcp://HOST:8786, or a scheduler's file NAME.json, "
        f"got {shown(text)}",
    )
    try:
        importlib.import_module("distributed")
    except ImportError as error:
        raise PRTError(f"dask: Dask is not installed; {_INSTALL}") from error


def _is_file(text):
    return text.endswith(".json")


def _compute_steps(client, path, stage, blocks, patience):
    """Have blocks of a stage computed, each once or more; yields `Progress`."""
    finished, running, deaths = queue.SimpleQueue(), {}, Counter()
    from distributed import CancelledError, KilledWorker

    def submit(index):
        given = str(path), stage, index, _PROCESS
        future = client.submit(_compute, *given, pure=False)
        running[future] = index
        future.add_done_callback(finished.put)

    n_done, seen = 0, time.monotonic()
    try:
        for index in blocks:
            submit(index)
        while running:
            yield Progress(stage, n_done, len(blocks))
            try:
                future = finished.get(timeout=_POLL)
            except queue.Empty:
                seen = time.monotonic() if _n_workers(client) else seen
                expect(
                    time.monotonic() - seen <= patience,
                    f"{path}: all workers are lost; {_AGAIN}",
                )
                continue
            seen = time.monotonic()
            index = running.pop(future)
            if future.status in ("finished", "pending"):
                # Pending again: what it returned is lost with its worker, but not what it computed.
                n_done += 1
                continue
            try:
                raise future.exception(timeout=_CONNECT)
            except KilledWorker as error:
                deaths[index] += 1
                if deaths[index] == _LIVES:
                    raise PRTError(
                        f"{path}: block {index} of stage '{stage}' has ended every worker that it "
                        f"was given to, for want of memory perhaps; {_AGAIN}"
                    ) from error
                submit(index)
            except (CancelledError, TimeoutError) as error:
                raise PRTError(f"{path}: the scheduler is lost; {_AGAIN}") from error
    finally:
        with suppress(Exception):
            client.cancel(list(running))


def _wait_steps(client, patience):
    """Wait for the first worker."""
    begun = time.monotonic()
    while not _n_workers(client):
        expect(
            time.monotonic() - begun <= patience,
            "dask: no worker has come; start some with 'dask worker' and run the same command "
            "again",
        )
        yield Progress("workers", 0, 0)
        time.sleep(_POLL)


def _n_workers(client):
    try:
        return len(client.nthreads())
    except Exception as error:
        raise PRTError(f"dask: the scheduler is lost ({_line(error)}); {_AGAIN}") from error


def _expect_same(client, path):
    """Raise `PRTError` unless the workers have this version and see this store."""
    seal = BakeStore(path).attributes.get("seal")
    try:
        answers = client.run(_difference, str(path), seal, __version__)
    except Exception as error:
        raise PRTError(
            f"dask: its workers cannot run prt-core ({_line(error)}); install prt-core "
            f"{__version__} there"
        ) from error
    for worker, difference in answers.items():
        expect(not difference, f"{worker}: {difference}")


def _difference(path, seal, version):
    """What keeps a worker from computing blocks of a store; runs there."""
    if version != __version__:
        return f"has prt-core {__version__}, expected {version}; install that there"
    try:
        seen = BakeStore(path).attributes.get("seal") == seal
    except PRTError as error:
        return f"{error}; give a store that is the same for all machines"
    return "" if seen else f"sees another bake at {path}; give a store that is the same for all"


def _compute(path, stage, index, client):
    """Compute a block; runs at a worker, whose threads are its share of the machine's cores."""
    if client != _PROCESS:
        os.environ.setdefault(THREADS, "1")
        keep_to_share()
    return compute(path, stage, index)


def _line(error):
    return " ".join(str(error).split())[:120] or type(error).__name__
