"""The environments that come with Blender (CC0), as lights to certify a bake under."""

from pathlib import Path

import bpy

from prt_core.errors import expect
from prt_core.light import EnvironmentMap
from prt_core.light.images import reads_in_threads

# A hard sun over a street, an even sky between walls, and the small windows of a room.
NAMES = ("city", "courtyard", "interior")
ALL = ("city", "courtyard", "forest", "interior", "night", "studio", "sunrise", "sunset")


def studio_paths(names=NAMES):
    """Paths of Blender's own environments by name; main thread only."""
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    paths = {name: folder / f"{name}.exr" for name in names}
    for name, path in paths.items():
        expect(path.is_file(), f"studio light '{name}': {path} is not there")
    return paths


def studio_images():
    """Environments by name, for `studio_lights`; main thread only.

    Their paths, or the images themselves where only Blender can read them.
    """
    return {
        name: path if reads_in_threads(path) else EnvironmentMap.read(path)
        for name, path in studio_paths().items()
    }


def studio_lights(images, cube_map):
    """{name: (n_directions, 3) float32} of `studio_images`; in any thread."""
    lights = {}
    for name, image in images.items():
        read = image if isinstance(image, EnvironmentMap) else EnvironmentMap.read(image)
        lights[name] = read.to_cube_map(cube_map)
    return lights
