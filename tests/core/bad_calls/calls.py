"""A public call with every argument wrong in turn: one line of `PRTError`, or a good result."""

import inspect
import warnings
from dataclasses import dataclass, fields, is_dataclass

import numpy as np

from prt_core.errors import PRTError
from prt_core.light import EnvironmentMap, write_image
from prt_core.rays import BruteForceCaster
from prt_core.runtime.progress import run
from prt_core.scene import Camera
from prt_core.sphere import CubeMap

RNG = np.random.default_rng(5)
RESOLUTION = 2
N_DIRECTIONS = 6 * RESOLUTION**2


@dataclass
class Call:
    """A call that is good, and what of it may be otherwise.

    Attributes
    ----------
    function : callable
    good : dict
        Arguments by name.
    may : tuple of str
        "argument label" of wrong values that happen to be good ones, or "argument" for all.
    whole : bool
        Whether the call can be made here as it is; not where it needs a real scene of Blender's.
    """

    function: object
    good: dict
    may: tuple = ()
    whole: bool = True


class Nothing:
    def __repr__(self):
        return "nothing\nmuch"


def plain(function, may=(), /, **good):
    """A `Call` of what needs no bake."""
    return lambda there: Call(function, good, may)


def method(owner, called, may=(), /, **good):
    """A `Call` of a method of what `owner(there)` makes; arguments may be made of `there` too."""
    return lambda there: Call(
        getattr(owner(there), called),
        {k: v(there) if callable(v) else v for k, v in good.items()},
        may,
    )


def with_scene(function, may=(), /, **more):
    """A `Call` of a function of a scene, its caster and a cube map."""

    def build(there):
        good = {"scene": there.scene, "caster": caster(there)}
        if "cube_map" in inspect.signature(function).parameters:
            good["cube_map"] = CubeMap(RESOLUTION)
        return Call(function, {**good, **{k: v(there) for k, v in more.items()}}, may)

    return build


def any_of(*names):
    """Linear maps take axes of any length before the last, and hand NaN on; paths are free."""
    labels = ("another axis", "a NaN", "an infinity", "3e38", "negative", "one more", "one less",
              "text", "long name", "below a file", "folder")  # fmt: skip
    return tuple(f"{name} {label}" for name in names for label in labels)


def faults_of(call, folder):
    """What is wrong with how a `Call` takes wrong arguments, a line each."""
    if call.whole:
        _ask(call.function, dict(call.good))
    faults = []
    for argument, value in call.good.items():
        for label, wrong, never in wrong_values(value, folder):
            may = _allowed(call, argument, label)
            try:
                result = _ask(call.function, {**call.good, argument: wrong})
            except PRTError as error:
                if len(str(error).splitlines()) != 1:
                    faults.append(f"{argument} {label}: several lines: {error}")
            except Exception as error:
                if not (may and isinstance(error, RuntimeWarning)):
                    faults.append(f"{argument} {label}: {type(error).__name__}: {error}")
            else:
                if never and not may:
                    faults.append(f"{argument} {label}: accepted")
                elif not _finite(result) and not may:
                    faults.append(f"{argument} {label}: not finite")
    return faults


def wrong_values(value, folder):
    """(label, value, whether it may never be accepted) in place of a good `value`."""
    yield "None", None, True
    yield "object", Nothing(), True
    yield "list of objects", [Nothing(), Nothing()], True
    if not isinstance(value, str):
        yield "text", "no such thing", True
    yield "bytes", b"\xff\0", True
    if isinstance(value, bool):
        yield "number", 3, True
        return
    yield "complex", 1j, True
    if not isinstance(value, dict):
        yield "dict", {"a": 1}, True
    if isinstance(value, str):
        yield "empty text", "", True
        yield "other text", "no\nsuch thing", True
        yield "number", 3, True
        return
    if hasattr(value, "__fspath__"):
        yield "empty text", "", True
        yield "zero byte", "a\0b", True
        yield "long name", str(folder / ("n" * 300)), True
        yield "below a file", str(folder / "file" / "a.prt"), True
        yield "folder", str(folder), True
        yield "number", 3, True
        return
    yield "NaN", float("nan"), True
    yield "infinity", float("inf"), True
    if isinstance(value, int | float):
        yield "True", True, True
        yield "huge", 10**30 if isinstance(value, int) else 1e300, False
        yield "negative", -value - 1, False
        if isinstance(value, int):
            yield "fraction", 0.5, True
            yield "zero", 0, False
        yield "list", [value, value], True
        return
    array = value if isinstance(value, np.ndarray) else None
    if array is None and isinstance(value, list | tuple) and value and np.isscalar(value[0]):
        array = np.asarray(value)
    if array is None or array.dtype.kind not in "fiub":
        yield "number", 3, True
        return
    yield "strings", np.full(array.shape, "a"), True
    yield "objects", np.full(array.shape, None), True
    yield "complex array", array + 1j, True
    yield "ragged", [[1], [1, 2]], True
    yield "another axis", array[None], True
    yield "number", 3.5, False
    if array.ndim:
        yield "no elements", array[:0], False
        yield "one more", np.concatenate([array, array[-1:]]), False
        yield "one less", array[:-1], False
    if array.dtype.kind == "f":
        subset = array.copy()
        subset.flat[-1] = np.nan
        yield "a NaN", subset, True
        subset = array.copy()
        subset.flat[0] = -np.inf
        yield "an infinity", subset, True
        yield "3e38", np.full_like(array, 3e38), False
        yield "negative", -array - 1, False
    elif array.dtype.kind in "iu":
        yield "fractions", array + 0.5, True
        yield "far", array.astype(np.int64) + 10**9, False
        yield "negative", -array.astype(np.int64) - 5, False


def _allowed(call, name, label):
    if name in call.may or f"{name} {label}" in call.may:
        return True
    parameters = inspect.signature(call.function).parameters
    default = parameters[name].default if name in parameters else None
    return label == "None" and default is None


def _finite(value, depth=0):
    """Whether all numbers in a result are finite."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind not in "fc" or bool(np.isfinite(value).all())
    if isinstance(value, float):
        return bool(np.isfinite(value))
    if depth > 3:
        return True
    if isinstance(value, dict):
        return all(_finite(v, depth + 1) for v in value.values())
    if isinstance(value, list | tuple):
        return all(_finite(v, depth + 1) for v in value[:50])
    if is_dataclass(value) and not isinstance(value, type):
        return all(_finite(getattr(value, f.name), depth + 1) for f in fields(value))
    return True


def _ask(function, arguments):
    """The result of a call; of a generator, what it returns."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = function(**arguments)
        return run(result) if inspect.isgenerator(result) else result


def camera():
    """A camera that looks down on the scene."""
    matrix = np.eye(4)
    matrix[2, 3] = 5.0
    return Camera(matrix, 0.5)


def directions(n=5):
    """(n, 3) unit vectors."""
    ways = RNG.normal(size=(n, 3))
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def image():
    """An environment of 3 x 6 pixels."""
    return EnvironmentMap((1 + RNG.random((3, 6, 3))).astype(np.float32), "sky")


def caster(there):
    """Of the scene."""
    return BruteForceCaster(there.scene.vertices, there.scene.triangles)


def exr(there):
    """An image of light on disk."""
    path = there.folder / "sky.exr"
    if not path.exists():
        write_image(path, image().pixels)
    return path


def blend(there):
    """A .blend that is none."""
    path = there.folder / "a.blend"
    path.write_bytes(b"")
    return path
