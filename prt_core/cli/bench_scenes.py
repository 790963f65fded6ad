"""Scenes and lights that the kinds of `prt bench` are given by name."""

import importlib
from pathlib import Path

from prt_core.errors import PRTError, expect
from prt_core.light import EnvironmentMap


def open_scene(path):
    from prt_core.api import import_bpy, open_blend

    if path:
        open_blend(path)
    else:
        import_bpy()
    from prt_core.blender.depsgraph import read_scene

    return read_scene()


def scene_named(path):
    """(name, Scene): of a .blend, of the scene that is open, or a measuring scene by its name."""
    if path is None or path.endswith(".blend"):
        return Path(path).stem if path else "open scene", open_scene(path)
    try:
        scenes = importlib.import_module("tests.benchmarks.sampling_scenes")
    except ImportError as error:
        raise PRTError(
            f"{path}: expected a .blend file; measuring scenes by name need the source tree"
        ) from error
    known = ", ".join(scenes.MODELS)
    expect(path in scenes.MODELS, f"{path}: expected a .blend file or one of {known}")
    return path, scenes.measuring_scene(path)


def lights_named(paths, rotations, cube_map, every=False):
    """{name: radiance} of each environment at each rotation.

    Where no `paths` are given those of Blender that bakes are certified under, or `every` one.
    """
    if paths is None:
        try:
            from prt_core.api import import_bpy

            import_bpy()
        except PRTError as error:
            raise PRTError(f"light: give images with --light ({error})") from error
        from prt_core.blender.studio import ALL, NAMES, studio_paths

        named = studio_paths(ALL if every else NAMES)
    else:
        named = {Path(path).stem: path for path in paths}
    images = {name: EnvironmentMap.read(path) for name, path in named.items()}
    return {
        f"{name} at {angle:g}°": image.to_cube_map(cube_map, angle)
        for name, image in images.items()
        for angle in rotations
    }
