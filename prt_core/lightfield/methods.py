"""The compressors of light fields by name."""

import inspect

from prt_core.errors import expect_one_of
from prt_core.lightfield.ceob import CEOB
from prt_core.lightfield.rivals.cosines import Cosines2D
from prt_core.lightfield.rivals.cpca import CPCA
from prt_core.lightfield.rivals.haar import Haar2D
from prt_core.lightfield.rivals.hrdf_harmonics import HRDFHarmonics
from prt_core.lightfield.rivals.ksvd import KSVD
from prt_core.runtime.named_settings import expect_settings, named_settings, read_setting

METHODS = {
    "ceob": CEOB,
    "cpca": CPCA,
    "ksvd": KSVD,
    "harmonics": HRDFHarmonics,
    "haar": Haar2D,
    "dct": Cosines2D,
}
# What a field decides, not its compressors.
_GOALS = ("n_coefficients", "threshold", "seed")


def compressor_from_text(text, **goals):
    """An `HRDFCompressor` that is not fitted.

    Parameters
    ----------
    text : str
        `NAME` or `NAME:key=value,key=value`, such as `ceob:n_pairs=8`.
    **goals : object
        Parameters that the text does not give; those that the method has not are left out.

    Returns
    -------
    HRDFCompressor

    Raises
    ------
    PRTError
        No such method, or it has no such setting, or not with such a value.
    """
    name, settings = named_settings(text)
    expect_one_of("method", name, tuple(METHODS))
    kind = METHODS[name]
    defaults = {key: p.default for key, p in inspect.signature(kind).parameters.items()}
    known = [key for key in defaults if key not in _GOALS]
    expect_settings(name, settings, known)
    settings = {key: read_setting(value, defaults[key]) for key, value in settings.items()}
    goals = {key: value for key, value in goals.items() if key in defaults}
    return kind(**settings, **goals)
