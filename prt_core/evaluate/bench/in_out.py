"""In-out terms, exact and compressed, against the dense sum."""

import time

from prt_core.compress import ClusteredPCA
from prt_core.compress.terms import fit_terms_steps
from prt_core.evaluate.bench.gloss_task import measured_steps
from prt_core.reflectance import in_out_factors
from prt_core.transport.bright_texels import BrightApart, BrightTexels
from prt_core.transport.terms import InOutTransport

# Points a cluster has on average.
_CLUSTER = 130


def in_out_steps(task, n_terms=(4, 20, 48), n_clustered=(4,), n_bright=(16,), components=16):
    """Measure in-out terms for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
    n_terms : sequence of int
    n_clustered : sequence of int
        Those of them that are measured with each term in clustered principal components as well.
    n_bright : sequence of int
        Numbers of brightest texels that are taken out of the light: rows of each.
    components : int
        Of each cluster.

    Returns
    -------
    list of dict
        See `measured_steps`; `warning` says where lobes are too narrow for terms.
    """
    rows, transport = [], task.transport
    parts = transport.bits, task.normals, transport.cube_map
    for name, reflectance in task.reflectances.items():
        begun = time.process_time()
        factors = in_out_factors(reflectance, max(n_terms))
        made = time.process_time() - begun
        for count in n_terms:
            exact = InOutTransport(*parts, factors.first(count))
            forms = [(f"in-out terms, {count}", exact, made)]
            if count in n_clustered:
                begun = time.process_time()
                clusters = max(1, transport.n_points // _CLUSTER)
                form = yield from fit_terms_steps(
                    exact, lambda clusters=clusters: ClusteredPCA(clusters, components)
                )
                spent = made + time.process_time() - begun
                forms.append((f"in-out terms, {count}, clustered", form, spent))
            for label, form, spent in forms:
                for bright in n_bright:
                    this = form
                    if bright:
                        apart = BrightTexels(*parts, reflectance.eval, bright)
                        this = BrightApart(form, apart)
                    text = f"{label}, {bright} texels apart"
                    row = yield from measured_steps(task, name, text, this, spent)
                    rows.append({**row, "warning": factors.warning})
    return rows
