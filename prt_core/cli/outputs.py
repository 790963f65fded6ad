"""What commands write: images, and .blend files with colours."""

import math
from pathlib import Path

from prt_core.bake import load
from prt_core.blender_access import import_bpy, open_blend
from prt_core.cli.arguments import bpy_for_rays
from prt_core.cli.show import Hushed
from prt_core.errors import expect
from prt_core.light import write_image


def write_pixels(path, pixels, bits=8, curve="srgb", view_transform=None):
    """Linear pixels as a picture for the eye, or as they are in .exr.

    Parameters
    ----------
    path : str or Path
        `.png` or `.exr`.
    pixels : (height, width, 3) float32
    bits : {8, 16}
        Of a channel of a .png.
    curve : {"srgb", "data"}
        "data": numbers that are no colours, without a curve in a .png either.
    view_transform : ViewTransform, optional
        Of colours: how a .png shows them; default: none.
    """
    if Path(path).suffix.lower() == ".exr":
        write_image(path, pixels)
        return
    from prt_core.evaluate import to_display, to_whole, write_png

    if curve == "srgb":
        whole = to_display(pixels, view_transform, bits=bits)
    else:
        whole = to_whole(pixels, bits)
    write_png(path, whole, curve)


def image_notes(path, pixels, image, view_transform=None):
    """What is to be said of an image that was written.

    Parameters
    ----------
    path : str or Path
    pixels : (height, width, 3) float32
    image : PointImage
    view_transform : ViewTransform, optional
        By which it is shown: nothing is cut then.

    Returns
    -------
    list of str
        What a .png has cut, and how far the two sides of an atlas' seams differ.
    """
    notes, most = [], float(pixels.max(initial=0))
    if Path(path).suffix.lower() == ".png" and most > 1 and view_transform is None:
        share = (pixels > 1).any(axis=-1).mean()
        stops = -math.ceil(math.log2(most) * 10) / 10
        notes.append(
            f"{share:.1%} of the pixels are brighter than white and cut; --exposure {stops:g} "
            "holds them all, an .exr as well"
        )
    if image.atlas is not None and len(image.atlas.seams.edge):
        mean, worst = image.atlas.seams.error(pixels)
        notes.append(
            f"the two sides of seams differ by {mean:.2%} in the mean, by {worst:.2%} at worst"
        )
    return notes


def expect_png_bits(options):
    """Refuse bits of a channel where the image of the `options` is no .png."""
    png = (options.image or "").lower().endswith(".png")
    expect(options.bits is None or png, "--bits: an .exr has 32; leave it out")


def baked_for(options):
    """The `Bake` that a command writes outputs of; Blender is loaded where these need it."""
    bpy_for_rays(options.caster, casts=False)
    if options.blend:
        import_bpy()
    baked = load(options.bake)
    if options.blend and not options.scene and not options.in_blender:
        _expect_other_file(baked, options.blend)
    expect(
        not options.image or baked.scene.image is not None,
        "--image: this bake holds none; bake with --camera-pixels, --geometry-image or --atlas",
    )
    return baked


def _expect_other_file(baked, path):
    """Refuse to put built meshes in the place of the .blend that was baked."""
    file, path = baked.origin.get("file"), Path(path)
    if not file or not isinstance(baked.path, Path):
        return
    own = baked.path.parent / file
    expect(
        not (own.is_file() and path.is_file() and path.samefile(own)),
        f"{path}: is the scene that was baked, and would be replaced by its meshes alone; give "
        f"--blend another name, and --scene {path} for a copy of the scene with the colours",
    )


def expect_no_input(paths, *inputs):
    """Refuse outputs, resolved `paths`, that are among the files that are read."""
    for given in filter(None, inputs):
        expect(
            Path(given).resolve() not in paths,
            f"{given}: is read, and would be written over; give the output another name",
        )


def write_blend(baked, colours, options, after=None, **how):
    """Colours on the meshes of the scene that is open, of a named .blend, or on built ones.

    Parameters
    ----------
    baked : Bake
    colours : dict of str -> (n_corners, 3) or (n_corners, 4) float32
    options : argparse.Namespace
        With blend, scene, in_blender, attribute and domain.
    after : callable, optional
        What else is to be done before the file is saved.
    **how
        See `write_colours`.
    """
    from prt_core.blender.colours import save_scene, write_all

    bpy = import_bpy()
    with Hushed():
        if options.scene:
            open_blend(options.scene)
        elif not options.in_blender:
            bpy.ops.wm.read_factory_settings(use_empty=True)
        fresh = not options.scene and not options.in_blender
        differs = "" if fresh else _differs(baked, options)
        place = options.attribute, options.domain.upper()
        write_all(baked.scene, colours, *place, all_copies=fresh, **how)
        if after is not None:
            after()
        save_scene(options.blend)
    if differs:
        print(f"  note    {differs}; bake again")


def _differs(baked, options):
    """How the open scene differs from the one that was baked, in words; empty where it does not."""
    from prt_core.blender.depsgraph import read_meshes
    from prt_core.blender.identity import frame_of
    from prt_core.scene import changes, mesh_digests

    baked_as = {item.name: item for item in baked.scene.objects}
    meshes = read_meshes(gloss=baked.settings.get("gloss", False))
    for mesh in meshes:
        item = baked_as.get(mesh.name, mesh)
        mesh.receives, mesh.two_sided = item.receives, item.two_sided
    differences = changes(baked.source, mesh_digests(meshes))
    frame, now = baked.origin.get("frame"), frame_of(import_bpy().context.scene)
    other = "" if frame in (None, now) else f"it is at frame {now}, the bake is of frame {frame}"
    if not differences.fresh:
        said = "; ".join(filter(None, [str(differences), other]))
        return f"the scene is not the one that was baked ({said})"
    # What does not move looks the same; lamps and world may still be others.
    shine = getattr(options, "lamps", False) or getattr(options, "light", None) == "world"
    if not (shine and other):
        return ""
    return f"lamps and world are those that were baked: nothing else has moved, but {other}"
