"""What a light field depends on besides the scene, and the shares that several capture it in."""

from dataclasses import dataclass

from prt_core.errors import (
    expect,
    expect_flag,
    expect_number,
    expect_pair,
    expect_seed,
    expect_whole,
)
from prt_core.store import BakeStore

# Cells along a side of the hemisphere's square.
MOST_ANGLES = 1024
MOST_SAMPLES = 1 << 16
# The attribute of a light field that may be captured in shares.
PLANNED = "field_planned"


@dataclass(frozen=True)
class LightFieldSettings:
    """What a light field depends on besides the scene.

    Parameters
    ----------
    angles : (int, int)
        Rows and columns of the hemisphere's square (m1, m2).
    samples : int or None
        Paths of each direction; None: as many as the tolerance takes.
    tolerance : float
        Where samples are not given: the relative L2 of one seed's field, as two of them tell.
    denoise : bool
        Whether Open Image Denoise is asked for; its result is used where it keeps the energy.
    seed : int
    """

    angles: tuple = (32, 16)
    samples: int | None = 32
    tolerance: float = 0.05
    denoise: bool = False
    seed: int = 0

    def __post_init__(self):
        angles = expect_pair("angles", self.angles, 1, MOST_ANGLES)
        expect(
            min(angles) > 1,
            f"angles: expected two numbers of 2 to {MOST_ANGLES}, got {angles[0]} x {angles[1]}; "
            "a single cell along a side has no direction to tell apart",
        )
        object.__setattr__(self, "angles", angles)
        if self.samples is not None:
            expect_whole("samples", self.samples, 1, MOST_SAMPLES)
        expect_number("tolerance", self.tolerance, above=0, below=1)
        expect_flag("denoise", self.denoise)
        expect_seed(self.seed)


def expect_share(share):
    """(I, N), I from 0 to N - 1, where it is that; None of None."""
    if share is None:
        return None
    number, count = expect_pair("share", share, 0)
    expect(number < count, f"share: expected (I, N) with I below N, got ({number}, {count})")
    return number, count


def planned_field(path, identity):
    """The store of a light field that was planned, for one who captures a share of it.

    Who does writes nothing that is said of it, and removes no leftovers, which may be another's.

    Parameters
    ----------
    path : Path or Address
    identity : dict
        Of the scene, the camera and the settings.

    Raises
    ------
    PRTError
        It was not planned, or for another scene or other settings.
    """
    store = BakeStore(path)
    planned = store.attributes.get("identity")
    expect(
        planned is not None and PLANNED in store.attributes or store.is_complete,
        f"{path}: was not planned; run the same command with --plan first",
    )
    different = sorted(key for key in identity if planned.get(key) != identity[key])
    expect(
        not different,
        f"{path}: was planned with another {', '.join(different)}; share it with the same flags",
    )
    return store
