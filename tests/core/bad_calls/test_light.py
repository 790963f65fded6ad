"""Wrong calls of `prt_core.light`."""

import numpy as np
import pytest

from prt_core import light, sphere

from .calls import Call, directions, exr, faults_of, image, method, plain

CALLS = {
    "CubeMap": plain(sphere.CubeMap, resolution=3),
    "CubeMap.texel_of": method(lambda t: sphere.CubeMap(3), "texel_of", directions=directions()),
    "CubeMap.on_faces": method(
        lambda t: sphere.CubeMap(3), "on_faces", ("u", "v"), u=np.zeros(3), v=np.ones(3)
    ),
    "EnvironmentMap": plain(
        light.EnvironmentMap,
        ("name other text", "name empty text"),
        pixels=image().pixels,
        name="sky",
    ),
    "EnvironmentMap.read": lambda t: Call(light.EnvironmentMap.read, {"path": exr(t)}),
    "EnvironmentMap.to_cube_map": method(
        lambda t: image(),
        "to_cube_map",
        cube_map=lambda t: sphere.CubeMap(2),
        rotation=30.0,
        strength=2.0,
    ),
    "EnvironmentMap.sample": method(lambda t: image(), "sample", directions=directions()),
    "Sky": lambda t: Call(
        lambda directions, spread: light.Sky(((image(), np.eye(3), 1.0),))(directions, spread),
        {"directions": directions(), "spread": 0.1},
    ),
    "TurningLight": lambda t: Call(
        lambda environment, cube_map, rotation: light.TurningLight(environment, cube_map).at(
            rotation
        ),
        {"environment": image(), "cube_map": sphere.CubeMap(2), "rotation": 5.0},
        ("rotation None",),
    ),
    "read_image": lambda t: Call(light.read_image, {"path": exr(t)}),
    "write_image": lambda t: Call(
        light.write_image, {"path": t.folder / "w.exr", "pixels": image().pixels}
    ),
    "rotation_about_z": plain(sphere.rotation_about_z, degrees=30.0),
    "rotation_matrix": plain(sphere.rotation_matrix, ("rotation None",), rotation=np.eye(3)),
    "rotation_matrix of angles": plain(
        sphere.rotation_matrix, ("rotation None",), rotation=(1.0, 2.0, 3.0)
    ),
    "split_sun": lambda t: Call(
        light.split_sun, {"environment": image(), "rotation": 3.0, "strength": 1.0}
    ),
    "sun_light": lambda t: Call(
        light.sun_light,
        {
            "cube_map": sphere.CubeMap(2),
            "direction": np.ones(3),
            "irradiance": np.ones(3),
            "angle": 0.1,
        },
        ("irradiance number",),
    ),  # fmt: skip
    "BrightPixels": plain(
        light.BrightPixels,
        ("rotation", "name", "kind"),
        rows=np.array([0, 1]),
        columns=np.array([2, 3]),
        shape=(4, 8),
        radiance=np.ones((2, 3)),
        rotation=np.eye(3),
    ),
    "Lamp": plain(
        light.Lamp,
        (
            "name other text",
            "name empty text",
            "position",
            "axes",
            "receivers None",
            "blockers None",
            "pattern None",
            "pattern negative",
            "texture None",
            "texture negative",
            "falloff None",
        ),
        kind="spot",
        power=np.ones(3),
        position=np.zeros(3),
        axes=np.eye(3),
        radius=0.1,
        size=(1.0, 2.0),
        ellipse=True,
        cone=1.0,
        blend=0.2,
        angle=0.1,
        spread=1.0,
        casts_shadow=True,
        receivers=["floor"],
        blockers=["lid"],
        pattern=np.ones((2, 3, 3)),
        texture=np.ones((3, 2, 3)),
        falloff=np.array([(1.0, 2.0), (2.0, 3.0), (4.0, 1.0)]),
        of_world=False,
        name="bulb",
    ),
    "Lamp.sample": method(
        lambda t: light.Lamp("area", (1, 2, 3)),
        "sample",
        ("uv",),
        positions=np.ones((4, 3)),
        uv=np.full((4, 2), 0.5),
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    faults = faults_of(CALLS[name](there), there.folder)
    assert not faults, "\n".join(faults)
