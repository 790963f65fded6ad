"""Attributes: what JSON may say, and that a seal notices every change of it."""

import json
import re

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.store.attributes import parse, read_attributes, write_attributes
from prt_core.store.files import Files

FACTS = {"format": "prt bake", "version": 3, "complete": False, "numbers": [1, 2.5, None, "x"]}


@pytest.fixture
def files(tmp_path):
    built = Files(tmp_path / "a.prt")
    built.make()
    return built


def test_facts_are_read_as_they_were_written(files):
    assert read_attributes(files) is None
    written = write_attributes(files, {**FACTS, "array": np.arange(3), "one": np.float32(0.1)})
    assert read_attributes(files) == written
    assert written["array"] == [0, 1, 2] and written["numbers"] == FACTS["numbers"]
    before = (files.root / "zarr.json").stat().st_mtime_ns
    assert write_attributes(files, FACTS | {"seal": "any"}, written) != written
    now = read_attributes(files)
    assert write_attributes(files, now, now) == now
    assert (files.root / "zarr.json").stat().st_mtime_ns >= before


@pytest.mark.parametrize(
    "attributes",
    [{"a": float("nan")}, {"a": float("inf")}, {"a": 1 << 70}, {"a": {1: 2, "1": 3}},
     {"a": object()}, {"a": "\ud800"}],
)  # fmt: skip
def test_what_could_not_be_read_is_not_written(files, attributes):
    write_attributes(files, FACTS)
    with pytest.raises(PRTError, match="cannot keep what is said of the bake") as caught:
        write_attributes(files, {**FACTS, **attributes})
    assert "\n" not in str(caught.value)
    assert read_attributes(files)["numbers"] == FACTS["numbers"]


@pytest.mark.parametrize(
    "text, reason",
    [
        (b"", "Expecting value"),
        (b"[1]", "is no object"),
        (b"\xff\xfe{}", "decode"),
        (b'{"a": 1, "a": 2}', "a name comes twice"),
        (b'{"a": NaN}', "NaN is no number"),
        (b'{"a": -Infinity}', "-Infinity is no number"),
        (b'{"a": 1e999}', "a number is too large"),
        (b'{"a": 99999999999999999999}', "a number is too large"),
        (b'{"a": ' + b"9" * 10000 + b"}", "a number is too large"),
        (b'{"a": ' + b"[" * 40 + b"]" * 40 + b"}", "nested too deeply"),
        (b'{"a": ' + b"[" * 10**6, "recursion"),
        (b'{"a": "\\ud800"}', "surrogates"),
        (b'{"\\udfff": 1}', "surrogates"),
        (b'{"a": 1}\n}', "Extra data"),
    ],
)
def test_malformed_json_is_one_line(text, reason):
    with pytest.raises(PRTError, match=f"^file cannot be read: .*{re.escape(reason)}") as caught:
        parse(text, "file")
    assert "\n" not in str(caught.value)


def _edited(change):
    def edit(meta):
        change(meta)
        return json.dumps(meta)

    return edit


@pytest.mark.parametrize(
    "edit",
    [
        _edited(lambda m: m["attributes"].update(complete=True)),
        _edited(lambda m: m["attributes"].update(complete=0)),
        _edited(lambda m: m["attributes"].pop("numbers")),
        _edited(lambda m: m["attributes"].pop("seal")),
        _edited(lambda m: m["attributes"].update(more=1)),
        _edited(lambda m: m["attributes"]["numbers"].reverse()),
        _edited(lambda m: m.update(consolidated_metadata=None)),
        _edited(lambda m: m.update(consolidated_metadata={"metadata": {}})),
        _edited(lambda m: m.pop("zarr_format")),
    ],
)
def test_every_edit_is_noticed(files, edit):
    write_attributes(files, FACTS)
    file = files.root / "zarr.json"
    file.write_text(edit(json.loads(file.read_text())))
    with pytest.raises(PRTError, match="was damaged or edited; bake again with --restart"):
        read_attributes(files)


def test_facts_that_were_only_laid_out_anew_are_the_same(files):
    write_attributes(files, FACTS)
    file = files.root / "zarr.json"
    file.write_text(json.dumps(json.loads(file.read_text()), indent=3, sort_keys=True))
    assert read_attributes(files)["numbers"] == FACTS["numbers"]


def test_more_facts_than_are_ever_read_are_not_written(files, monkeypatch):
    monkeypatch.setattr("prt_core.store.attributes._MOST_BYTES", 300)
    with pytest.raises(PRTError, match="300 at most are kept"):
        write_attributes(files, {**FACTS, "names": ["object"] * 100})
    assert read_attributes(files) is None
