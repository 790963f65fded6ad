"""The transport as rows of features, one a point.

`image_rows` is imported by its own name: it reads the wavelets, whose compressors read rows.
"""

from prt_core.compress.rows.row_code import RowCode
from prt_core.compress.rows.rows import ArrayRows, Rows, SomeRows, TransportRows

__all__ = ["ArrayRows", "RowCode", "Rows", "SomeRows", "TransportRows"]
