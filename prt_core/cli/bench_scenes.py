"""Scenes and lights that the kinds of `prt bench` are given by name."""

from pathlib import Path

from prt_core.bake.measure import standing_lights
from prt_core.blender_access import import_bpy, open_blend, studio_lights
from prt_core.errors import PRTError, expect, expect_number, expect_seed
from prt_core.evaluate.report import expect_plots
from prt_core.light.environment import named_images
from prt_core.runtime.files import expect_output


def open_scene(path):
    """The `Scene` of a .blend file, or of what is open in Blender where there is none."""
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
    import_bpy()
    from prt_core.blender.measuring import MODELS, measuring_scene

    expect(path in MODELS, f"{path}: expected a .blend file or one of {', '.join(MODELS)}")
    return path, measuring_scene(path)


def images_named(paths, every=False):
    """{name: EnvironmentMap}, read before the work.

    Where no `paths` are given those of Blender that bakes are certified under, or `every` one.
    """
    if paths is not None:
        return named_images(paths)
    try:
        return studio_lights(every)
    except PRTError as error:
        raise PRTError(f"light: give images with --light ({error})") from error


def images_or_skies(paths):
    """`images_named`; plain skies where no `paths` are given and Blender's module is not there."""
    if paths is not None:
        return named_images(paths)
    try:
        return studio_lights(False)
    except PRTError:
        return standing_lights()


def turned(images, rotations, cube_map):
    """{name: radiance} of each environment at each rotation."""
    return {
        f"{name} at {angle:g}°": image.to_cube_map(cube_map, angle)
        for name, image in images.items()
        for angle in rotations
    }


def expect_bench(options):
    """Refuse what cannot be measured or written, before any work."""
    expect_output("--output", options.output, None, folder=True)
    expect_plots()
    expect_seed(options.seed)
    for angle in options.rotate:
        expect_number("--rotate", angle)
