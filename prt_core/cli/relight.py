"""`prt relight`: colours, pictures and .blend files of a bake under a light."""

import argparse
import time
from pathlib import Path

import numpy as np

import prt_core
from prt_core.api import read_environment
from prt_core.cli.arguments import bounces, caster_argument, size, transport_argument
from prt_core.cli.show import Hushed
from prt_core.errors import expect
from prt_core.evaluate.sequence import PictureWriter, frame_path, write_npz
from prt_core.light import EnvironmentMap, rotation_matrix
from prt_core.relighter import Relighter


def add_relight(commands, in_blender):
    """Add `relight` to the commands."""
    relight = commands.add_parser("relight", help="light a bake")
    relight.add_argument("bake", help="NAME.prt")
    relight.add_argument("--light", metavar="IMAGE", help=".exr or .hdr, or 'world'")
    relight.add_argument("--rotate", type=float, help="degrees about z")
    relight.add_argument("--strength", type=float, default=1.0, help="factor on the light (1)")
    relight.add_argument("--exposure", type=float, default=0.0, help="stops, of every output (0)")
    relight.add_argument(
        "--sharp-sun", action="store_true", help="cast the shadow rays of the image's sun"
    )
    relight.add_argument("--lamps", action="store_true", help="add the lamps of the scene")
    relight.add_argument("--lamp-samples", type=int, default=256, help="shadow rays a lamp (256)")
    relight.add_argument(
        "--bounces", type=bounces, default="baked", help="default: as baked; 0 is direct light"
    )
    relight.add_argument("--output", metavar="NPZ", help="colours of each object's corners")
    relight.add_argument("--png", metavar="PNG", help="a picture from the scene's camera")
    relight.add_argument("--image", metavar="PNG", help="the image that was baked")
    relight.add_argument(
        "--turn", type=_frames, metavar="N", help="a whole turn of the light in N numbered files"
    )
    relight.add_argument("--size", type=size, default=(960, 540), help="of the picture (960x540)")
    relight.add_argument("--blend", metavar="BLEND", help="a .blend with the colours")
    relight.add_argument(
        "--scene", metavar="BLEND", help="the baked .blend, to colour a copy of it (for --blend)"
    )
    relight.add_argument("--attribute", default="PRT", help="name of the colour attribute (PRT)")
    relight.add_argument("--domain", choices=("corner", "point"), default="corner")
    transport_argument(relight)
    caster_argument(relight)
    relight.set_defaults(run=_relight, in_blender=in_blender)


def _frames(text):
    if not (text.isdigit() and 0 < int(text) < 100000):
        raise argparse.ArgumentTypeError(f"expected a number of frames, got '{text}'")
    return int(text)


def _relight(options):
    expect(
        options.output or options.png or options.blend or options.image,
        "relight: nothing to write; give --output NPZ, --png PNG, --image PNG or --blend BLEND",
    )
    expect(
        options.light or options.lamps,
        "relight: no light; give --light IMAGE, --light world or --lamps",
    )
    needs_bpy = options.caster in ("blender", "bvhtree") or options.blend
    if needs_bpy:
        _load_bpy()
    for path, suffix in ((options.output, ".npz"), (options.blend, ".blend")):
        expect(
            path is None or Path(path).suffix == suffix,
            f"{path}: expected a name that ends in {suffix}",
        )
    baked = prt_core.load(options.bake)
    if options.turn:
        return _relight_turn(baked, options)
    _bpy_for(options)
    start = time.perf_counter()
    relighter = Relighter(baked, options.caster, options.transport)
    try:
        radiance = relighter.relight(read_environment(options.light), **_light_options(options))
        spent, how = time.perf_counter() - start, _how(relighter)
    finally:
        relighter.close()
    radiance = radiance * np.float32(2.0**options.exposure)
    colours = baked.colours(radiance)
    if options.output:
        write_npz(options.output, colours)
    if options.png:
        _write_png(baked, radiance, options)
    if options.image:
        from prt_core.evaluate import to_srgb, write_png

        write_png(options.image, to_srgb(baked.image(radiance)))
    if options.blend:
        _write_blend(baked, colours, options)
    outputs = options.output, options.png, options.image, options.blend
    written = ", ".join(p for p in outputs if p)
    print(f"{written}: {len(baked.scene.points):,} points relit {how} in {spent:.2f} s")
    return 0


def _relight_turn(baked, options):
    """A turntable: the light turns once, what the camera sees is traced once."""
    expect(
        options.light not in (None, "world") and not options.blend,
        "--turn: turns an image's light into numbered .npz and .png files; give --light IMAGE",
    )
    _bpy_where_needed()
    light = read_environment(options.light)
    relighter = Relighter(baked, options.caster, options.transport)
    pictures = PictureWriter(baked, options.size, options.caster)
    start = time.perf_counter()
    for frame in range(options.turn):
        rotation = (options.rotate or 0.0) + 360.0 * frame / options.turn
        radiance = relighter.relight(light, **{**_light_options(options), "rotation": rotation})
        radiance = radiance * np.float32(2.0**options.exposure)
        if options.output:
            write_npz(frame_path(options.output, frame + 1), baked.colours(radiance))
        if options.png:
            sky = _sky(light, rotation, options)
            pictures.write(frame_path(options.png, frame + 1), radiance, background=sky)
    spent = (time.perf_counter() - start) / options.turn
    first = frame_path(options.png or options.output, 1)
    print(f"{first} and on: {options.turn} frames relit {_how(relighter)}, {spent:.2f} s each")
    return 0


def _how(relighter):
    """How colours were made, for the line that reports them."""
    if relighter.used == "exact":
        return "exactly"
    facts = relighter.compressed().facts
    return f"compressed ({facts['method']}, error {facts['error']:.2%})"


def _load_bpy():
    from prt_core.api import import_bpy

    return import_bpy()


def _bpy_for(options):
    """Blender's rays for shadows where there are no others."""
    if (options.lamps or options.sharp_sun) and options.caster == "auto":
        _bpy_where_needed()


def _light_options(options):
    """What `Relighter.relight` takes, from the command line."""
    return {
        "rotation": options.rotate,
        "strength": options.strength,
        "sharp_sun": options.sharp_sun,
        "lamps": options.lamps,
        "lamp_samples": options.lamp_samples,
        "bounces": options.bounces,
    }


def _bpy_where_needed():
    """`auto` may need Blender's rays where Embree is not installed."""
    from prt_core.rays.caster import known_casters

    if "embree" not in known_casters():
        _load_bpy()


def _write_png(baked, radiance, options):
    from prt_core.evaluate import render_view, to_srgb, write_png

    _bpy_where_needed()
    caster = baked.make_caster(options.caster)
    try:
        sky = None
        if options.light and options.light != "world":
            sky = _sky(EnvironmentMap.read(options.light), options.rotate, options)
        picture = render_view(baked, radiance, caster, *options.size, background=sky)
    finally:
        caster.close()
    write_png(options.png, to_srgb(picture))


def _sky(environment, rotation, options):
    """The environment behind the scene, at the exposure of the picture."""
    back = rotation_matrix(rotation)
    factor = np.float32(options.strength * 2.0**options.exposure)
    return lambda directions: environment.sample(directions @ back) * factor


def _write_blend(baked, colours, options):
    """Colours on the meshes of the scene that is open, of a named .blend, or on built ones."""
    from prt_core.api import open_blend
    from prt_core.blender.colours import save_scene, write_all

    bpy = _load_bpy()
    with Hushed():
        if options.scene:
            open_blend(options.scene)
        elif not options.in_blender:
            bpy.ops.wm.read_factory_settings(use_empty=True)
        fresh = not options.scene and not options.in_blender
        differs = "" if fresh else _differs(baked)
        write_all(baked.scene, colours, options.attribute, options.domain.upper(), all_copies=fresh)
        save_scene(options.blend)
    if differs:
        print(f"  note    the scene is not the one that was baked ({differs}); bake again")


def _differs(baked):
    """How the open scene differs from the one that was baked, in words; empty where it does not."""
    from prt_core.blender.depsgraph import read_meshes
    from prt_core.scene import changes, mesh_digests

    baked_as = {item.name: item for item in baked.scene.objects}
    meshes = read_meshes()
    for mesh in meshes:
        item = baked_as.get(mesh.name, mesh)
        mesh.receives, mesh.two_sided = item.receives, item.two_sided
    found = changes(baked.source, mesh_digests(meshes))
    return "" if found.fresh else str(found)
