"""What bare_blenders.py runs inside each Blender, with nothing but Blender and the zips.

The zips are named after `--`; writes report.json into the current folder.
"""

import json
import os
import socket
import sys
import time

import bpy

NAME = "bl_ext.user_default.prt_relight"


def install(name):
    """Install and enable a zip as a person does; whether it is enabled, and what was said."""
    said = []
    try:
        bpy.ops.extensions.package_install_files(
            filepath=os.path.abspath(name), repo="user_default", enable_on_install=True
        )
    except RuntimeError as error:
        said = [line for line in str(error).splitlines() if line]
    return {"zip": name, "enabled": NAME in bpy.context.preferences.addons.keys(), "said": said}


def main(names):
    python = "{}.{}".format(*sys.version_info)
    names = sorted(names, key=lambda name: f"-python-{python}" in name)
    report = {"version": bpy.app.version_string, "python": python, "zips": []}
    for name in names:
        start = time.perf_counter()
        report["zips"].append(install(name))
        report["installed"] = time.perf_counter() - start
    # In a namespace of its own there is nothing but the loop, which is down.
    report["network"] = [name for _, name in socket.if_nameindex() if name != "lo"]
    scene = bpy.context.scene
    for call in ("bake", "relight"):
        start = time.perf_counter()
        done = getattr(bpy.ops.prt, call)()
        spent = time.perf_counter() - start
        report[{"bake": "baked", "relight": "relit"}[call]] = spent if done == {"FINISHED"} else 0
    colours = bpy.data.objects["Cube"].data.color_attributes["PRT"].data
    values = [colour for each in colours for colour in each.color[:3]]
    report |= {"bake": scene.prt.loaded, "brightness": sum(values) / len(values)}
    with open("report.json", "w") as file:
        json.dump(report, file)


main(sys.argv[sys.argv.index("--") + 1 :])
