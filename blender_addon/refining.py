"""How far a scene's panel lets meshes be refined."""

from prt_core.sampling import RefineSettings


def refine_settings(scene):
    """`RefineSettings` of a scene's panel; None where meshes are baked as they are."""
    chosen = scene.prt
    if not chosen.refine:
        return None
    times = f"{round(chosen.refine_vertices, 4):g}x"
    return RefineSettings(round(chosen.refine_tolerance, 6), times)
