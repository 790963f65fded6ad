"""The first look at a scene that is known before its bake reads it anew."""

from prt_core.bake.lights import Beside
from prt_core.bake.memory import Memory
from prt_core.bake.pictures import Pictures
from prt_core.bake.settings import BakeSettings
from prt_core.bake.visibility_stage import comes_in_blocks
from prt_core.errors import expect_kind, expect_number
from prt_core.rays import RelayCaster
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import Progress
from prt_core.scene import Scene
from prt_core.sphere import CubeMap


def first_look_steps(scene, settings, pictures, pace, source=None):
    """Look at a scene for the first time; a generator of `Progress`.

    The bake that is given the same `pictures` looks again where its scene is another.

    Parameters
    ----------
    scene : Scene
    settings : BakeSettings
    pictures : Pictures
    pace : float
        Seconds a step may take (see `bake_steps`).
    source : dict of str -> str, optional
        The digest of each mesh it was made from.
    """
    expect_kind("scene", scene, Scene)
    expect_kind("settings", settings, BakeSettings)
    expect_kind("pictures", pictures, Pictures)
    expect_number("pace", pace, above=0)
    calls = MainThreadCalls()
    yield from steps_in_thread(
        _look(scene, settings, pictures, pace, source, calls), calls, "first look"
    )


def _look(scene, settings, pictures, pace, source, calls):
    yield Progress("first look", 0, 0)
    caster = calls.call(scene.make_caster, settings.caster, "diffuse", settings.resolution)
    try:
        rays = caster if caster.threads > 1 else RelayCaster(caster, calls, pace)
        cube_map = CubeMap(settings.resolution)
        joined = comes_in_blocks(settings, len(scene.points), cube_map, Memory.of())
        pictures.begin(scene, cube_map, settings, rays, Beside(source=source), joined)
    finally:
        calls.call(caster.close)
