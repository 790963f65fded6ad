"""The refinement of meshes before they are baked, beside the caller where that is wanted."""

from prt_core.errors import expect, expect_flag
from prt_core.rays import RelayCaster
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.sampling import RefineSettings, refine_steps


def refine_settings(refine, tolerance=None, vertices=None):
    """`RefineSettings` of what is asked for; None where nothing is to be refined.

    Parameters
    ----------
    refine : bool
    tolerance, vertices : optional
        See `RefineSettings`; None: their defaults.

    Raises
    ------
    PRTError
        They are given, and nothing is to be refined; or one of them is wrong.
    """
    given = {"tolerance": tolerance, "vertices": vertices}
    given = {name: value for name, value in given.items() if value is not None}
    if not expect_flag("refine", refine):
        expect(not given, f"refine {', '.join(given)}: changes nothing without refine=True")
        return None
    return RefineSettings(**given)


def refine_meshes_steps(meshes, lamps, world, settings, caster="auto", pace=None):
    """`refine_steps`, in a thread where steps are to be short; a generator of `Progress`.

    It is not stored: it takes seconds, and what goes on with a bake makes the same meshes again.

    Parameters
    ----------
    meshes, lamps, world, settings, caster
        See `refine_steps`.
    pace : float, optional
        Seconds a step may take, for a user interface (see `bake_steps`).

    Returns
    -------
    meshes : list of Mesh
    refinement : Refinement
    """
    given = meshes, lamps, world, settings, caster
    if pace is None:
        return (yield from refine_steps(*given))
    calls, casters = MainThreadCalls(), []

    def made(function, *arguments):
        casters.append(function(*arguments))
        return casters[-1]

    def relayed(function, *arguments):
        plain = calls.call(made, function, *arguments)
        if plain is None or plain.threads > 1:
            return plain
        return RelayCaster(plain, calls, pace)

    try:
        return (yield from steps_in_thread(refine_steps(*given, relayed), calls, "refine"))
    finally:
        for caster in casters:
            if caster is not None:
                caster.close()
