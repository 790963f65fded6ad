"""What is known of a visibility before it is sampled: all that a change cannot have touched.

While the rest is asked it counts as if it had been traced: no ray is cast for it, and neighbours
are believed by it. What counts as traced in the end are rays alone, those of then and of now; so
the certificate draws from all that was taken over as well.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect
from prt_core.sampling.sampled import Sampled
from prt_core.transport.visibility import expect_bits


@dataclass(frozen=True)
class Known:
    """What is known of the visibility of a scene before it is sampled.

    Attributes
    ----------
    bits : (n_points, n_bytes) uint8
        Visibility, right where it is known.
    known : (n_points, n_bytes) uint8
        Entries that are as they were; of new points none.
    traced : (n_points, n_bytes) uint8
        Those of them that rays have told.
    above : (n_points, n_bytes) uint8
        Entries above the horizon (see `horizon_bits`).
    """

    bits: np.ndarray
    known: np.ndarray
    traced: np.ndarray
    above: np.ndarray

    def begun(self, scene, cube_map):
        """The `Sampled` that sampling begins with: what is known counts as traced.

        Parameters
        ----------
        scene : Scene
        cube_map : CubeMap

        Raises
        ------
        PRTError
            It is of another scene, or of other directions.
        """
        for name in ("bits", "known", "traced", "above"):
            bits = expect_bits(f"known: {name}", getattr(self, name), cube_map.n_directions)
            expect(len(bits) == len(scene.points), f"known: {name} are of another scene")
        return Sampled(self.bits & self.known, self.known, 0)

    def ended(self, sampled):
        """What sampling made of it, in which rays alone count as traced.

        Parameters
        ----------
        sampled : Sampled
            Changed in place, and returned.
        """
        sampled.traced &= self.traced | ~self.known
        return sampled
