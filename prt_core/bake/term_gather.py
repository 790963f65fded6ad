"""What in-out terms receive of other surfaces, from the rays that a bake has cast."""

import numpy as np

from prt_core.bake.gather import gather_terms
from prt_core.errors import expect_kind
from prt_core.reflectance import InOutFactors
from prt_core.sphere import tangent_frames


def in_out_gather(bake, factors, frames=None):
    """K of each in-out term: what it receives of the radiance that points send out.

    With `sent` (n_points, 3) that is `K[k] @ sent`, which is added to what `InOutTransport`
    receives of the sky: `form.receive(form.received + np.stack([k @ sent for k in K], axis=1))`.

    Parameters
    ----------
    bake : Bake
        As `load` gives it, with bounces.
    factors : InOutFactors
    frames : (n_points, 3, 3) float, optional
        See `TermView`.

    Returns
    -------
    list of (n_points, n_points) CSR float32

    Raises
    ------
    PRTError
        The bake has no rays, or was changed meanwhile.
    """
    expect_kind("factors", factors, InOutFactors)
    frames = tangent_frames(bake.scene.points.normals) if frames is None else frames
    frames = np.asarray(frames, np.float32)

    def weigh(block, directions):
        local = np.matmul(directions, frames[block].swapaxes(1, 2))
        weights = np.pi * np.moveaxis(factors.incoming_between(slice(None), local), -1, 0)
        # Terms have both signs, operators one: those of either half.
        return np.concatenate([np.maximum(weights, 0), np.maximum(-weights, 0)])

    halves = gather_terms(bake, weigh)
    n = factors.n_terms
    return [(above - below).tocsr() for above, below in zip(halves[:n], halves[n:], strict=True)]
