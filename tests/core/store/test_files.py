"""The files of a folder: whole or not there, and nothing but plain files."""

import errno
import os
import re
import socket

import pytest

from prt_core import PRTError
from prt_core.store import files as module
from prt_core.store.files import Files, is_part


@pytest.fixture
def files(tmp_path):
    built = Files(tmp_path / "a.prt")
    built.make()
    return built


def test_what_is_written_is_read(files):
    files.write("point/c/0", b"seven", lasting=True)
    files.write("point/c/0", b"eleven")
    assert files.read("point/c/0", 6) == b"eleven"
    assert files.read("point/c/1", 6) is files.read("none/c/1", 6) is None
    assert files.read("point/c/0/1", 6) is None
    assert (files.names("point"), files.names("none"), files.nbytes()) == (["c"], [], 6)
    files.sync()
    files.remove("point")
    files.remove("point")
    assert files.names() == []


def test_a_larger_file_than_expected_is_not_read(files):
    files.write("a", bytes(8))
    with pytest.raises(PRTError, match="has 8 bytes, expected 7 at most"):
        files.read("a", 7)


@pytest.mark.parametrize("key", ["../a", "a/../../b", "/etc/passwd", "", "a//b", "a/", ".a", "a\n"])
def test_no_name_leads_outside(files, key):
    for call in (
        lambda: files.read(key, 1),
        lambda: files.write(key, b""),
        lambda: files.remove(key),
    ):
        with pytest.raises(PRTError, match="none of a bake's") as caught:
            call()
        assert "\n" not in str(caught.value)


def plant(kind, path, outside):
    if kind == "symbolic link":
        path.symlink_to(outside)
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        here = os.getcwd()
        os.chdir(path.parent)
        try:
            socket.socket(socket.AF_UNIX).bind(path.name)
        finally:
            os.chdir(here)


@pytest.mark.parametrize("kind", ["symbolic link", "pipe", "folder", "socket"])
def test_what_is_no_plain_file_is_refused_and_does_not_block(files, tmp_path, kind):
    outside = tmp_path / "outside"
    outside.write_bytes(b"mine")
    plant(kind, files.root / "a", outside)
    with pytest.raises(PRTError, match=f"is a {kind}, which no bake holds there"):
        files.read("a", 100)
    if kind != "folder":
        with pytest.raises(PRTError, match=f"is a {kind}"):
            files.check()
        # A write takes its place and goes into nothing that was planted.
        files.write("a", b"ours")
        assert files.read("a", 4) == b"ours"
    assert outside.read_bytes() == b"mine"


def test_a_link_that_takes_the_place_of_a_file_meanwhile_is_not_followed(
    files, tmp_path, monkeypatch
):
    outside = tmp_path / "outside"
    outside.write_bytes(b"mine")
    files.write("a", b"ours")
    look = os.lstat

    def swapping(path):
        result = look(path)
        os.unlink(path)
        os.symlink(outside, path)
        return result

    monkeypatch.setattr(os, "lstat", swapping)
    with pytest.raises(PRTError, match="cannot be read"):
        files.read("a", 100)


def test_a_file_that_was_linked_from_outside_is_replaced_and_not_written_into(files, tmp_path):
    outside = tmp_path / "outside"
    outside.write_bytes(b"mine")
    os.link(outside, files.root / "a")
    files.write("a", b"ours")
    assert (outside.read_bytes(), files.read("a", 4)) == (b"mine", b"ours")


def test_an_unfinished_file_is_made_by_us_or_not_at_all(files, tmp_path, monkeypatch):
    """Even where somebody knows its name beforehand."""
    outside = tmp_path / "outside"
    outside.write_bytes(b"mine")
    monkeypatch.setattr(module.secrets, "token_hex", lambda n: "7" * 2 * n)
    for planted in (os.link, os.symlink):
        part = files.root / f"a.{'7' * 16}.part"
        planted(outside, part)
        with pytest.raises(PRTError, match="cannot be written \\(File exists\\)"):
            files.write("a", b"ours")
        assert outside.read_bytes() == b"mine"
        part.unlink()


@pytest.mark.parametrize("call", ["write", "replace", "fsync"])
def test_a_full_disk_is_one_line_and_leaves_the_old_file(files, monkeypatch, call):
    files.write("a", b"old")

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    if call == "write":
        monkeypatch.setattr(os, "fdopen", full)
    else:
        monkeypatch.setattr(os, call, full)
    with pytest.raises(PRTError, match="No space left on device; what is done is kept"):
        files.write("a", b"new", lasting=True)
    monkeypatch.undo()
    assert files.read("a", 3) == b"old"
    assert [p.name for p in files.root.iterdir()] == ["a"]


def test_unfinished_files_are_removed_and_never_read(files):
    left = ["a.0123456789abcdef.part", f"zarr.{'0a' * 16}.partial", "zarr.json.part"]
    for name in left:
        assert is_part(name)
        (files.root / name).write_bytes(b"half")
    (files.root / "b").mkdir()
    os.mkfifo(files.root / "b" / left[0])
    assert files.names() == ["b"] and files.names("b") == []
    files.sweep()
    assert not any(p.name in left for p in files.root.rglob("*"))


@pytest.mark.parametrize("name", ["a.part", "zarr.json", "0", "notes.txt", "a.0123.part"])
def test_other_files_are_not_taken_for_unfinished_ones(name):
    assert not is_part(name)


def test_a_folder_that_was_removed_does_not_come_back(files):
    files.write("a/c/0", b"x")
    files.remove("a")
    files.root.rmdir()
    for key in ("a/c/0", "b"):
        with pytest.raises(PRTError, match="was removed while it was in use"):
            files.write(key, b"y")
    assert not files.root.exists()


def test_something_else_in_the_place_of_the_folder_is_said(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "link").symlink_to(tmp_path)
    for name, message in (("file", "is a file, expected"), ("link", "is a symbolic link")):
        with pytest.raises(PRTError, match=message):
            Files(tmp_path / name).exists()
    assert not Files(tmp_path / "none").exists()
    with pytest.raises(PRTError, match="cannot be made \\(Not a directory\\)"):
        Files(tmp_path / "file" / "a.prt").make()
    long = tmp_path / ("a" * 300)
    with pytest.raises(PRTError, match=re.escape("(File name too long)")):
        Files(long).exists()
