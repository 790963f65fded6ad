"""Transfer matrices in harmonics, whole and by clusters, against the dense sum."""

import time

from prt_core.compress import ClusteredPCA
from prt_core.compress.transfer import CompressedTransfer
from prt_core.evaluate.bench.gloss_task import measured_steps
from prt_core.reflectance.harmonic import HarmonicReflectance
from prt_core.transport.bright_texels import BrightApart, BrightTexels
from prt_core.transport.transfer import TransferMatrices, shadowed_transfer

# Points a cluster has on average.
_CLUSTER = 130


def transfer_steps(task, order=5, n_components=(16,), n_bright=(0, 16)):
    """Measure transfer matrices for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
    order : int
        Of light and of what arrives: order^4 numbers a point.
    n_components : sequence of int
        Of clustered principal components: rows beside those of the whole matrices.
    n_bright : sequence of int
        Numbers of brightest texels that are taken out of the light: rows of each.

    Returns
    -------
    list of dict
        See `measured_steps`.
    """
    rows, transport = [], task.transport
    parts = transport.bits, task.normals, transport.cube_map
    begun = time.process_time()
    matrices = shadowed_transfer(*parts, order)
    made = time.process_time() - begun
    clustered = {}
    for name, reflectance in task.reflectances.items():
        begun = time.process_time()
        harmonic = HarmonicReflectance(reflectance.eval, order)
        whole = TransferMatrices(matrices, task.normals, transport.cube_map, harmonic)
        seconds = made + time.process_time() - begun
        forms = [(f"{order**2} x {order**2} matrices", whole, seconds)]
        for rank in n_components:
            if rank not in clustered:
                begun = time.process_time()
                model = ClusteredPCA(max(1, transport.n_points // _CLUSTER), rank)
                clustered[rank] = CompressedTransfer(whole, model), time.process_time() - begun
            form, spent = clustered[rank]
            form.reflectance = harmonic
            forms.append((f"{rank} components a cluster", form, seconds + spent))
        for label, form, spent in forms:
            for count in n_bright:
                this = form
                if count:
                    this = BrightApart(form, BrightTexels(*parts, reflectance.eval, count))
                text = f"harmonics, {label}, {count} texels apart"
                rows.append((yield from measured_steps(task, name, text, this, spent)))
    return rows
