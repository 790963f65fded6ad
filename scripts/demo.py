"""`make demo`: bake a model on a ground plane, relight it under Blender's own HDRIs, show it."""

import sys
import time
from pathlib import Path

import bpy
import numpy as np
from PIL import Image
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "blend_scenes"))

import build  # noqa: E402  (lies in blend_scenes)
import prt_core  # noqa: E402
from prt_core.bake.report_lines import report_lines  # noqa: E402
from prt_core.blender_access import import_bpy  # noqa: E402
from prt_core.cli.show import Hushed, working  # noqa: E402
from prt_core.evaluate import contact_sheet, to_display, write_png  # noqa: E402
from prt_core.evaluate.view import CameraRays  # noqa: E402

LIGHTS = ("courtyard", "city", "sunset", "forest")
TURNS = (0, 90, 180)
FRAMES = 36


def exposure_of(picture):
    """Stops that bring the brighter parts of a picture near white."""
    return float(-np.log2(max(np.percentile(picture.max(axis=-1), 97), 1e-6)))


def main():
    output = ROOT / "demo_output"
    output.mkdir(exist_ok=True)
    started = time.perf_counter()
    name = "01_model_on_ground"
    with Hushed():
        for scene_name in tqdm(build.SCENES, desc="scenes", unit=" scene"):
            build.build(scene_name, output / "scenes")
    blend = output / "scenes" / f"{name}.blend"

    with working(silent=False) as bar:
        report = prt_core.bake(blend, output / f"{name}.prt", report=bar, restart=True)
    print("\n".join(report_lines(output / f"{name}.prt", report)))

    bake = prt_core.load(output / f"{name}.prt")
    import_bpy()
    relighter, caster = prt_core.Relighter(bake), bake.make_caster(rays="camera")
    rays = CameraRays(bake.scene, caster, bake.camera, 480, 300)
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    maps = {light: prt_core.EnvironmentMap.read(folder / f"{light}.exr") for light in LIGHTS}

    pictures, labels, spent, stops = [], [], [], {}
    for light, environment in maps.items():
        for turn in TURNS:
            radiance, picture, seconds = shown(relighter, rays, environment, turn)
            stops.setdefault(light, exposure_of(picture))
            pictures.append(to_display(picture, bake.view_transform, stops[light]))
            labels.append(f"{light}, turned by {turn} degrees")
            spent.append(seconds)
    write_png(output / "contact_sheet.png", contact_sheet(pictures, labels, len(TURNS)))

    frames = []
    for i in tqdm(range(FRAMES), desc="turning light", unit=" frame"):
        _, picture, _ = shown(relighter, rays, maps["city"], 360 * i / FRAMES)
        frames.append(Image.fromarray(to_display(picture, bake.view_transform, stops["city"])))
    frames[0].save(
        output / "turning_light.gif", save_all=True, append_images=frames[1:], duration=80, loop=0
    )

    caster.close()
    radiance, _, _ = shown(relighter, rays, maps["courtyard"], 0)
    relighter.close()
    with Hushed():
        prt_core.open_blend(blend)
        from prt_core.blender.colours import save_scene, write_all

        write_all(bake.scene, bake.colours(radiance))
        save_scene(output / "relit.blend")
    print(f"relit {len(spent)} lights, all bounces, exactly: {np.mean(spent):.2f} s each")
    print(f"the demo took {time.perf_counter() - started:.0f} s. Look at")
    for file in ("contact_sheet.png", "turning_light.gif", "relit.blend", f"{name}.prt"):
        print(f"  {output / file}")


def shown(relighter, rays, environment, turn):
    """Radiance, picture and the seconds of the relighting alone."""
    lighting = prt_core.Lighting(environment, rotation=turn)
    start = time.perf_counter()
    radiance = relighter.radiance(lighting)
    seconds = time.perf_counter() - start
    return radiance, rays.picture(radiance, relighter.sky(lighting)), seconds


if __name__ == "__main__":
    main()
