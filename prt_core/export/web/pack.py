"""Arrays as a page reads them: deflated, and as text, for a page from disk may load scripts only.

What is packed is prepared so that it deflates well: differences along the first axis, and the
bytes of numbers in planes, the lowest first.
"""

import base64
import json
import zlib

import numpy as np

# The best that deflate does; a page is written once and loaded often.
_LEVEL = 9
_KINDS = {"|u1": "u1", "|i1": "i1", "<u2": "u2", "<u4": "u4", "<f4": "f4"}


class Pack:
    """Arrays by name, with what a page is told beside them.

    Parameters
    ----------
    facts : dict
        Of values that JSON knows.

    Attributes
    ----------
    facts : dict
        To which more may be added.
    sizes : dict of str -> int
        Bytes of each array as it is packed.
    """

    def __init__(self, facts):
        self.facts, self._arrays, self.sizes = facts, {}, {}

    def add(self, name, array, differences=False):
        """Pack an array.

        Parameters
        ----------
        name : str
        array : (n, ...) uint8, int8, uint16, uint32 or float32
        differences : bool
            Along the first axis; of numbers without sign, which wrap round.
        """
        array = np.ascontiguousarray(array)
        kind = _KINDS[array.dtype.newbyteorder("<").str]
        shape = array.shape
        if differences:
            array = np.diff(array, axis=0, prepend=np.zeros_like(array[:1]))
        data = np.ascontiguousarray(array).view(np.uint8)
        if array.itemsize > 1:
            data = np.ascontiguousarray(data.reshape(-1, array.itemsize).T)
        packed = zlib.compress(data.tobytes(), _LEVEL)
        self.sizes[name] = len(packed)
        self._arrays[name] = {
            "kind": kind,
            "shape": list(shape),
            "differences": differences,
            "data": base64.b64encode(packed).decode("ascii"),
        }

    def script(self, name="PRT_DATA"):
        """str: a script that hands everything to the page, safe inside of HTML as well.

        Parameters
        ----------
        name : str
            What the page finds it by.
        """
        text = json.dumps({**self.facts, "arrays": self._arrays}, separators=(",", ":"))
        return f"window.{name}={text.replace('<', chr(92) + 'u003c')};\n"


def shared_exponent(colours):
    """Colours in 32 bits: nine for each channel, five for their exponent (RGB9_E5).

    Parameters
    ----------
    colours : (n, 3) float
        Not negative.

    Returns
    -------
    (n,) uint32
    float
        What the colours were multiplied with, so that the largest lies well inside the range.
    """
    colours = np.asarray(colours, np.float64)
    most = float(colours.max(initial=0))
    factor = 2.0 ** (14 - np.ceil(np.log2(most))) if most > 0 else 1.0
    scaled = colours * factor
    largest = np.maximum(scaled.max(axis=1), 2.0**-24)
    exponent = np.clip(np.floor(np.log2(largest)) + 16, 0, 31)
    step = 2.0 ** (exponent - 24)
    # Rounding may reach the next power of two.
    over = np.rint(largest / step) > 511
    exponent, step = exponent + over, np.where(over, step * 2, step)
    red, green, blue = np.rint(scaled / step[:, None]).astype(np.uint32).T
    return red | green << 9 | blue << 18 | exponent.astype(np.uint32) << 27, float(factor)
