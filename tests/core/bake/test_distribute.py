"""Blocks by the workers of a Dask cluster: the bytes of one process, and what is lost in a line."""

import sys

import pytest

from prt_core import BakeSettings, PRTError, bake_steps, run
from prt_core.bake import distribute
from prt_core.bake.blocks import stages
from prt_core.bake.distribute import cluster_client, distribute_steps, expect_cluster
from prt_core.bake.plan import plan_steps
from prt_core.runtime.cores import n_cores
from prt_core.store import BakeStore
from tests.meshes import ball_on_paint

distributed = pytest.importorskip("distributed")
SETTINGS = BakeSettings(resolution=4, tolerance=0.05)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    for name in ("visibility", "gather_blocks"):
        module = __import__(f"prt_core.bake.{name}", fromlist=[""])
        if hasattr(module, "BLOCK"):
            monkeypatch.setattr(module, "BLOCK", 256)


@pytest.fixture(scope="module")
def client():
    """Two workers in this process, so that nothing has to start."""
    with (
        distributed.LocalCluster(
            2, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def scene():
    return ball_on_paint()


@pytest.fixture
def planned(scene, tmp_path):
    path = tmp_path / "a.prt"
    run(plan_steps(scene, path, SETTINGS))
    return path


def test_workers_make_the_bytes_of_one_process(scene, planned, client, tmp_path):
    assert stages(planned)[0].blocks > 4
    seen = []
    report = run(distribute_steps(planned, client), seen.append)
    run(bake_steps(scene, tmp_path / "one.prt", SETTINGS))
    alone, together = BakeStore(tmp_path / "one.prt"), BakeStore(planned)
    assert together.attributes["arrays"] == alone.attributes["arrays"]
    assert report["error"] == alone.attributes["report"]["error"]
    assert {step.stage for step in seen} >= {"visibility", "gather2"}
    assert max(step.done for step in seen if step.stage == "visibility") > 4


def test_what_was_stopped_goes_on(planned, client):
    steps = distribute_steps(planned, client)
    for step in steps:
        if step.stage == "visibility" and step.done:
            break
    steps.close()
    assert not BakeStore(planned).is_complete
    assert run(distribute_steps(planned, client))["tolerance_met"]
    assert BakeStore(planned).is_complete


class _Lost:
    """A client whose workers die: they take blocks, and some of these never end."""

    def __init__(self, client, most=2, error=None):
        self._client, self._most, self._error = client, most, error
        self.submitted = 0

    def submit(self, function, *given, **named):
        self.submitted += 1
        if self.submitted <= self._most:
            return self._client.submit(_raise, self._error, pure=False)
        return self._client.submit(function, *given, **named)

    def nthreads(self):
        return self._client.nthreads()

    def __getattr__(self, name):
        return getattr(self._client, name)


def _raise(error):
    raise error


def _killed():
    return distributed.KilledWorker("block", type("Worker", (), {"address": "tcp://x"})(), 3)


def test_blocks_of_dead_workers_are_done_again(planned, client):
    lost = _Lost(client, 3, _killed())
    run(distribute_steps(planned, lost))
    assert BakeStore(planned).is_complete


def test_a_block_that_ends_all_workers_is_said(planned, client, monkeypatch):
    monkeypatch.setattr(distribute, "_LIVES", 2)
    with pytest.raises(PRTError, match="block [0-9]+ of stage 'visibility' has ended every worker"):
        run(distribute_steps(planned, _Lost(client, 1000, _killed())))
    run(distribute_steps(planned, client))


def test_all_workers_lost_is_a_line_and_the_store_resumes(planned, client, monkeypatch):
    class Gone(_Lost):
        def submit(self, *given, **named):
            self.gone = True
            return self._client.submit(lambda: __import__("time").sleep(0.5), pure=False)

        def nthreads(self):
            return {} if getattr(self, "gone", False) else self._client.nthreads()

    with pytest.raises(PRTError, match="all workers are lost; what is done is kept, run the same"):
        run(distribute_steps(planned, Gone(client), patience=0))
    assert run(distribute_steps(planned, client))


def test_no_worker_comes(planned, client):
    class Empty(_Lost):
        def nthreads(self):
            return {}

    with pytest.raises(PRTError, match="no worker has come; start some with 'dask worker'"):
        run(distribute_steps(planned, Empty(client), patience=0))


def test_workers_must_see_the_same_store_and_version(planned, client, monkeypatch):
    class Elsewhere(_Lost):
        def run(self, function, path, *given):
            return self._client.run(function, path + "x", *given)

    with pytest.raises(PRTError, match="there is no such bake; give a store that is the same"):
        run(distribute_steps(planned, Elsewhere(client)))

    class Older(_Lost):
        def run(self, function, path, seal, version):
            return self._client.run(function, path, seal, "0.0")

    with pytest.raises(PRTError, match="has prt-core .*, expected 0.0; install that there"):
        run(distribute_steps(planned, Older(client)))

    class Nothing(_Lost):
        def submit(self, *given, **named):
            return self._client.submit(lambda: None, pure=False)

    with pytest.raises(PRTError, match="have computed blocks that are not there"):
        run(distribute_steps(planned, Nothing(client)))


@pytest.mark.parametrize("bad", ["local:0", "local:x", "local", "here", "", "local:99999"])
def test_what_names_a_cluster(bad):
    with pytest.raises(PRTError, match="^dask: expected local:N, an address"):
        expect_cluster(bad)


def test_no_scheduler_there(monkeypatch):
    monkeypatch.setattr(distribute, "_CONNECT", 0.5)
    with pytest.raises(PRTError, match="^tcp://127.0.0.1:9: no scheduler of Dask answers there"):
        with cluster_client("tcp://127.0.0.1:9"):
            pass


def test_without_dask_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(PRTError, match=r"is not installed; pip install 'prt-core\[cluster\]'$"):
        expect_cluster("local:2")


def test_a_share_of_the_cores(monkeypatch):
    monkeypatch.setenv("PRT_THREADS", "3")
    assert n_cores() == 3
    for bad in ("0", "-1", "x", "1.5"):
        monkeypatch.setenv("PRT_THREADS", bad)
        with pytest.raises(PRTError, match="PRT_THREADS: expected a whole number from 1"):
            n_cores()
