"""The add-on inside a story: the zip is installed, its modules and what it says are asked for."""

import sys

import addon_utils
import bpy
from hand import FOLDER

NAME = "bl_ext.user_default.prt_relight"


def install(report):
    bpy.ops.extensions.package_install_files(
        filepath=str(FOLDER / "extension.zip"), repo="user_default", enable_on_install=True
    )
    yield 0.5
    import prt_core

    report["enabled"] = NAME in bpy.context.preferences.addons
    report["warnings"] = repr(addon_utils._extensions_warnings_get())
    report["core"] = prt_core.__file__


def part(name):
    return sys.modules[f"{NAME}.{name}"]


def status():
    return bpy.context.window_manager.prt


def settled():
    return not status().running and part("live").idle()
