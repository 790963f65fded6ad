"""Bakes in S3 and in Google's store over HTTP: cut, gone on with, copied and removed."""

import json

import pytest

from prt_core import bake_steps
from prt_core.runtime.address import expect_store_path
from prt_core.store import BakeStore, files_at, object_files, remove_bake
from tests.core.store.conftest import LAMPS, SETTINGS, WORLD, expect_same
from tests.core.store.object_server import object_server

pytest.importorskip("obstore")


@pytest.fixture(params=["s3", "gs"])
def away(request, monkeypatch, tmp_path):
    """An address of a server, and the server."""
    with object_server() as server:
        key = {"gcs_base_url": server.url, "disable_oauth": True}
        key |= {"client_email": "", "private_key": "", "private_key_id": ""}
        (tmp_path / "key.json").write_text(json.dumps(key))
        for name, value in (
            ("AWS_ENDPOINT_URL", server.url),
            ("AWS_ACCESS_KEY_ID", "a"),
            ("AWS_SECRET_ACCESS_KEY", "b"),
            ("GOOGLE_SERVICE_ACCOUNT", str(tmp_path / "key.json")),
        ):
            monkeypatch.setenv(name, value)
        object_files._opened.cache_clear()
        yield f"{request.param}://bucket/shots/a.prt", server
        object_files._opened.cache_clear()


def test_a_bake_over_http_is_that_of_a_folder(scene, finished, bake_again, away):
    address, server = away
    steps = bake_steps(scene, address, SETTINGS, LAMPS, WORLD)
    for _ in range(9):
        next(steps)
    steps.close()
    bake_again(address)
    expect_same(address, finished)
    assert BakeStore(address).attributes["arrays"] == BakeStore(finished).attributes["arrays"]
    # What replaces a bake is copied by the store.
    files, other = (files_at(expect_store_path("bake", a)) for a in (address, f"{address}2"))
    files.copy_to(other, files.keys())
    expect_same(f"{address}2", finished)
    remove_bake(f"{address}2")
    copied = {"s3": "x-amz-copy-source", "gs": "x-goog-copy-source"}[address[:2]]
    assert {copied, "DELETE"} <= server.requests
    remove_bake(address)
    assert not server.objects
