"""What test_extension.py runs with nothing but Blender's module, numpy and the extension.

python -S extension_checks.py ZIP BLEND FOLDER: installs the zip, writes FOLDER/report.json.
"""

import json
import sys
from pathlib import Path

import bpy  # isort: split

import addon_utils

NAME = "bl_ext.user_default.prt_relight"


def main(zip_path, blend, folder):
    report = {"python_before": sorted(sys.modules)}
    bpy.ops.extensions.package_install_files(
        filepath=zip_path, repo="user_default", enable_on_install=True
    )
    report["enabled"] = NAME in bpy.context.preferences.addons.keys()
    report["warnings"] = repr(addon_utils._extensions_warnings_get())
    report["turns"] = [turn() for _ in range(3)]
    report["warnings_after"] = repr(addon_utils._extensions_warnings_get())
    bpy.ops.wm.open_mainfile(filepath=blend)
    scene = bpy.context.scene
    scene.prt.resolution, scene.prt.tolerance = "8", 0.05
    report["bake"] = list(bpy.ops.prt.bake())
    bake = bpy.path.abspath(scene.prt.loaded)
    report["path"] = bake
    command = sys.modules[NAME]._command
    lights = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    picture, colours = str(folder / "view.png"), str(folder / "colours.npz")
    report["commands"] = {
        "relight": command(
            ["relight", bake, "--light", str(lights / "city.exr"), "--rotate", "30",
             "--png", picture, "--size", "64x36", "--output", colours]
        ),
        "compress": command(["compress", bake, "--tolerance", "0.05"]),
        "wavelets": command(["compress", bake, "--method", "wavelet4d", "--tolerance", "0.1"]),
        "quick": command(
            ["relight", bake, "--light", str(lights / "city.exr"), "--output",
             str(folder / "quick.npz"), "--form", "compressed"]
        ),
        "info": command(["info", bake]),
        "missing": command(["info", str(folder / "nothing.prt")]),
        "usage": command(["relight"]),
    }  # fmt: skip
    report["files"] = {
        name: module.__file__
        for name, module in list(sys.modules.items())
        if "." not in name and getattr(module, "__file__", None)
    }
    report["before"] = report.pop("python_before")
    (folder / "report.json").write_text(json.dumps(report))


def turn():
    """Off and on again: whether the properties went and came."""
    addon_utils.disable(NAME)
    off = not hasattr(bpy.types.Scene, "prt")
    addon_utils.enable(NAME)
    return off and hasattr(bpy.types.Scene, "prt") and hasattr(bpy.ops.prt, "bake")


main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
