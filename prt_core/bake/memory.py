"""How much memory a bake may take, and what is cut into which pieces because of it."""

from dataclasses import dataclass

from prt_core.errors import expect, expect_number
from prt_core.runtime.machine import memory_bytes

# What a bake needs to begin with, in gigabytes.
_LEAST = 0.5
# Of the machine's memory, where nothing is said.
_SHARE = 0.5
# Points of a tile where there are many; and the fewest, for the sake of what tiles do not share.
TILE, _SMALLEST = 15_000, 2048
# Bytes of rows that are sampled whole, in one tile: what is smaller gains nothing by tiles.
_WHOLE = 96 << 20
# What is known of a point besides its row takes as much as a row of so many bytes.
_SHORT = 256
# More is not held at once of what is gone through piece by piece, however much memory there is.
_SPAN, _KEPT = 256 << 20, 64 << 20
# What sampling holds for each byte of the rows of a tile.
_HELD = 8


@dataclass(frozen=True)
class Memory:
    """The memory that a bake may take, the program itself and the scene apart.

    Parameters
    ----------
    n_bytes : int
    """

    n_bytes: int

    @classmethod
    def of(cls, gigabytes=None):
        """So many gigabytes; None: half of what the machine, or its container, has.

        Raises
        ------
        PRTError
            It is less than a bake can do with, or more than there is.
        """
        there = memory_bytes()
        if gigabytes is None:
            return cls(int(max(there * _SHARE, _LEAST * 1e9)))
        wanted = expect_number("memory", gigabytes, least=_LEAST)
        expect(
            wanted * 1e9 <= there,
            f"memory: expected at most the {there / 1e9:.1f} GB that there are, got "
            f"{wanted:.6g} GB",
        )
        return cls(int(wanted * 1e9))

    def tile_points(self, n_points, row_bytes):
        """Points of a tile that is sampled alone; `n_points` where one tile holds all.

        Where there is memory enough, it depends on the scene alone: what is sampled depends on it.

        Parameters
        ----------
        n_points : int
        row_bytes : int
            Of a point's visibility.
        """
        row_bytes = max(row_bytes, _SHORT)
        fits = self.n_bytes // 4 // (_HELD * row_bytes)
        if n_points <= min(_WHOLE // row_bytes, fits):
            return n_points
        return int(min(TILE, max(fits, _SMALLEST)))

    def span(self, row_bytes):
        """Rows of so many bytes that are held at once where all are gone through."""
        return max(_SMALLEST, min(self.n_bytes // 16, _SPAN) // row_bytes)

    @property
    def kept(self):
        """Bytes of pieces of a file that are kept for the next who asks for them."""
        return min(self.n_bytes // 32, _KEPT)

    def holds(self, n_bytes):
        """Whether an array of so many bytes is kept in memory, rather than in a file."""
        return n_bytes <= self.most_held

    @property
    def most_held(self):
        """Bytes of an array that is kept in memory, at most."""
        return self.n_bytes // 4
