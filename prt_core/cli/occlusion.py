"""`prt occlusion`: ambient occlusion, sky visibility and bent normals of a bake."""

import time

import numpy as np

from prt_core.bake.occlusion import baked_occlusion_steps
from prt_core.blender_access import expect_blend
from prt_core.cli.arguments import bpy_for_rays, caster_argument, expect_used, size
from prt_core.cli.outputs import baked_for, expect_png_bits, write_blend, write_pixels
from prt_core.cli.show import working
from prt_core.errors import expect
from prt_core.evaluate.sequence import PictureWriter, write_npz
from prt_core.evaluate.view import expect_view
from prt_core.runtime.files import expect_output
from prt_core.runtime.progress import run
from prt_core.scene import Camera
from prt_core.transport import Occlusion
from prt_core.transport.occlusion import FALLOFFS, KINDS, WEIGHTS, as_colours

_OUTPUTS = {"output": ".npz", "png": ".png", "image": (".png", ".exr"), "blend": ".blend"}
_NAMES = {"ambient": "AO", "sky": "Sky", "bent-normal": "Bent Normal"}
_NEEDED = {
    "falloff": (("distance",), "--distance"),
    "size": (("png",), "--png"),
    "bits": (("image",), "--image"),
    **{name: (("blend",), "--blend") for name in ("scene", "attribute", "domain", "channel",
                                                   "vector")},
}  # fmt: skip


def add_occlusion(commands, in_blender):
    """Add `occlusion` to the commands."""
    occlusion = commands.add_parser(
        "occlusion", help="ambient occlusion, sky visibility, bent normals of a bake",
        description="From the visibility bits of a bake, without rays; with --distance rays are "
        "cast in all directions that the bits say are blocked, for a bake knows no distances.",
    )  # fmt: skip
    occlusion.add_argument("bake", help="NAME.prt")
    occlusion.add_argument(
        "--kind", choices=KINDS, default="ambient",
        help="ambient: the open share above the surface, as Cycles' AO; sky: the share of the sky "
        "above the world's horizon; bent-normal: the mean open direction (ambient)",
    )  # fmt: skip
    occlusion.add_argument(
        "--weight", choices=WEIGHTS, default="cosine",
        help="of directions: as even light falls, or all alike (cosine)",
    )  # fmt: skip
    occlusion.add_argument(
        "--distance", type=float, metavar="D",
        help="what is farther away, in Blender units, is not in the way",
    )  # fmt: skip
    occlusion.add_argument(
        "--falloff", choices=tuple(FALLOFFS),
        help="how blockers count less towards that distance (constant: all alike, as in Cycles)",
    )  # fmt: skip
    occlusion.add_argument("--output", metavar="NPZ", help="values of each object's corners")
    occlusion.add_argument("--png", metavar="PNG", help="a picture from the scene's camera")
    occlusion.add_argument(
        "--image", metavar="PNG",
        help="the image or atlas that was baked, .png or .exr; values are not gamma-encoded: load "
        "them as Non-Color",
    )  # fmt: skip
    occlusion.add_argument("--bits", type=int, choices=(8, 16), help="of a channel of its .png (8)")
    occlusion.add_argument("--size", type=size, help="of the picture, as WxH")
    occlusion.add_argument("--blend", metavar="BLEND", help="a .blend with the values on meshes")
    occlusion.add_argument(
        "--scene", metavar="BLEND", help="the baked .blend, to write into a copy of it"
    )
    occlusion.add_argument(
        "--attribute", help="name of the colour attribute (AO, Sky or Bent Normal)"
    )
    occlusion.add_argument("--domain", choices=("corner", "point"), help="of the values (corner)")
    occlusion.add_argument(
        "--channel", choices=tuple("RGBA"),
        help="write into this channel of the attribute, the others stay as they are",
    )  # fmt: skip
    occlusion.add_argument(
        "--vector", action="store_true",
        help="bent normals as a vector attribute, not as colours of 0.5 + 0.5 of their components",
    )  # fmt: skip
    caster_argument(occlusion)
    occlusion.add_argument("--quiet", action="store_true", help="no progress bar")
    occlusion.set_defaults(run=_occlusion, in_blender=in_blender)


def _occlusion(options):
    asked = _expect_request(options)
    baked = baked_for(options)
    casts = asked.distance is not None or options.png
    bpy_for_rays(options.caster, casts)
    start = time.perf_counter()
    with working(options.quiet) as bar:
        values = run(baked_occlusion_steps(baked, asked, options.caster), bar)
    spent = time.perf_counter() - start
    colours = as_colours(values)
    if options.output:
        plain = values if values.ndim == 2 else np.repeat(values[:, None], 3, axis=1)
        corners = baked.colours(plain)
        one = values.ndim == 1
        write_npz(options.output, {k: v[:, 0] if one else v for k, v in corners.items()})
    if options.png:
        pictures = PictureWriter(baked, options.size or _size(baked), options.caster)
        write_pixels(options.png, pictures.rays().picture(colours, whole=True), 8, "data")
    if options.image:
        write_pixels(options.image, baked.image(colours), options.bits or 8, "data")
    if options.blend:
        _write_blend(baked, values if options.vector else colours, options)
    written = ", ".join(path for path in _outputs(options).values() if path)
    mean = "" if values.ndim == 2 else f", mean {values[baked.scene.points.visible].mean():.3f}"
    print(f"{written}: {options.kind} of {len(values):,} points{mean} in {spent:.2f} s")
    return 0


def _expect_request(options):
    """The `Occlusion` that is asked for; what cannot be done is refused before any work."""
    outputs = _outputs(options)
    expect(
        any(outputs.values()),
        "occlusion: nothing to write; give --output NPZ, --png PNG, --image PNG or --blend BLEND",
    )
    expect_used(options, _NEEDED)
    asked = Occlusion(options.kind, options.distance, options.falloff or "constant", options.weight)
    bent = options.kind == "bent-normal"
    expect(bent or not options.vector, "--vector: only bent normals are vectors")
    expect(
        not (bent and options.channel),
        "--channel: a bent normal needs three channels; leave it out, or choose another --kind",
    )
    expect(
        options.caster == "auto" or asked.distance is not None or options.png,
        "--caster: no ray is cast; it changes nothing without --distance or --png",
    )
    expect_png_bits(options)
    if options.size:
        expect_view(*options.size)
    paths = [
        expect_output(f"--{name}", path, _OUTPUTS[name]).resolve()
        for name, path in outputs.items()
        if path is not None
    ]
    twice = [path for path in paths if paths.count(path) > 1]
    expect(not twice, f"{twice and twice[0]}: named for two outputs; give each its own")
    if options.scene:
        scene = expect_blend(options.scene).resolve()
        expect(scene not in paths, f"{options.scene}: would be replaced by its own copy; give "
               "--blend another name")  # fmt: skip
    expect(
        options.attribute is None or options.attribute.strip(),
        "--attribute: expected a name, got an empty one",
    )
    options.attribute = options.attribute or _NAMES[options.kind]
    options.domain = options.domain or "corner"
    return asked


def _outputs(options):
    return {name: getattr(options, name) for name in _OUTPUTS}


def _size(baked):
    return (baked.camera or Camera(np.eye(4), 1)).size()


def _write_blend(baked, colours, options):
    corners, how = baked.colours(colours), {}
    if options.vector:
        how = {"vector": True, "active": False}
    elif options.channel:
        how = {"channels": options.channel, "active": False}
        if options.channel == "A":
            corners = {name: values[:, [0, 0, 0, 0]] for name, values in corners.items()}
    write_blend(baked, corners, options, **how)
