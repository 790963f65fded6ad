"""The environments that come with Blender (CC0), as lights to certify a bake under."""

from pathlib import Path

import bpy

from prt_core.errors import expect
from prt_core.light import EnvironmentMap
from prt_core.light.images import reads_in_threads
from prt_core.runtime.progress import beside, maybe_beside

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


def studio_light_steps(cube_map, names=NAMES):
    """{name: (n_directions, 3) float32} of environments; a generator of `Progress`."""
    lights = {}
    for name, path in studio_paths(names).items():
        image = yield from maybe_beside(reads_in_threads(path), "scene", EnvironmentMap.read, path)
        lights[name] = yield from beside("scene", image.to_cube_map, cube_map)
    return lights
