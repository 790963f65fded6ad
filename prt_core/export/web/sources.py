"""The lights of a page: images, the scene's world, its lamps, its materials that emit light."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prt_core.errors import expect
from prt_core.light import EnvironmentMap
from prt_core.light.environment import named_images
from prt_core.relight.emission import OTHERS, EmittedLight
from prt_core.relight.lamps import LampLight
from prt_core.relight.lighting import Lighting
from prt_core.runtime.main_thread import in_thread

# Lamps, and emitters, that have a slider of their own; of more, the others share one.
_MOST = 15
# Pixels that an image of light is shrunk to.
IMAGE_HEIGHT = 96
_PAGE = Path(__file__).parent / "page"
_BUILT_IN = "lights.npz"


@dataclass(frozen=True)
class Source:
    """Light of the scene's own.

    Attributes
    ----------
    name : str
    kind : {"lamp", "world", "emitter"}
        `world`: a sun that shines with the light of the scene's world.
    received : (n_points, 3) float32
        With all bounces.
    emitters : tuple of int
        Which of the bake's emitters this is.
    in_world : bool
        Whether the light of the scene's world holds it already.
    lamp : Lamp, optional
        Where it is a single one.
    direct : (n_points, 3) float32, optional
        What arrives of that straight.
    """

    name: str
    kind: str
    received: np.ndarray
    emitters: tuple = ()
    in_world: bool = False
    lamp: object = None
    direct: np.ndarray | None = None

    @property
    def sign(self):
        """-1 where it takes light away."""
        return -1.0 if self.received.max(initial=0) <= 0 else 1.0


def lamp_steps(bake, caster, n_samples, pace=None):
    """List of `Source`, of lamps and the world's suns; a generator of `Progress`."""
    lamps = list(bake.lamps)
    light = LampLight(bake, caster)
    try:
        parts = yield from light.steps(lamps, n_samples, pace)
    finally:
        light.close()
    sources = []
    for lamp, part in zip(lamps, parts, strict=True):
        received = yield from in_thread("bounces", bake.transport.with_bounces, part)
        kind = "world" if lamp.of_world else "lamp"
        in_world = kind == "lamp" and lamp.is_on_texels and bake.world is not None
        sources.append(Source(lamp.name, kind, received, (), in_world, lamp, part))
    suns = [source for source in sources if source.kind == "world"]
    if len(suns) > 1:
        suns = [Source("sun", "world", sum(source.received for source in suns))]
    lamps = [source for source in sources if source.kind == "lamp"]
    apart = [source for source in lamps if source.in_world]
    return suns + _few(apart) + _few([source for source in lamps if not source.in_world])


def emitter_steps(bake):
    """List of `Source`, of the materials that emit light; a generator of `Progress`."""
    names = () if bake.emission is None else bake.emission.names
    emitted, sources = EmittedLight(bake), []
    for index, name in enumerate(names):
        alone = Lighting(emission={name: 1.0, OTHERS: 0.0})
        received, _ = yield from in_thread("emission", emitted.of, alone)
        sources.append(Source(name, "emitter", received, (index,)))
    return _few(sources)


def _few(sources):
    """The strongest by themselves, and all others as one."""
    if len(sources) <= _MOST + 1:
        return sources
    power = [-float(source.received.sum(dtype=np.float64)) for source in sources]
    order = [int(index) for index in np.argsort(power, kind="stable")]
    rest = [sources[index] for index in sorted(order[_MOST:])]
    others = Source(
        f"{len(rest)} others",
        rest[0].kind,
        sum(source.received for source in rest),
        sum((source.emitters for source in rest), ()),
        rest[0].in_world,
    )
    return [sources[index] for index in sorted(order[:_MOST])] + [others]


def page_images(paths=None):
    """{name: EnvironmentMap}: images that a page offers, those of the package by default.

    Parameters
    ----------
    paths : sequence of str or Path, optional
    """
    if paths is not None:
        return {name: shrunk(image) for name, image in named_images(paths).items()}
    with np.load(_PAGE / _BUILT_IN) as images:
        return {name: EnvironmentMap(from_rgbe(images[name]), name) for name in images.files}


def shrunk(image, height=IMAGE_HEIGHT):
    """An `EnvironmentMap` of at most so many rows, with the power of the image, as RGBE keeps it.

    Pixels are means over the area of the sphere that they cover.
    """
    pixels = image.pixels
    rows = pixels.shape[0]
    if rows > height:
        pixels = _means(pixels, height)
    return EnvironmentMap(from_rgbe(rgbe(pixels)), image.name, image.notes)


def _means(pixels, height):
    """(height, 2 height, 3) means of equirectangular pixels by area."""
    rows, columns = pixels.shape[:2]
    level = np.sin(np.pi / 2 - np.arange(rows + 1) / rows * np.pi)
    down = _shares(rows, height) * (level[:-1] - level[1:])
    down /= down.sum(axis=1, keepdims=True)
    across = _shares(columns, 2 * height)
    across /= across.sum(axis=1, keepdims=True)
    return np.einsum("hr,rcx,wc->hwx", down, pixels.astype(np.float64), across, optimize=True)


def _shares(many, few):
    """(few, many): the share of each of many equal steps that lies in each of few."""
    edges = np.arange(few + 1) * many / few
    first, step = edges[:-1, None], np.arange(many)
    overlap = np.minimum(edges[1:, None], step + 1) - np.maximum(first, step)
    return np.clip(overlap, 0, 1)


def rgbe(pixels):
    """(height, width, 4) uint8 of pixels (height, width, 3): mantissas and a shared exponent."""
    most = np.max(pixels, axis=-1)
    exponent = np.where(most > 0, np.floor(np.log2(np.maximum(most, 1e-30))) + 1, -128)
    step = np.exp2(exponent - 8)
    # Rounding may reach the next power of two.
    exponent = exponent + (np.rint(most / step) > 255)
    codes = np.rint(pixels / np.exp2(exponent - 8)[..., None])
    none = (most <= 0) | (exponent < -127)
    stored = np.concatenate([codes, exponent[..., None] + 128], axis=-1)
    return np.where(none[..., None], 0, stored).astype(np.uint8)


def from_rgbe(coded):
    """(height, width, 3) float32 pixels of `rgbe`."""
    step = np.exp2(coded[..., 3].astype(np.float32) - 136)
    step[coded[..., 3] == 0] = 0
    return coded[..., :3] * step[..., None]


def expect_images(images):
    """Raise `PRTError` where an image is not bright enough to be seen, or black."""
    for name, image in images.items():
        expect(image.pixels.any(), f"lights: {name} is black; leave it out")
