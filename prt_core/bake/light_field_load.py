"""A finished light field, checked, read where it is looked at."""

from dataclasses import dataclass, field

import numpy as np

from prt_core.bake.field_denoise import RADIANCE, by_blocks
from prt_core.bake.lights import read_cameras, read_view_transform
from prt_core.bake.named_cameras import NamedCameras
from prt_core.errors import expect, expect_array, expect_named
from prt_core.runtime.address import expect_store_path
from prt_core.scene import Camera, Scene, ViewTransform
from prt_core.store import BakeStore, damage_as_error, read_scene

KIND = "light field"
_AGAIN = "bake it again with --restart"


@dataclass
class LightField(NamedCameras):
    """A light field as it was captured.

    Attributes
    ----------
    scene : Scene
    point : (n,) int32
        The bake point of each point of the field, ascending.
    frames : (n, 3, 3) float32
        Two tangents and the normal of each, as rows.
    lights : tuple of str
        Names of the lights; "all" where the field is of them together.
    radiance : BakeArray
        (n_lights, n, rows, columns, 3) float32, linear Rec.709, read where it is indexed.
    camera : Camera, or None
        That of the scene.
    report, settings : dict
    origin : dict of str -> str
    store : BakeStore
    cameras : dict of str -> Camera
        All cameras of the scene whose lens is followed.
    view_transform : ViewTransform, or None
        How the scene shows radiance, where that is known.
    """

    scene: Scene
    point: np.ndarray
    frames: np.ndarray
    lights: tuple
    radiance: object
    camera: Camera | None
    report: dict
    settings: dict
    origin: dict
    store: BakeStore
    cameras: dict = field(default_factory=dict)
    view_transform: ViewTransform | None = None

    def __len__(self):
        return len(self.point)

    @property
    def angles(self):
        """(int, int): rows and columns of the hemisphere's square."""
        return self.radiance.shape[2:4]

    def weights(self, strengths=None):
        """The factor of each light.

        Parameters
        ----------
        strengths : dict of str -> float or (3,), optional
            By the lights' names; "*" for all others. Default: 1.

        Returns
        -------
        (n_lights, 3) float32

        Raises
        ------
        PRTError
            A name belongs to no light, or a value is no factor.
        """
        strengths = expect_named("lights", strengths or {}, object, "factors")
        unknown = sorted(set(strengths) - {*self.lights, "*"})
        expect(
            not unknown,
            f"light '{unknown[0] if unknown else ''}': the field has no such light; there are "
            f"{', '.join(self.lights)}",
        )
        weights = np.ones((len(self.lights), 3), np.float32)
        for number, name in enumerate(self.lights):
            value = strengths.get(name, strengths.get("*", 1.0))
            value = [value] * 3 if np.ndim(value) == 0 else value
            weights[number] = expect_array(f"light '{name}'", value, (3,), np.float64, 0)
        return weights

    def tables(self, weights):
        """All lights together, block after block: a generator.

        Parameters
        ----------
        weights : (n_lights, 3) float32
            See `weights`.

        Yields
        ------
        slice
            Points of the field.
        (n, rows, columns, 3) float32
        """
        for block, values in by_blocks(self.radiance):
            yield block, np.einsum("lnijc,lc->nijc", values, weights)


def load_light_field(path):
    """Read a finished light field.

    Parameters
    ----------
    path : str or Path
        `NAME.slf`.

    Returns
    -------
    LightField

    Raises
    ------
    PRTError
        Not there, not finished, damaged, or something else.
    """
    path = expect_store_path("light field", path)
    store = BakeStore(path)
    attributes = store.attributes
    expect(
        attributes.get("kind") == KIND,
        f"{path}: is a bake, not a light field; 'prt lightfield bake' makes one of it",
    )
    expect(
        store.is_complete,
        f"{path}: the light field is not finished; run the same 'prt lightfield bake' again and "
        "it goes on",
    )
    scene = read_scene(store)
    point = store.read("field_point", (None,), "int32")
    n_points = len(point)
    with damage_as_error(path, again=_AGAIN):
        lights, report = attributes["lights"], attributes["report"]
        rows, columns = attributes["settings"]["angles"]
        camera, origin = attributes["camera"], attributes["origin"]
        good = isinstance(lights, list) and all(isinstance(name, str) for name in lights)
        expect(good and lights and isinstance(report, dict), "the names of its lights are")
        ascending = n_points and point[0] >= 0 and (np.diff(point) > 0).all()
        expect(bool(ascending) and point[-1] < len(scene.points), "'field_point' is out of range")
        camera = None if camera is None else Camera(**camera)
        cameras = read_cameras(attributes)
        shown = read_view_transform(store)
        expect_named("origin", origin, str, "names")
    frames = store.read("field_frames", (n_points, 3, 3), "float32")
    radiance = store.array(RADIANCE)
    store.expect_shape(radiance, (len(lights), n_points, rows, columns, 3), "float32")
    store.expect_sealed(radiance)
    expect(bool(np.isfinite(frames).all()), f"{path}: 'field_frames' is damaged; {_AGAIN}")
    return LightField(
        scene, point, frames, tuple(lights), radiance, camera, report, attributes["settings"],
        origin, store, cameras, shown,
    )  # fmt: skip
