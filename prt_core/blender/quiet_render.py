"""Cycles renders a copy of the user's scene, whose layers are read back; nothing of it stays."""

import tempfile
from contextlib import contextmanager
from pathlib import Path

import bpy

from prt_core.blender.casters import mark_temporary, remove_blocks
from prt_core.blender.operator_context import context_of
from prt_core.blender.passes.openexr import read_channels
from prt_core.blender.passes.traces import no_handlers, no_output
from prt_core.blender.render_scene import is_rendering, reading, rendered_layer
from prt_core.errors import PRTError

# The name of the one view layer of such a copy.
LAYER = "prt"
# Of objects: that rays of the camera meet their own surfaces.
SEEN = {
    "hide_render": False,
    "visible_camera": True,
    "is_holdout": False,
    "is_shadow_catcher": False,
}
# What a render would do besides rendering.
_OFF = (
    "use_compositing use_sequencer use_border use_motion_blur use_multiview use_freestyle "
    "use_stamp use_persistent_data use_placeholder use_lock_interface"
).split()
# How Cycles renders plain samples of whole pixels, whatever the scene asks for.
_CYCLES = {
    "device": "CPU", "use_adaptive_sampling": False, "use_denoising": False,
    "pixel_filter_type": "BOX", "filter_width": 0.01, "film_exposure": 1.0,
    "sample_clamp_direct": 0, "sample_clamp_indirect": 0, "blur_glossy": 0,
    "use_auto_tile": False, "time_limit": 0, "use_camera_cull": False, "use_distance_cull": False,
    "sample_offset": 0, "use_sample_subset": False, "use_guiding": False, "seed": 0,
}  # fmt: skip


@contextmanager
def copied_scene(scene, name):
    """A copy of a scene that shares its objects, and an empty scene on its frame.

    Parameters
    ----------
    scene : bpy.types.Scene
    name : str
        Of the copy.

    Yields
    ------
    copy, idle : bpy.types.Scene
        The render operator evaluates the scene that it is called from: the empty one.
    """
    made = []
    try:
        made.append(scene.copy())
        made[0].name = name
        mark_temporary(made[0])
        made.append(bpy.data.scenes.new("prt idle"))
        mark_temporary(made[1])
        made[1].frame_current = scene.frame_current
        yield tuple(made)
    finally:
        remove_blocks(made)


def settle(copy, scene, what, passes, cycles):
    """Set everything about the render of a copy that the user's scene may have otherwise.

    Parameters
    ----------
    copy, scene : bpy.types.Scene
        The copy, and the user's.
    what : str
        What is rendered, for messages.
    passes : set of str
        What `use_pass_...` switches of the view layer are on.
    cycles : dict of str -> value
        Settings of Cycles besides those that all such renders have.

    Raises
    ------
    PRTError
        Cycles is switched off.
    """
    own_layer = rendered_layer(scene)[0].name
    copy.animation_data_clear()
    render = copy.render
    try:
        render.engine = "CYCLES"
    except TypeError as error:
        raise PRTError(
            f"{what}: Cycles renders them and is switched off; enable the add-on "
            "'Cycles Render Engine' in the preferences"
        ) from error
    for name in _OFF:
        setattr(render, name, False)
    render.use_overwrite = True
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1
    picture = render.image_settings
    if hasattr(picture, "media_type"):
        picture.media_type = "MULTI_LAYER_IMAGE"
    picture.file_format, picture.color_depth = "OPEN_EXR_MULTILAYER", "32"
    picture.exr_codec, picture.color_management = "NONE", "FOLLOW_SCENE"
    for name, value in {**_CYCLES, **cycles}.items():
        if hasattr(copy.cycles, name):
            setattr(copy.cycles, name, value)
    for layer in list(copy.view_layers):
        if layer.name != own_layer:
            copy.view_layers.remove(layer)
    layer = copy.view_layers[0]
    layer.name, layer.use, layer.samples = LAYER, True, 0
    for name in [p.identifier for p in layer.bl_rna.properties]:
        if name.startswith("use_pass_"):
            setattr(layer, name, name[len("use_pass_") :] in passes)
    layer.cycles.denoising_store_passes = False
    for aov in list(layer.aovs):
        layer.aovs.remove(aov)


def render_channels(copy, idle, what):
    """Every channel of a render of a copy.

    Parameters
    ----------
    copy, idle : bpy.types.Scene
        See `copied_scene`.
    what : str
        What is rendered, for messages.

    Returns
    -------
    dict of str -> (height, width) float32
        By "LAYER.pass.channel", first row on top.

    Raises
    ------
    PRTError
        Something renders already, or Cycles did not render.
    """
    if is_rendering():
        raise PRTError(f"{what}: a render is under way; wait for its end")
    with tempfile.TemporaryDirectory(prefix="prt-passes-") as folder:
        path = Path(folder) / "passes.exr"
        copy.render.filepath = str(path)
        try:
            with no_handlers(), no_output(), reading(copy, idle), context_of(idle):
                bpy.ops.render.render(write_still=True, scene=copy.name)
        except RuntimeError as error:
            reason = " ".join(str(error).split())
            raise PRTError(f"{what}: Cycles did not render them: {reason}") from error
        if not path.is_file():
            raise PRTError(
                f"{what}: Cycles did not render them; is a render running? "
                "Wait for its end, then try again"
            )
        return read_channels(path)
