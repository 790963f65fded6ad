"""Pictures that stories take and renders that they make: read, made, and held beside each other."""

import bpy
import numpy as np
from hand import FOLDER

# Pixels of the pictures beside Cycles, its samples, and of how many pixels a side means are taken:
# its noise is not ours.
SIZE, SAMPLES, _BLOCK = (480, 300), 64, 6


def path_of(name, suffix=".png"):
    return FOLDER / f"{name.replace(' ', '_')}{suffix}"


def read_picture(name, suffix=".png"):
    """(height, width, 4) float32 of a picture by its name, from below; an .exr is linear."""
    image = bpy.data.images.load(str(path_of(name, suffix)))
    try:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(image.size[1], image.size[0], 4)
    finally:
        bpy.data.images.remove(image)


def eevee():
    return "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"


def rendered(name, engine, samples):
    """(height, width, 4) float32, linear, of a render through the camera; and NAME.png of it as
    the display shows it."""
    scene = bpy.context.scene
    scene.render.engine = engine
    if engine == "CYCLES":
        scene.cycles.device, scene.cycles.samples = "CPU", samples
        scene.cycles.use_denoising = False  # not every build has it
        # All bounces, as a bake has them: by itself Cycles ends after four.
        scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 64
        scene.cycles.sample_clamp_indirect = 0
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage, scene.render.film_transparent = 100, True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = "OPEN_EXR", "RGBA"
    scene.render.filepath = str(path_of(name, ".exr"))
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    settings.file_format = "PNG"
    image.save_render(str(path_of(name)), scene=scene)
    bpy.data.images.remove(image)
    return read_picture(name, ".exr")


def apart(one, two, part=None):
    """Relative L2, and the ratio of the means by channel, of two pictures where objects are.

    `part` (rows, columns) bool: of which blocks only.
    """
    one, two = (blocks(picture) for picture in (one, two))
    seen = two[..., 3] > 0.999
    seen &= True if part is None else part
    one, two = one[seen][:, :3], two[seen][:, :3]
    return {
        "l2": float(np.sqrt(((one - two) ** 2).sum() / (two**2).sum())),
        "ratio": (one.mean(axis=0) / two.mean(axis=0)).tolist(),
        "blocks": int(seen.sum()),
    }


def blocks(picture):
    """(rows, columns, 4) means over square blocks."""
    height, width = (n // _BLOCK * _BLOCK for n in picture.shape[:2])
    cut = picture[:height, :width].reshape(height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, 4)
    return cut.mean(axis=(1, 3))


def objects_in_blocks():
    """{object: (rows, columns) bool} of the blocks that the camera sees nothing but it in."""
    scene = bpy.context.scene
    graph, camera = bpy.context.evaluated_depsgraph_get(), scene.camera
    a, b, c, d = (camera.matrix_world @ corner for corner in camera.data.view_frame(scene=scene))
    # From the upper right round: right above, right below, left below, left above.
    columns, rows = SIZE[0] // _BLOCK, SIZE[1] // _BLOCK
    owner = np.full((rows + 1, columns + 1), "", object)
    start = camera.matrix_world.translation
    for row, column in np.ndindex(owner.shape):
        across, up = column * _BLOCK / SIZE[0], row * _BLOCK / SIZE[1]
        place = c + (b - c) * across + (d - c) * up
        hit, _, _, _, item, _ = scene.ray_cast(graph, start, (place - start).normalized())
        owner[row, column] = item.name if hit else ""
    corners = np.stack([owner[:-1, :-1], owner[:-1, 1:], owner[1:, :-1], owner[1:, 1:]])
    whole = (corners == corners[0]).all(axis=0)
    return {name: whole & (corners[0] == name) for name in sorted(set(owner.flat) - {""})}
