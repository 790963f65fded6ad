"""A bake in memory: what `load` returns."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from prt_core.bake.emission import Emission
from prt_core.bake.named_cameras import NamedCameras
from prt_core.errors import expect, expect_array
from prt_core.light import EnvironmentMap
from prt_core.scene import Camera, Scene, ViewTransform
from prt_core.transport import Transport


@dataclass
class Bake(NamedCameras):
    """A bake in memory.

    Attributes
    ----------
    scene : Scene
    transport : Transport
    lamps : list of Lamp
        The lamps the scene had.
    world : (n_directions, 3) float32, or None
        The light of the scene's world, where it was understood.
    camera : Camera, or None
    settings, report : dict
    source : dict of str -> str
        Digests of the meshes the bake was made from.
    path : Path, or None
        Where it was loaded from.
    origin : dict of str -> str
        The `file` (seen from the bake's folder), the `scene` and the `frame` it is of; empty where
        not known, and without a frame in bakes of older versions.
    dense : (n_dense,) int32, or None
        The points that were sampled densely, where the bake's method has such: ascending.
    emission : Emission, or None
        What points receive of surfaces that emit light, where there are such.
    reflections : tuple of Reflections
        What glossy points see, where it was baked; one for each size of blocks.
    cameras : dict of str -> Camera
        All cameras of the scene whose lens is followed.
    world_image : EnvironmentMap, or None
        The world in finer detail, without suns that are lamps.
    view_transform : ViewTransform, or None
        How the scene shows radiance (see `to_display`), where that is known.
    """

    scene: Scene
    transport: Transport
    lamps: list
    world: np.ndarray | None
    camera: Camera | None
    settings: dict
    report: dict
    source: dict = field(default_factory=dict)
    path: Path | None = None
    origin: dict = field(default_factory=dict)
    dense: np.ndarray | None = None
    emission: Emission | None = None
    reflections: tuple = ()
    cameras: dict = field(default_factory=dict)
    world_image: EnvironmentMap | None = None
    view_transform: ViewTransform | None = None

    @property
    def cube_map(self):
        """`CubeMap`: the directions that were baked."""
        return self.transport.cube_map

    def make_caster(self, name="auto", rays="diffuse"):
        """A ray caster over the bake's triangles that rays of a kind meet.

        Parameters
        ----------
        name : str
        rays : {"diffuse", "shadow", "camera"}
            See `Scene.make_caster`.
        """
        return self.scene.make_caster(name, rays, self.cube_map.resolution)

    def colours(self, radiance):
        """Radiance of points as colours of corners.

        Parameters
        ----------
        radiance : (n_points, 3) float32

        Returns
        -------
        dict of str -> (n_corners, 3) float32
            For each object that receives, in Blender's loop order; black for corners of faces
            without area.
        """
        radiance = self._radiance(radiance)
        return {
            item.name: np.where(
                item.corner_point[:, None] >= 0, radiance[item.corner_point], np.float32(0)
            )
            for item in self.scene.objects
            if item.receives
        }

    def image(self, radiance):
        """The image that was baked: (height, width, 3) float32, linear.

        Parameters
        ----------
        radiance : (n_points, 3) float32

        Raises
        ------
        PRTError
            The bake has no image.
        """
        expect(
            self.scene.image is not None,
            "image: this bake holds none; bake with --camera-pixels, --geometry-image or --atlas",
        )
        image = self.scene.image
        return image.finished(image.pixels(self._radiance(radiance)))

    def _radiance(self, radiance):
        shape = self.transport.n_points, 3
        return expect_array("radiance", radiance, shape, np.float32)
