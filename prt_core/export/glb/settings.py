"""`GLBSettings`: what of a bake goes into a .glb, and how."""

from dataclasses import dataclass

from prt_core.errors import (
    expect,
    expect_flag,
    expect_number,
    expect_one_of,
    expect_whole,
)
from prt_core.light.environment import BRIGHTEST

COLOURS = ("albedo", "light")
MATERIALS = ("unlit", "multiplied")
ENCODINGS = ("float", "u16")
# Weights of a vertex at most: with the other attributes they fill the sixteen of WebGL.
MOST_COMPONENTS = 32


@dataclass(frozen=True)
class GLBSettings:
    """What of a bake goes into a .glb, and how.

    Parameters
    ----------
    colours : {"albedo", "light"}, optional
        Whether COLOR_0 and _PRT_RADIANCE are what surfaces send out, their own colours in it, or
        the light that they receive. Default: as the material asks for.
    material : {"unlit", "multiplied"}
        unlit: colours are shown as they are. multiplied: materials have base colours of their own,
        with which the light is multiplied. Neither is lit by an engine's lights.
    weights : bool
        Write weights and cluster of the bake's compressed form, so that an engine relights.
    harmonics : bool
        Write nine spherical harmonics a vertex, so that an engine relights without shadows' edges.
    encoding : {"float", "u16"}
        Of COLOR_0.
    white : float, optional
        The radiance that is 1 in COLOR_0; brighter ones are cut there. Default: the brightest, or
        1 where nothing is brighter.
    components : int
        Weights of a vertex at most.
    texels : int, optional
        Along an edge of the cube map that weights are relit from. Default: as baked.

    Raises
    ------
    PRTError
        A setting is wrong, or albedo would be multiplied twice.
    """

    colours: str | None = None
    material: str = "unlit"
    weights: bool = False
    harmonics: bool = False
    encoding: str = "float"
    white: float | None = None
    components: int = 24
    texels: int | None = None

    def __post_init__(self):
        expect_one_of("material", self.material, MATERIALS)
        expect_one_of("encoding", self.encoding, ENCODINGS)
        expect_flag("weights", self.weights)
        expect_flag("harmonics", self.harmonics)
        expect_whole("components", self.components, 1, MOST_COMPONENTS)
        if self.colours is not None:
            expect_one_of("colours", self.colours, COLOURS)
        if self.white is not None:
            expect_number("white", self.white, above=0, most=BRIGHTEST)
        if self.texels is not None:
            expect_whole("texels", self.texels, 1)
        expect(
            self.material != "multiplied" or self.colours != "albedo",
            "material 'multiplied': has the albedo already, colours with albedo would have it "
            "twice; take colours 'light', or material 'unlit'",
        )

    @property
    def of_light(self):
        """Whether the light that surfaces receive is written, and not what they send out."""
        return self.colours == "light" or self.material == "multiplied"
