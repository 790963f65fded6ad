"""What every sampler returns, and the table of samplers."""

from dataclasses import dataclass, field

import numpy as np

from prt_core.errors import expect, expect_kind
from prt_core.runtime.progress import Progress
from prt_core.runtime.renamed import renamed
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport.visibility import expect_bits

_SAMPLERS = {}


@dataclass
class Sampled:
    """Visibility of all points, and which of its entries were really traced.

    Entries below a point's horizon are known without a ray: 0 in both arrays.

    Attributes
    ----------
    bits : (n_points, n_bytes) uint8
        Visibility as `visibility_bits` gives it (little bit order).
    traced : (n_points, n_bytes) uint8
        The entries whose ray was cast, in the same order.
    rays : int
    seconds : dict of str -> float
        By stage.
    attributes : dict
        What a report tells: levels, counts, what was skipped. Plain numbers, strings, lists.
    """

    bits: np.ndarray
    traced: np.ndarray
    rays: int
    seconds: dict = field(default_factory=dict)
    attributes: dict = field(default_factory=dict)

    facts = renamed("facts", "attributes")


@dataclass(frozen=True)
class LevelDone(Progress):
    """`Progress` of a sampler that knows the whole rows of some points by now.

    Attributes
    ----------
    points : (n,) int
        Those that are known, in an order in which the first of them stand for all.
    bits : (n_points, n_bytes) uint8
        Visibility of all points, as far as it is known: it goes on changing, copy what is needed.
    """

    points: np.ndarray
    bits: np.ndarray


def expect_sampled(sampled, scene, cube_map):
    """Raise `PRTError` unless this is the sampled visibility of a scene."""
    expect_kind("scene", scene, Scene)
    expect_kind("cube_map", cube_map, CubeMap)
    expect_kind("sampled", sampled, Sampled)
    wanted = len(scene.points), -(-cube_map.n_directions // 8)
    for name in ("bits", "traced"):
        # An array, or what is read from a file where it is indexed.
        rows = getattr(sampled, name)
        if isinstance(rows, np.ndarray) or not hasattr(rows, "dtype"):
            expect_bits(f"sampled: {name}", rows, cube_map.n_directions)
        expect(
            rows.dtype == np.uint8 and tuple(rows.shape) == wanted,
            f"sampled: {name} are of another scene",
        )


def register_sampler(name, sampler, settings):
    """Make a sampler known.

    Parameters
    ----------
    name : str
    sampler : generator function
        `sampler(scene, cube_map, caster, settings, tally=None, pace=None)` yields `Progress`, of
        which `LevelDone` lets others look on, and returns `Sampled`. `tally(int)` is told the
        number of rays of each batch; `pace` is a `Pace` in rays. It calls the caster from its own
        thread, in the same order whatever the pace, and its result depends on nothing but the
        scene, the cube map and the settings.
    settings : class
        Dataclass of the sampler's settings; all have defaults, `seed` is one of them.
    """
    _SAMPLERS[name] = sampler, settings


def sampler_named(name):
    """(sampler, settings class) of a registered name.

    Raises
    ------
    PRTError
        There is none of that name.
    """
    expect(
        isinstance(name, str) and name in _SAMPLERS,
        f"method: there is no sampler '{name}'; choose one of {', '.join(sampler_names())}",
    )
    return _SAMPLERS[name]


def sampler_names():
    """Names of all registered samplers."""
    return sorted(_SAMPLERS)
