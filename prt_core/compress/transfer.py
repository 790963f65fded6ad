"""Transfer matrices by clusters: what arrives at points, from a few matrices a cluster.

Matrices of near points are alike: as vectors of order^4 numbers they lie near an affine space of
few dimensions, one in each cluster (Sloan et al. 2003). A light is multiplied with the clusters'
matrices, and what arrives at a point is a mixture of these products. Frames of near points are not
alike, though, where the surface is curved: matrices are compressed as they are in the world, where
they depend on the visibility alone, and what arrives is turned into the frame of each point.
"""

import numpy as np

from prt_core.basis import rotations_of_harmonics
from prt_core.compress.base import Compressor
from prt_core.compress.rows import ArrayRows
from prt_core.errors import expect, expect_array, expect_kind
from prt_core.sphere import tangent_frames
from prt_core.transport.transfer import TransferMatrices, reflected_harmonics


class CompressedTransfer:
    """`TransferMatrices` through a compressor.

    Parameters
    ----------
    transfer : TransferMatrices
    compressor : Compressor
        Such as `ClusteredPCA(n_components=16)`; it is fitted to the matrices.
    """

    def __init__(self, transfer, compressor):
        expect_kind("transfer", transfer, TransferMatrices)
        self.compressor = expect_kind("compressor", compressor, Compressor)
        self._project, self.normals = transfer.project, transfer.normals
        self.reflectance = transfer.reflectance
        matrices = transfer.matrices
        n_points, self._n_channels, n_local, n_light = matrices.shape
        order = self.reflectance.order
        blocks = rotations_of_harmonics(tangent_frames(self.normals), order)
        self._turns = [block.astype(np.float32) for block in blocks]
        matrices = np.stack(
            [_turned(matrices[:, c], self._turns, True) for c in range(self._n_channels)], axis=1
        )
        # Directions are the light's harmonics; outputs the local ones, of one channel each.
        rows = matrices.reshape(n_points, -1, n_light).swapaxes(1, 2)
        reads = np.repeat(np.arange(self._n_channels), n_local)
        self.compressor.fit(ArrayRows(np.ascontiguousarray(rows), reads=reads))
        self._arrived = None

    def set_light(self, light):
        """Take a light, (n_directions, n_channels): what arrives at each point. Returns self."""
        coefficients = self._project(light)
        n_channels = coefficients.shape[1]
        expect(
            self._n_channels in (1, n_channels),
            f"light: expected {self._n_channels} channels, as the matrices have, got {n_channels}",
        )
        if self._n_channels == 1:
            arrived = [self.compressor.product(column) for column in coefficients.T]
        else:
            arrived = self.compressor.product(coefficients)
            arrived = arrived.reshape(len(arrived), n_channels, -1).swapaxes(0, 1)
        self._arrived = _turned(np.stack(list(arrived), axis=2), self._turns)
        return self

    def toward(self, outgoing):
        """Radiance toward a view: (n_points, n_channels) float32 (see `TransferMatrices`).

        Parameters
        ----------
        outgoing : (n_points, 3) float
        """
        expect(self._arrived is not None, "light: none is set; call set_light first")
        outgoing = expect_array("outgoing", outgoing, self.normals.shape)
        return reflected_harmonics(self._arrived, self.normals, outgoing, self.reflectance)

    @property
    def nbytes(self):
        """Of the compressed matrices, turns, normals and the reflectance."""
        turns = sum(block.nbytes for block in self._turns)
        return self.compressor.nbytes + turns + self.normals.nbytes + self.reflectance.nbytes


def _turned(coefficients, blocks, back=False):
    """Harmonics (n, order^2, k) turned by a block of each degree; `back` undoes it."""
    result = np.empty_like(coefficients)
    for degree, block in enumerate(blocks):
        part = slice(degree**2, (degree + 1) ** 2)
        turn = block.swapaxes(1, 2) if back else block
        result[:, part] = np.matmul(turn, coefficients[:, part])
    return result
