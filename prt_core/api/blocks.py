"""The end of a bake whose blocks of work were computed apart."""

from prt_core.bake.distribute import distribute_steps
from prt_core.bake.plan import finish_steps
from prt_core.errors import expect
from prt_core.runtime.progress import run


def finish(store, *, memory=None, compute=False, dask=None, report=None):
    """Close a bake that was planned (see `bake`), as far as its blocks allow.

    Parameters
    ----------
    store : str or Path
        `NAME.prt`.
    memory : float, optional
        Gigabytes that may be taken, beside the scene; default: half of what there is.
    compute : bool
        Whether blocks that are missing are computed here.
    dask : str or distributed.Client, optional
        Those are computed by the workers of a Dask cluster instead (see `bake`).
    report : callable(Progress), optional

    Returns
    -------
    dict
        The report (see `bake_steps`).

    Raises
    ------
    BlocksMissing
        A `PRTError` that names the stage and the blocks that are to be computed next (see
        `prt_core.bake.blocks.compute`).
    PRTError
        There is no such bake, it was not planned, or it is damaged.
    """
    if dask is None:
        return run(finish_steps(store, memory, compute), report)
    expect(not compute, "compute: blocks are computed by the workers; leave it out with dask")
    return run(distribute_steps(store, dask, memory), report)
