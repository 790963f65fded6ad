"""What a bake depends on besides the scene."""

from dataclasses import asdict, dataclass

from prt_core.bake.visibility import expect_method
from prt_core.errors import expect_flag, expect_kind, expect_number, expect_seed, expect_whole
from prt_core.sphere import CubeMap


@dataclass(frozen=True)
class BakeSettings:
    """What a bake depends on besides the scene.

    Parameters
    ----------
    resolution : int
        Texels along an edge of the cube map.
    bounces : int or None
        None: all that matter; 0: direct light only.
    tolerance : float
        Relative error of the relit colours that the bounces may have, and that the visibility may
        have where it is sampled.
    caster : str
        `auto`, `blender`, `bvhtree`, `embree` or `brute`.
    seed : int
    method : str
        Which entries are traced: `exhaustive` (all), `agreement`, another registered sampler, or
        `auto`: the cheapest that meets the tolerance.
    gloss : bool
        Whether materials are read with their gloss, which views show.
    """

    resolution: int = 32
    bounces: int | None = None
    tolerance: float = 1e-2
    caster: str = "auto"
    seed: int = 0
    method: str = "auto"
    gloss: bool = False

    def __post_init__(self):
        CubeMap(self.resolution)
        expect_method(self.method)
        if self.bounces is not None:
            expect_whole("bounces", self.bounces, 0)
        expect_number("tolerance", self.tolerance, above=0, below=1)
        expect_seed(self.seed)
        expect_kind("caster", self.caster, str, "the name of one")
        expect_flag("gloss", self.gloss)

    def stored(self):
        """Name -> value of all that a bake keeps; without gloss, as before there was any."""
        return {k: v for k, v in asdict(self).items() if k != "gloss" or v}

    @property
    def series(self):
        """The tolerance at which the series of the bounces ends (see `all_bounces`)."""
        return min(self.tolerance / 5, 1e-3)
