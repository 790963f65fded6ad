"""Transport in fewer bytes, and relighting from them."""

from prt_core.compress.row_code import RowCode
from prt_core.compress.rows import ArrayRows, Rows, TransportRows

__all__ = ["ArrayRows", "RowCode", "Rows", "TransportRows"]
