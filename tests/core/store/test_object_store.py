"""Bakes in object stores: the bytes of a folder, whatever is killed, and errors in a line."""

import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from itertools import count

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, bake_steps, load, relight
from prt_core.cli import main
from prt_core.errors import expect_path
from prt_core.light import EnvironmentMap
from prt_core.runtime.address import Address, expect_store_path
from prt_core.store import (
    BakeStore,
    compressed_attributes,
    files_at,
    object_files,
    object_places,
    read_compressed,
    remove_bake,
    remove_compressed,
    write_compressed,
)
from tests.core.store.conftest import LAMPS, SETTINGS, WORLD, Cut, expect_same

obstore = pytest.importorskip("obstore")
_names = count()
_CALLS = "put", "delete", "copy"


@pytest.fixture
def away():
    """An address in a memory of its own."""
    return f"memory://bucket{next(_names)}/shots/a.prt"


def _cut_after(patch, n):
    """Let the n-th change of an object and all later ones fail; returns the number of changes."""
    made = [0]

    def dying(call):
        def called(*arguments, **named):
            if made[0] >= n:
                raise Cut
            made[0] += 1
            return call(*arguments, **named)

        return called

    for name in _CALLS:
        patch.setattr(obstore, name, dying(getattr(obstore, name)))
    return made


def _copied(path, name):
    """Copy a bake to another name beside it."""
    address = expect_store_path("bake", path)
    files, other = files_at(address), files_at(address.with_name(name))
    files.copy_to(other, files.keys())
    return str(other.root)


def _digests(path):
    return BakeStore(path).attributes["arrays"]


@pytest.mark.parametrize("stop", [3, 9])
def test_a_bake_in_an_object_store_goes_on_to_the_bytes_of_a_folder(
    scene, finished, bake_again, away, stop
):
    steps = bake_steps(scene, away, SETTINGS, LAMPS, WORLD)
    for _ in range(stop):
        next(steps)
    steps.close()
    with pytest.raises(PRTError, match="not finished"):
        load(away)
    bake_again(away)
    expect_same(away, finished)
    assert _digests(away) == _digests(finished)
    light = EnvironmentMap(np.random.default_rng(0).random((4, 8, 3)).astype(np.float32))
    for name, colours in relight(away, light).items():
        np.testing.assert_array_equal(colours, relight(finished, light)[name])
    assert {key.rsplit("/")[0] for key in files_at(expect_store_path("", away)).keys()}.issuperset(
        {"zarr.json", "visibility"}
    )
    assert BakeStore(away).nbytes() == pytest.approx(BakeStore(finished).nbytes(), rel=0.01)


def test_whatever_request_is_the_last_one_the_bake_goes_on(scene, finished, bake_again, away):
    for n in (1, 40):
        address = away.replace("a.prt", f"{n}.prt")
        with pytest.MonkeyPatch.context() as patch:
            _cut_after(patch, n)
            with pytest.raises(PRTError):
                bake_again(address)
        bake_again(address)
        assert _digests(address) == _digests(finished)


def test_a_bake_replaces_another_whatever_is_killed(scene, bake_again, away):
    first, then = SETTINGS, BakeSettings(resolution=4, tolerance=0.05, caster="auto", seed=1)
    bake_again(away, first)
    old = _digests(away)
    with pytest.raises(PRTError, match="another seed; choose another output"):
        bake_again(away, then)
    beside = away + ".restart"
    bake_again(beside, then)
    new, address = _digests(beside), expect_store_path("bake", away)
    # Attributes are removed, objects copied, attributes copied, then what was copied is removed.
    count = len(files_at(address).keys())
    seen = set()
    kept = _copied(away, "old"), _copied(beside, "new")
    for n in (0, count // 2, count + 1, 3 * count // 2):
        remove_bake(away)
        _copied(kept[0], "a.prt")
        _copied(kept[1], "a.prt.restart")
        with pytest.MonkeyPatch.context() as patch:
            made = _cut_after(patch, n)
            try:
                bake_again(away, then, restart=True)
            except PRTError:
                assert made[0] == n
        # Whoever opens it finds the old one, or the new one.
        seen.add(_digests(away) == new)
        assert _digests(away) in (old, new) and load(away)
        bake_again(away, then, restart=True)
        assert _digests(away) == new
        assert not files_at(expect_store_path("", beside)).keys()
    assert seen == {False, True}


def test_a_finished_restart_beside_an_unfinished_bake_is_not_thrown_away(bake_again, away):
    then = BakeSettings(resolution=4, tolerance=0.05, caster="auto", seed=1)
    bake_again(away)
    BakeStore(away, "r+").update(complete=False)
    bake_again(away + ".restart", then)
    new = _digests(away + ".restart")
    bake_again(away, then, restart=True)
    assert _digests(away) == new


def test_two_that_finish_a_move_lose_nothing(bake_again, away, monkeypatch):
    bake_again(away + ".restart")
    new, address = _digests(away + ".restart"), expect_store_path("bake", away)
    beside = expect_store_path("bake", away + ".restart")
    # The other looked before this one began, and goes on when it has ended.
    object_places.finish_move(address, beside)
    assert _digests(away) == new
    object_places._take_in(address, beside)
    assert _digests(away) == new and load(away)


def test_only_bakes_are_removed(bake_again, away):
    bake_again(away)
    address = expect_store_path("bake", away)
    files = files_at(address)
    files.write("notes.txt", b"mine")
    with pytest.raises(PRTError, match="holds more than one does"):
        remove_bake(away)
    with pytest.raises(PRTError, match="holds more than one does"):
        bake_again(away, restart=True)
    assert "notes.txt" in files.keys()
    files.remove("notes.txt")
    remove_bake(away)
    assert not files.exists() and not files.keys()
    with pytest.raises(PRTError, match="no such bake"):
        remove_bake(away)


def test_damage_is_found_and_made_again(bake_again, finished, away):
    bake_again(away)
    files = files_at(expect_store_path("bake", away))
    key = next(key for key in files.keys() if key.startswith("visibility/c"))
    for data in (b"", b"x" * 100, b"x" * (1 << 25)):
        files.write(key, data)
        with pytest.raises(PRTError, match="visibility"):
            load(away)
        bake_again(away)
        assert _digests(away) == _digests(finished)
    files.write("zarr.json", b"{}")
    with pytest.raises(PRTError, match="is not a bake"):
        load(away)


def test_compressed_forms_lie_there_too(bake_again, away, capsys):
    bake_again(away)
    for values in (np.arange(5.0), np.arange(7.0)):
        for _ in write_compressed(BakeStore(away, "r+"), {"rank": 3, "basis": values}, {}):
            pass
        state = read_compressed(BakeStore(away), compressed_attributes(BakeStore(away)))
        np.testing.assert_array_equal(state["basis"], values)
    assert remove_compressed(BakeStore(away, "r+"))
    assert not [key for key in BakeStore(away).files.keys() if key.startswith("compressed")]
    assert load(away).path == Address("memory", away.split("/")[2], ("shots", "a.prt"))
    assert main(["info", away]) == 0
    assert away in capsys.readouterr().out


def test_what_is_an_address(tmp_path):
    address = expect_store_path("bake", "s3://bucket/shots/a.b.prt/")
    assert str(address) == "s3://bucket/shots/a.b.prt"
    assert (address.name, address.stem, address.suffix) == ("a.b.prt", "a.b", ".prt")
    assert str(address.with_name("c")) == f"{address.home}/c" == "s3://bucket/shots/c"
    assert expect_store_path("bake", f"file://{tmp_path}/a%20b.prt") == tmp_path / "a b.prt"
    assert expect_store_path("bake", "a.prt").name == "a.prt"
    for bad in ("s3://", "s3://bucket", "s3://b/../a", "s3://b//a", "s3://b/a?x", "s3://u:p@b/a",
                "http://a/b", "file://host/a", "file:///"):  # fmt: skip
        with pytest.raises(PRTError, match="^bake: expected"):
            expect_store_path("bake", bad)
    for name in ("s3://bucket/a.png", "s3:/bucket/a.png"):
        with pytest.raises(PRTError, match="expected a path on this machine"):
            expect_path("picture", name)
    with pytest.raises(TypeError):
        open(address)


def test_without_obstore_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "obstore", None)
    object_files._opened.cache_clear()
    with pytest.raises(PRTError, match=r"need obstore; pip install 'prt-core\[cloud\]'$"):
        load("s3://bucket/a.prt")


@pytest.fixture
def server(monkeypatch):
    """A server that answers all requests with one status and message of S3's."""

    class Handler(BaseHTTPRequestHandler):
        answer = 200, ""

        def _answer(self):
            status, code = self.answer
            body = f"<Error><Code>{code}</Code><Message>No.</Message></Error>".encode()
            self.send_response(status)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = _answer

        def log_message(self, *_):
            pass

    running = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=running.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{running.server_port}"
    for name, value in (("ENDPOINT_URL", url), ("ACCESS_KEY_ID", "a"), ("SECRET_ACCESS_KEY", "b")):
        monkeypatch.setenv(f"AWS_{name}", value)
    monkeypatch.setattr(object_files, "_RETRIES", 0)
    object_files._opened.cache_clear()
    yield Handler
    running.shutdown()
    running.server_close()
    object_files._opened.cache_clear()


@pytest.mark.parametrize(
    "answer, words",
    [
        ((404, "NoSuchBucket"), "there is no bucket 'bucket'; make it first"),
        ((403, "AccessDenied"), "access denied; these credentials are wrong"),
        ((401, "Unauthorized"), "no credentials for s3://; set AWS_ACCESS_KEY_ID"),
        ((500, "InternalError"), "cannot be read .*500"),
    ],
)
def test_what_a_store_refuses_is_said_in_a_line(server, capsys, answer, words):
    server.answer = answer
    with pytest.raises(PRTError, match=words):
        load("s3://bucket/a.prt")
    assert main(["info", "s3://bucket/a.prt"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_no_connection_and_no_credentials(server, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(PRTError, match="no connection to http://127.0.0.1:9; check the network"):
        load("s3://bucket/a.prt")
    with pytest.raises(PRTError, match="no credentials for az://; set AZURE_STORAGE_ACCOUNT_NAME"):
        load("az://container/a.prt")
