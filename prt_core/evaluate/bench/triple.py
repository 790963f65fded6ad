"""Triple products of wavelets against the dense sum."""

import time

from prt_core.evaluate.bench.gloss_task import measured_steps
from prt_core.reflectance.lobe_table import LobeTable, kept_wavelets
from prt_core.transport.triple import TripleProducts


def triple_steps(task, kept=0.01, n_bright=(32,), **table):
    """Measure triple products for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
    kept : float
        Share of the wavelets of light and lobes.
    n_bright : sequence of int
        Numbers of brightest texels that are taken out of the light: a row each.
    **table
        Settings of `LobeTable`.

    Returns
    -------
    list of dict
        See `measured_steps`.
    """
    rows, transport = [], task.transport
    count = kept_wavelets(kept, transport.n_directions)
    for name, reflectance in task.reflectances.items():
        begun = time.process_time()
        lobes = LobeTable(reflectance.eval, count, **table)
        made = time.process_time() - begun
        for bright in n_bright:
            begun = time.process_time()
            form = TripleProducts(
                transport.bits, task.normals, transport.cube_map, lobes, reflectance.eval,
                kept, bright,
            )  # fmt: skip
            seconds = made + time.process_time() - begun
            label = f"triple product, {100 * kept:g} %, {bright} texels apart"
            rows.append((yield from measured_steps(task, name, label, form, seconds)))
    return rows
