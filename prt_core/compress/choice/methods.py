"""The methods that can be asked for by name.

    register_method(Method("mine", Mine, budgets=lambda task: [Mine(error=e) for e in (0.1, 0.01)]))

is all that a compressor needs to be chosen, stored, relit from, measured and offered on the
command line.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from prt_core.basis import PointHaar
from prt_core.compress.rows import Rows, SomeRows, TransportRows
from prt_core.compress.rows.image_rows import image_rows
from prt_core.compress.rows.view_rows import ViewRows
from prt_core.compress.subject import Subject
from prt_core.errors import (
    PRTError,
    expect,
    expect_kind,
    expect_offers,
    expect_one_of,
    expect_whole,
)
from prt_core.runtime.named_settings import expect_settings, named_settings, read_setting

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
    image : PointImage, optional
        Whose pixels the points are: then positions are places in the image.
    dense : (n_dense,) int, optional
        The points that were sampled densely, ascending.
    reflections : tuple of Reflections
        With which pixels show gloss.
    """

    transport: object
    rows: Rows
    positions: np.ndarray
    normals: np.ndarray
    groups: np.ndarray
    seed: int = 0
    image: object = None
    dense: np.ndarray | None = None
    reflections: tuple = ()

    @classmethod
    def of(cls, transport, points, seed=0, dense=None):
        """All points of a bake: its `transport`, its `BakePoints`, a `seed`, its `dense` points."""
        expect_offers("points", points, ("positions", "object_index"), "a bake's points")
        rows = TransportRows(transport, seed=seed)
        place = points.positions, points.normals, points.object_index
        return cls(transport, rows, *place, seed, None, dense)

    @classmethod
    def of_image(cls, transport, image, seed=0, reflections=(), weights=None):
        """The pixels of an image whose points were baked.

        Parameters
        ----------
        transport : Transport
            Of all points.
        image : PointImage
        seed : int
        reflections : tuple of Reflections, optional
            With which the pixels show gloss to the image's camera.
        weights : ViewWeights, optional
            Then those of its points.

        Returns
        -------
        Task
        """
        rows = TransportRows(transport, seed=seed)
        if reflections:
            rows = ViewRows(rows, image, weights)
        else:
            rows = image_rows(rows, image, transport.sends)
        row, column = np.divmod(np.arange(rows.n_points), image.width)
        places = np.stack([column, row, np.zeros_like(row)], axis=1).astype(np.float32)
        normals = np.tile(np.float32([0, 0, 1]), (len(places), 1))
        groups = np.zeros(len(places), np.int32)
        return cls(transport, rows, places, normals, groups, seed, image, None, reflections)

    @property
    def subject(self):
        """What forms of this are of: a `Subject`."""
        return Subject(self.transport, self.image, self.reflections)

    @property
    def n_points(self):
        """Rows of the matrix."""
        return self.rows.n_points

    def colours(self, lights):
        """Exact colours under lights, for which the visibility is unpacked once.

        Parameters
        ----------
        lights : dict of str -> (n_directions, 3) float32

        Returns
        -------
        dict of str -> (n_points, 3) float32
            Radiance of points, or of pixels; with gloss that of their rows, for which see
            `ViewRows`.
        """
        if self.reflections:
            return {name: self.rows.product(light) for name, light in lights.items()}
        # Of light without colour one column is enough.
        narrow = [x[:, :1] if (x == x[:, :1]).all() else x for x in lights.values()]
        ends = np.cumsum([x.shape[1] for x in narrow])
        received = np.split(self.transport.received(np.hstack(narrow)), ends[:-1], axis=1)
        shape = self.transport.n_points, 3
        colours = {}
        for name, part in zip(lights, received, strict=True):
            arrived = self.transport.product(None, lamps=np.broadcast_to(part, shape).copy())
            colours[name] = self.subject.radiance_of_points(arrived)
        return colours

    def some(self, points):
        """The same for some of the points: their rows hold the light of all."""
        rows = SomeRows(self.rows, points)
        place = self.positions[points], self.normals[points], self.groups[points]
        if self.image is not None:
            return replace(self, rows=rows, positions=place[0], normals=place[1], groups=place[2])
        part = replace(
            self.transport,
            bits=self.transport.bits[points],
            gather=None,
            normals=self.transport.normals[points],
            materials=self.transport.materials[points],
            mean_materials=None,
            opposite=None,
        )
        dense = None
        if self.dense is not None:
            dense = np.flatnonzero(np.isin(np.arange(self.n_points)[points], self.dense))
        return Task(part, rows, *place, self.seed, None, dense)

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


def _on_points(task):
    return task.image is None


def _every_number(model, n_points):
    return _in_proportion(model, n_points) / 4


@dataclass(frozen=True)
class Method:
    """A way to compress.

    Attributes
    ----------
    name : str
    kind : type
        A `Compressor` with `state` and `from_state`.
    budgets : callable(Task) -> list of Compressor
        Not fitted: the smallest and fastest first, the nearest to the truth last.
    evaluator : callable(model, Transport or None) -> object
        What gives a fitted model's `product(light)` quickest; default: the model itself.
    finish : callable(model, Task), optional
        The last touch on a model that is kept.
    local : bool
        Whether neighbours decide about a point, so that patches of them tell what all would give;
        otherwise an even sample does.
    size : callable(model, n_points) -> float
        Bytes for so many points, told from a model of some of them.
    work : callable(model, n_points) -> float
        Numbers that a light of so many points is multiplied with: what its time grows with.
    candidate : bool
        Whether `auto` tries it.
    first : callable(Task) -> bool
        Whether it is tried first: others only where none such keeps what was asked for.
    fixed : tuple of str
        Parameters that come with the bake or with the call, and are no settings.
    choices : dict of str -> tuple of str
        Words for settings that are objects.
    make : callable(Task, str, str) -> object
        What such a word stands for: of the task, the setting and the word.
    """

    name: str
    kind: type
    budgets: Callable
    evaluator: Callable = _itself
    finish: Callable | None = None
    local: bool = True
    size: Callable = _in_proportion
    work: Callable = _every_number
    candidate: bool = True
    first: Callable = _on_points
    fixed: tuple = ("seed",)
    choices: dict = field(default_factory=dict)
    make: Callable | None = None

    @property
    def settings(self):
        """Settings that can be asked for, and their defaults: a dict by name."""
        parameters = inspect.signature(self.kind).parameters
        return {k: p.default for k, p in parameters.items() if k not in self.fixed}

    def with_settings(self, texts):
        """This method with some settings the same all along its budgets.

        Parameters
        ----------
        texts : dict of str -> str
            As `named_settings` gives them.

        Returns
        -------
        Method
            Settings of the budgets that are the same now are there once.

        Raises
        ------
        PRTError
            There is no such setting, or it cannot have such a value.
        """
        if not texts:
            return self
        known = self.settings
        expect_settings(self.name, texts, known)
        words = {key: text for key, text in texts.items() if key in self.choices}
        for key, word in words.items():
            expect_one_of(f"method: '{self.name}': {key}", word, self.choices[key])
        values = {k: read_setting(t, known[k]) for k, t in texts.items() if k not in words}
        # What comes with the bake is not there yet.
        parameters = inspect.signature(self.kind).parameters
        absent = [k for k, p in parameters.items() if p.default is inspect.Parameter.empty]
        try:
            self.kind(**dict.fromkeys(absent), **values).expect_params()
        except PRTError as error:
            raise PRTError(f"method: '{self.name}': {error}") from error

        def budgets(task):
            more = {key: self.make(task, key, word) for key, word in words.items()}
            models = []
            for model in self.budgets(task):
                model.set_params(**values, **more)
                params = model.get_params()
                if all(params != other.get_params() for other in models):
                    models.append(model)
            return models

        return replace(self, budgets=budgets)


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


def candidate_names():
    """Names of the methods that `auto` tries."""
    return [name for name, method in _METHODS.items() if method.candidate]


def method_named(name):
    """The `Method` of a name; `PRTError` where there is none."""
    expect_one_of("method", name, _METHODS)
    return _METHODS[name]


def method_from_text(text):
    """The `Method` of a `text`, NAME or NAME:key=value,key=value.

    Raises
    ------
    PRTError
        There is no such method or setting, or it cannot have such a value; what there is is said.
    """
    name, settings = named_settings(text)
    return method_named(name).with_settings(settings)


def settings_of(model):
    """Parameters of a `model` as a report tells them: a dict of plain values by name.

    Objects are told by their `name`; what has none is left out.
    """
    params = model.get_params()
    named = {k: v if _is_plain(v) else getattr(v, "name", None) for k, v in params.items()}
    return {k: v for k, v in named.items() if v is not None or params[k] is None}


def describe(model):
    """The settings of a `model` that are not None, but for seed and memory, in a few words."""
    shown = {k: v for k, v in settings_of(model).items() if k not in ("seed", "memory")}
    return ", ".join(f"{k}={_short(v)}" for k, v in shown.items() if v is not None)


def _is_plain(value):
    return value is None or isinstance(value, bool | int | float | str)


def _short(value):
    return f"{value:.3g}" if isinstance(value, float) else str(value)
