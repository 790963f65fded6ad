"""What a conformance scene is: a function that builds it, and what is expected of a bake."""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass

import bpy

_SCENES = {}


@dataclass(frozen=True)
class ConformanceScene:
    """A scene of one feature.

    Parameters
    ----------
    build : callable(bool)
        Builds it in an empty file. False: without the feature, as a program that ignores it would
        see the scene.
    kind : str
        The module that it is written in.
    light : {"world", "lamps", "all"}
        What the bake is relit by.
    targets : tuple of str
        Objects whose colours are compared.
    bound : float
        Largest relative error that is right.
    says : tuple of str
        One message that holds all these words does as well as right colours. Empty: it must be
        right.
    since, until : (int, int)
        The first Blender that has the feature as the golden file shows it, and the last.
    quick : bool
        Whether it runs in `make test`.
    samples : int
        Of Cycles, for each corner.
    """

    build: Callable
    kind: str
    light: str = "world"
    targets: tuple = ("ground",)
    bound: float = 0.03
    says: tuple = ()
    since: tuple = (4, 2)
    until: tuple = (9, 9)
    quick: bool = False
    samples: int = 1024

    @property
    def name(self):
        return self.build.__name__

    @property
    def exists_here(self):
        """Whether the Blender at hand has the feature."""
        return self.since <= bpy.app.version[:2] <= self.until

    def open(self, with_feature=True):
        """Build it in an empty file."""
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.build(with_feature)
        bpy.context.view_layer.update()


def scene(**expected):
    """Make a conformance scene of a function; the keywords are those of `ConformanceScene`."""

    def register(build):
        kind = build.__module__.rpartition(".")[2]
        if build.__name__ in _SCENES:
            raise ValueError(f"{build.__name__}: two conformance scenes of this name")
        _SCENES[build.__name__] = ConformanceScene(build, kind, **expected)
        return build

    return register


def all_scenes(names=()):
    """The scenes of these names or kinds, in the order of the files; without names: all."""
    from tests.conformance import scenes

    for module in pkgutil.iter_modules(scenes.__path__):
        importlib.import_module(f"{scenes.__name__}.{module.name}")
    known = {s.name for s in _SCENES.values()} | {s.kind for s in _SCENES.values()}
    unknown = sorted(set(names) - known)
    if unknown:
        raise SystemExit(f"{', '.join(unknown)}: neither a conformance scene nor a kind of them")
    return [s for s in _SCENES.values() if not names or {s.name, s.kind} & set(names)]
