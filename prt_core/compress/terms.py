"""In-out terms whose transport is compressed, each by itself, as that of diffuse surfaces is."""

import numpy as np

from prt_core.compress.base import Compressor
from prt_core.compress.rows.term_rows import TermRows
from prt_core.errors import expect, expect_all, expect_kind
from prt_core.transport.terms import InOutTransport, TermFactor, TermView


def fit_terms_steps(transport, make_model):
    """Compress each term; a generator of `Progress`.

    Parameters
    ----------
    transport : InOutTransport
    make_model : callable() -> Compressor

    Returns
    -------
    CompressedTerms
    """
    expect_kind("transport", transport, InOutTransport)
    expect(callable(make_model), "make_model: expected a function that makes a compressor")
    parts = transport.normals, transport.cube_map, transport.frames
    models = []
    for k in range(transport.factors.n_terms):
        factor = TermFactor(transport.factors, k, *parts)
        model = make_model()
        yield from model.fit_steps(TermRows(transport.bits, transport.cube_map, factor))
        models.append(model)
    return CompressedTerms(transport, models)


class CompressedTerms(TermView):
    """Received terms from compressed rows.

    Parameters
    ----------
    transport : InOutTransport
    models : sequence of Compressor
        One for each of its terms, fitted (see `fit_terms_steps`).

    Raises
    ------
    PRTError
        There are more or fewer models than terms.
    """

    def __init__(self, transport, models):
        expect_kind("transport", transport, InOutTransport)
        models = expect_all("models", models, Compressor, "compressors")
        factors = transport.factors
        expect(
            len(models) == factors.n_terms,
            f"models: expected one for each of {factors.n_terms} terms, got {len(models)}",
        )
        super().__init__(factors, transport.normals, transport.frames)
        self.models = models

    def set_light(self, light):
        """Take a light, (n_directions, 3): what each term receives. Returns self."""
        return self.receive(np.stack([model.product(light) for model in self.models], axis=1))

    @property
    def nbytes(self):
        """Of the models, and of what views read."""
        models = sum(model.nbytes for model in self.models)
        return models + self.frames.nbytes + self.normals.nbytes + self.factors.outgoing.nbytes
