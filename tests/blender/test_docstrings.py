"""What `tests/core/test_docstrings.py` asks of the core, of Blender's side."""

import importlib
import pkgutil

import prt_core.blender
from tests.docstrings import faults, public


def test_blenders_side_is_documented():
    blender, things = prt_core.blender, {}
    for info in pkgutil.iter_modules(blender.__path__, "prt_core.blender."):
        things.update(public(importlib.import_module(info.name)))
    exported = {getattr(blender, name) for name in blender.__all__}
    assert len(things) > 50 and exported <= set(things.values())
    result = [fault for name, t in things.items() for fault in faults(name, t, t in exported)]
    assert not result, "\n".join(result)
