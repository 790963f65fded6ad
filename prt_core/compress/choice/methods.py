"""The methods that can be asked for by name.

    register_method(Method("mine", Mine, ladder=lambda task: [Mine(error=e) for e in (0.1, 0.01)]))

is all that a compressor needs to be chosen, stored, relit from, measured and offered on the
command line.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from prt_core.basis import PointHaar
from prt_core.compress.rows import Rows, SomeRows, TransportRows
from prt_core.errors import expect, expect_kind, expect_offers, expect_one_of, expect_whole

_METHODS = {}


@dataclass
class Task:
    """What is to be compressed.

    Attributes
    ----------
    transport : Transport
    rows : Rows
        Of that transport.
    positions, normals : (n_points, 3) float32
    groups : (n_points,) int32
        Objects.
    seed : int
    """

    transport: object
    rows: Rows
    positions: np.ndarray
    normals: np.ndarray
    groups: np.ndarray
    seed: int = 0

    @classmethod
    def of(cls, transport, points, seed=0):
        """All points of a bake: its `transport`, its `BakePoints`, and a `seed`."""
        expect_offers("points", points, ("positions", "object_index"), "a bake's points")
        rows = TransportRows(transport, seed=seed)
        return cls(transport, rows, points.positions, points.normals, points.object_index, seed)

    @property
    def n_points(self):
        """Rows of the matrix."""
        return self.rows.n_points

    def some(self, points):
        """The same for some of the points: their rows hold the light of all."""
        part = replace(
            self.transport,
            bits=self.transport.bits[points],
            gather=None,
            normals=self.transport.normals[points],
            materials=self.transport.materials[points],
            mean_materials=None,
        )
        rows = SomeRows(self.rows, points)
        place = self.positions[points], self.normals[points], self.groups[points]
        return Task(part, rows, *place, self.seed)

    def sample(self, n_points, n_patches):
        """About `n_points` of the points: in `n_patches` of neighbours, or evenly (None)."""
        n_points = expect_whole("n_points", n_points, 1)
        if n_patches is not None:
            n_patches = expect_whole("n_patches", n_patches, 1, n_points)
        order = PointHaar(self.positions, self.normals, self.groups).order
        if len(order) <= n_points:
            return np.arange(len(order))
        if n_patches is None:
            chosen = np.linspace(0, len(order) - 1, n_points).astype(int)
        else:
            size = n_points // n_patches
            first = np.linspace(0, len(order) - size, n_patches).astype(int)
            chosen = np.unique(first[:, None] + np.arange(size))
        return np.sort(order[chosen])


def _itself(model, _transport):
    return model


def _in_proportion(model, n_points):
    return model.nbytes * n_points / model.n_points_


@dataclass(frozen=True)
class Method:
    """A way to compress.

    Attributes
    ----------
    name : str
    kind : type
        A `Compressor` with `state` and `from_state`.
    ladder : callable(Task) -> list of Compressor
        Not fitted: the smallest and fastest first, the nearest to the truth last.
    relighter : callable(model, Transport) -> object
        What gives a fitted model's `product(light)` quickest; default: the model itself.
    finish : callable(model, Task), optional
        The last touch on a model that is kept.
    local : bool
        Whether neighbours decide about a point, so that patches of them tell what all would give;
        otherwise an even sample does.
    size : callable(model, n_points) -> float
        Bytes for so many points, told from a model of some of them.
    """

    name: str
    kind: type
    ladder: Callable
    relighter: Callable = _itself
    finish: Callable | None = None
    local: bool = True
    size: Callable = _in_proportion


def register_method(method):
    """Make a `Method` known, in place of an older one of its name; returns `method`."""
    expect_kind("method", method, Method)
    expect(
        method.name.isidentifier() and method.name not in ("auto", "none"),
        f"method: '{method.name}' cannot be a method's name",
    )
    _METHODS[method.name] = method
    return method


def method_names():
    """Names of all methods, in the order in which they became known."""
    return list(_METHODS)


def method_named(name):
    """The `Method` of a name; `PRTError` where there is none."""
    expect_one_of("method", name, _METHODS)
    return _METHODS[name]
