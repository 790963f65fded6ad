"""Wrong public calls: bakes, stores, relighting, pictures."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prt_core
from prt_core import api, evaluate, export_web, light, scene
from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.blocks import block_figures, compute, missing_blocks, stages
from prt_core.bake.images import ImageSettings
from prt_core.bake.load import load
from prt_core.bake.pictures import Pictures
from prt_core.bake.plan import plan_steps
from prt_core.bake.preflight import preflight
from prt_core.blender_access import expect_blend
from prt_core.evaluate.sequence import PictureWriter, frame_path, light_path, light_paths, write_npz
from prt_core.export.glb import glb_steps
from prt_core.relight.blend import LightBlend, WeightedLight
from prt_core.relight.light_file import read_lights, write_lights
from prt_core.relight.lighting import Lighting
from prt_core.relight.lights_apart import lights_apart
from prt_core.relight.relighter import Relighter
from prt_core.runtime.progress import Progress, run
from prt_core.store import BakeStore
from prt_core.transport import Occlusion
from tests.view_transforms import plain_view_transform

from .calls import (
    RESOLUTION,
    Call,
    any_of,
    blend,
    camera,
    caster,
    exr,
    faults_of,
    image,
    method,
    plain,
)


def bake_call(there):
    def bake(**arguments):
        path = there.folder / "again.prt"
        run(bake_steps(path=path, restart=True, **arguments))
        # What may be baked can be read.
        return load(path).transport.radiance(there.light)

    lamps = [light.Lamp("point", (1.0, 2.0, 3.0))]
    return Call(
        bake,
        {
            "scene": there.scene,
            "settings": BakeSettings(RESOLUTION, caster="brute", bounces=0),
            "lamps": lamps,
            "world": there.light,
            "camera": camera(),
            "cameras": {"Top": camera()},
            "view_transform": plain_view_transform(),
            "source": {"plane": "digest"},
            "pace": 0.5,
            "pictures": Pictures(),
            "lights": {"sky": there.light},
            "memory": 1.0,
            "reuse": there.bake.path,
            "only": [there.scene.objects[0].known_as],
        },
        ("lamps no elements", "pictures None", "memory None", "only None"),
    )


def plan_call(there):
    def plan(**arguments):
        return run(plan_steps(path=there.folder / "plan.prt", **arguments))

    good = {
        "scene": there.scene,
        "settings": BakeSettings(RESOLUTION, caster="brute", bounces=0),
        "lamps": [light.Lamp("point", (1.0, 2.0, 3.0))],
        "world": there.light,
        "camera": camera(),
        "cameras": {"Top": camera()},
        "source": {"plane": "digest"},
        "lights": {"sky": there.light},
        "memory": 1.0,
    }
    may = "lamps no elements", "memory None", "lights None", "source None", "world None"
    return Call(plan, good, (*may, "camera None", "cameras None", "settings None"))


def planned(there):
    """A bake that is planned, and not finished."""
    settings = BakeSettings(RESOLUTION, caster="brute", bounces=0)
    run(plan_steps(there.scene, there.folder / "planned.prt", settings))
    return there.folder / "planned.prt"


def to_finish(there):
    """Another, to be finished."""
    settings = BakeSettings(RESOLUTION, caster="brute", bounces=0)
    path = there.folder / "finish.prt"
    run(plan_steps(there.scene, path, settings))
    return path


def path_call(there):
    def bake(path):
        run(bake_steps(there.scene, path, BakeSettings(2, 0, caster="brute")))
        shutil.rmtree(path)

    # The name of a folder to be made may be any.
    return Call(bake, {"path": there.folder / "c.prt"}, ("path text",))


def lights_file(folder):
    path = folder / "good_lights.json"
    path.write_text('{"night": {"emission": "all"}}')
    return path


CALLS = {
    "BakeStore": lambda t: Call(BakeStore, {"path": t.folder / "a.prt", "mode": "r"}),
    "load": lambda t: Call(load, {"path": t.folder / "a.prt"}),
    "auto_camera": lambda t: Call(scene.auto_camera, {"scene": t.scene}),
    "colour_error": plain(
        evaluate.colour_error, colours=np.ones((3, 3)), truth=np.ones((3, 3)), weights=np.ones(3)
    ),
    "export_web": lambda t: Call(
        export_web,
        {
            "bake": t.bake,
            "output": t.folder / "page.html",
            "bits": True,
            "lights": None,
            "sets": None,
            "light_field": None,
            "title": "a",
            "lamp_samples": 1,
        },
        (
            "bits None",
            "output folder",
            "title text",
            "title None",
            "lights None",
            "sets None",
            "light_field None",
            "output text",
            "title long name",
            "title empty text",
            "title other text",
        ),
    ),  # fmt: skip
    "contact_sheet": plain(
        evaluate.contact_sheet,
        ("labels one more",),
        images=[np.zeros((4, 5, 3), np.uint8)] * 2,
        labels=["a", "b"],
        columns=2,
    ),
    "render_view": lambda t: Call(
        evaluate.render_view,
        {
            "bake": t.bake,
            "radiance": np.ones((t.bake.transport.n_points, 3), np.float32),
            "caster": caster(t),
            "width": 3,
            "height": 2,
        },
    ),  # fmt: skip
    "to_srgb": plain(evaluate.to_srgb, ("linear",), linear=np.ones((2, 3, 3)), exposure=1.0),
    "write_png": lambda t: Call(
        evaluate.write_png,
        {"path": t.folder / "w.png", "image": np.zeros((2, 3, 3), np.uint8)},
    ),
    "write_npz": lambda t: Call(
        write_npz,
        {"path": t.folder / "w.npz", "colours": {"a": np.ones((2, 3))}},
        ("colours dict",),
    ),
    "light_path": plain(
        light_path,
        (*any_of("pattern"), "name other text", "name one more", "name long name"),
        pattern=Path("a_#.png"),
        name="day",
    ),
    "light_paths": plain(light_paths, any_of("pattern"), pattern=Path("a_#.png"), names=["day"]),
    "frame_path": plain(frame_path, any_of("pattern"), pattern=Path("a_#.png"), frame=3),
    "PictureWriter": lambda t: Call(
        lambda path, radiance, camera, **rest: PictureWriter(**rest).write(path, radiance, camera),
        {
            "bake": t.bake,
            "size": (3, 2),
            "caster": "brute",
            "path": t.folder / "w.png",
            "radiance": np.ones((t.bake.transport.n_points, 3), np.float32),
            "camera": camera(),
        },
        ("camera None",),
    ),  # fmt: skip
    "Bake.camera_named": lambda t: Call(
        replace(t.bake, cameras={"Top": camera()}).camera_named, {"name": "Top"}
    ),
    "BakeSettings": plain(
        BakeSettings,
        ("caster other text", "caster empty text", "bounces None"),
        resolution=3,
        bounces=2,
        tolerance=0.1,
        caster="brute",
        seed=0,
        method="auto",
    ),
    "bake_steps": bake_call,
    "bake_steps path": path_call,
    "plan_steps": plan_call,
    "finish": lambda t: Call(
        api.finish,
        {"store": to_finish(t), "memory": 1.0, "compute": True, "dask": None},
        ("dask None",),
    ),
    "blocks.stages": lambda t: Call(stages, {"store": planned(t)}),
    "blocks.missing_blocks": lambda t: Call(
        missing_blocks, {"store": planned(t), "stage": "visibility"}
    ),
    "blocks.compute": lambda t: Call(
        compute, {"store": planned(t), "stage": "visibility", "index": 0}
    ),
    "blocks.block_figures": lambda t: Call(
        block_figures, {"store": planned(t), "stage": "visibility"}
    ),
    "preflight": lambda t: Call(
        preflight,
        {
            "scene": t.scene,
            "settings": BakeSettings(2),
            "back_end": "embree",
            "rays_per_second": 1e6,
        },
        ("back_end other text", "back_end empty text"),
    ),  # fmt: skip
    "Bake.colours": method(
        lambda t: t.bake,
        "colours",
        radiance=lambda t: np.ones((t.bake.transport.n_points, 3), np.float32),
    ),
    "Bake.make_caster": method(lambda t: t.bake, "make_caster", name="brute"),
    "relight": lambda t: Call(
        api.relight,
        {
            "bake": t.bake,
            "light": image(),
            "rotation": 30.0,
            "strength": 2.0,
            "sharp_sun": False,
            "lamps": False,
            "lamp_samples": 3,
            "caster": "brute",
            "bounces": 1,
            "form": "exact",
        },
        ("light None", "caster other text", "caster empty text", "bounces None"),
    ),  # fmt: skip
    "occlusion": lambda t: Call(
        api.occlusion,
        {
            "bake": t.bake,
            "kind": "sky",
            "distance": 0.5,
            "falloff": "linear",
            "weight": "even",
            "caster": "brute",
        },
        ("caster other text", "caster empty text"),
    ),  # fmt: skip
    "Occlusion": plain(Occlusion, kind="ambient", distance=0.5, falloff="smooth", weight="cosine"),
    "lights_apart": lambda t: Call(
        lambda lighting: lights_apart(t.bake, lighting), {"lighting": Lighting(image())}
    ),
    "ImageSettings": plain(
        ImageSettings,
        ("atlas_objects other text", "atlas one more", "atlas one less"),
        atlas=(8, 4),
        atlas_objects=["plane"],
        atlas_uv="own",
        atlas_margin=2,
    ),
    "to_whole": plain(evaluate.to_whole, ("values",), values=np.ones((2, 3, 3)), bits=16),
    "Lighting": plain(
        Lighting,
        ("environment", "bounces None"),
        environment=image(),
        rotation=30.0,
        strength=2.0,
        sharp_sun=False,
        lamps=[light.Lamp("point", (1, 2, 3))],
        lamp_strength=3.0,
        lamp_samples=5,
        bounces=7,
        exposure=1.5,
    ),
    "WeightedLight": plain(
        WeightedLight,
        ("name other text", "name empty text"),
        name="day",
        lighting=Lighting(image()),
        weight=0.5,
    ),
    "LightBlend": lambda t: Call(
        lambda lights, **rest: LightBlend(t.bake, **rest).radiance(lights),
        {
            "lights": [WeightedLight("day", Lighting(image()))],
            "caster": "brute",
            "form": "exact",
        },
        ("caster other text", "caster empty text"),
    ),
    "read_lights": lambda t: Call(
        lambda path: read_lights(path, t.bake), {"path": lights_file(t.folder)}
    ),
    "write_lights": lambda t: Call(
        write_lights,
        {"path": t.folder / "lights.json", "lights": {"day": {"lamps": True}}},
    ),
    "relight by path": lambda t: Call(
        lambda bake, light: api.relight(bake, light, form="exact"),
        {"bake": t.folder / "a.prt", "light": exr(t)},
    ),
    "relight on texels": lambda t: Call(
        lambda light: api.relight_points(t.bake, light, form="exact"),
        {"light": t.light},
    ),
    "relight by lamps": lambda t: Call(
        lambda lamps: api.relight(t.bake, lamps=lamps, lamp_samples=2, caster="brute"),
        {"lamps": [light.Lamp("point", (1, 2, 3), (0, 0, 4))]},
    ),
    "Relighter": lambda t: Call(
        Relighter,
        {"bake": t.bake, "caster": "brute", "form": "exact"},
        ("caster other text", "caster empty text"),
    ),
    "Relighter.replace": method(lambda t: Relighter(t.bake), "replace", bake=lambda t: t.bake),
    "Pictures": plain(Pictures, ("share None",), share=0.5, to_the_end=True),
    "environment_light": lambda t: Call(
        prt_core.environment_light,
        {"bake": t.bake, "light": image(), "rotation": 3.0, "strength": 1.0},
        ("light None",),
    ),
    "GLBSettings": plain(
        prt_core.GLBSettings,
        ("colours None", "white None", "texels None"),
        colours="light",
        material="multiplied",
        weights=True,
        harmonics=False,
        encoding="u16",
        white=2.0,
        components=7,
        texels=2,
    ),
    "export_glb": lambda t: Call(
        prt_core.export_glb,
        {
            "bake": t.folder / "a.prt",
            "output": t.folder / "a.glb",
            "light": image(),
            "rotation": 30.0,
            "caster": "brute",
            "form": "exact",
            "material": "unlit",
            "harmonics": True,
            "white": 3.0,
        },
        ("light None", "caster other text", "caster empty text", "white None"),
    ),  # fmt: skip
    "glb_steps": lambda t: Call(
        glb_steps,
        {
            "bake": t.bake,
            "path": t.folder / "a.glb",
            "radiance": np.ones((t.bake.transport.n_points, 3), np.float32),
            "settings": prt_core.GLBSettings(),
            "light": t.light,
        },
        ("settings None", "light None", "radiance negative"),
    ),  # fmt: skip
    "open_blend": lambda t: Call(expect_blend, {"path": blend(t)}),
    "bake": lambda t: Call(
        prt_core.bake,
        {
            "blend": blend(t),
            "output": t.folder / "b.prt",
            "objects": ["a"],
            "two_sided": ["a"],
            "restart": False,
            "on_picture": print,
            "camera_pixels": (3, 2),
            "pixel_samples": 1,
            "parametrisation": "auto",
            "resolution": 2,
            "seed": 0,
            "memory": 1.0,
            "plan": False,
        },
        whole=False,
    ),  # fmt: skip
    "compress": lambda t: Call(
        lambda **rest: prt_core.compress(**rest, lights={"sky": image()}),
        {"bake": t.folder / "a.prt", "method": "harmonics", "tolerance": 0.5, "seed": 0},
        ("tolerance None",),
    ),
    "run": lambda t: Call(run, {"steps": (Progress("a", i, 2) for i in range(2))}, ("steps",)),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    faults = faults_of(CALLS[name](there), there.folder)
    assert not faults, "\n".join(faults)
