"""Small renders by Cycles in a scene of their own, read back as arrays; the user's scene stays."""

import tempfile
from contextlib import contextmanager
from pathlib import Path

import bpy

from prt_core.blender.casters import mark_temporary
from prt_core.blender.node_trees import numbers_of
from prt_core.blender.operator_context import context_of
from prt_core.blender.passes.traces import no_handlers, no_output
from prt_core.blender.render_scene import is_rendering, rendered_layer, rendered_world
from prt_core.errors import PRTError, expect
from prt_core.light import read_image

_RESULT = "Render Result"


class SmallRender:
    """A scene that is removed again with all that was made for it; see `small_render`."""

    def __init__(self):
        self._blocks = []
        self.scene = self.keep(bpy.data.scenes.new("prt render"))

    def keep(self, block):
        """Note a data-block that was made, so that it is removed at the end."""
        mark_temporary(block)
        self._blocks.append(block)
        return block

    def add(self, data, matrix=None):
        """An object of `data` in the scene, at a 4 x 4 matrix."""
        item = self.keep(bpy.data.objects.new("prt render", data))
        self.scene.collection.objects.link(item)
        if matrix is not None:
            item.matrix_world = matrix
        return item

    def add_camera(self, matrix, **settings):
        """The camera that the scene is seen from."""
        data = self.keep(bpy.data.cameras.new("prt render"))
        for name, value in settings.items():
            # Until 4.5 Cycles keeps what is a panorama's to itself.
            owner = data if hasattr(data, name) else data.cycles
            setattr(owner, name, value)
        self.scene.camera = self.add(data, matrix)
        return self.scene.camera

    def pixels(self, width, height, samples):
        """What the camera sees: (height, width, 3) float32, linear, first row on top.

        Parameters
        ----------
        width, height : int
            At least 4.
        samples : int
            Of a pixel, whose square they fill evenly.
        """
        render = self.scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        self.scene.cycles.samples = samples
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "render.exr"
            render.filepath = str(path)
            # The operator evaluates the scene that it is called from as well.
            with no_handlers(), no_output(), context_of(self.scene):
                bpy.ops.render.render(scene=self.scene.name, write_still=True)
            expect(path.is_file(), "Cycles: its render was stopped")
            pixels = read_image(path)
        expect(
            pixels.shape[:2] == (height, width),
            f"Cycles: expected a picture of {width} x {height}, got {pixels.shape[:2][::-1]}",
        )
        return pixels

    def remove(self):
        """Remove every data-block that was made."""
        bpy.data.batch_remove(self._blocks)
        self._blocks = []


@contextmanager
def small_render(like=None):
    """A `SmallRender` for as long as it lasts.

    Parameters
    ----------
    like : bpy.types.Scene, optional
        Whose frame it is, whose custom properties nodes find, and whose OSL scripts run where they
        do in its renders.

    Raises
    ------
    PRTError
        Cycles is switched off, or renders already.
    """
    if is_rendering():
        raise PRTError("Cycles: a render is under way; wait for its end")
    had_result = _RESULT in bpy.data.images
    render = SmallRender()
    try:
        _prepare(render.scene, like)
        yield render
    finally:
        render.remove()
        if not had_result and _RESULT in bpy.data.images:
            bpy.data.images.remove(bpy.data.images[_RESULT])


def layer_numbers(scene):
    """{name: value} of what Attribute nodes find by the view layer of a scene that is baked."""
    return numbers_of(rendered_world(scene), scene, rendered_layer(scene)[0])


def _prepare(scene, like):
    try:
        scene.render.engine = "CYCLES"
    except TypeError as error:
        raise PRTError(
            "Cycles: it is switched off; switch the add-on 'Cycles Render Engine' on in the "
            "preferences"
        ) from error
    cycles, render = scene.cycles, scene.render
    if like is not None:
        scene.frame_current, scene.frame_subframe = like.frame_current, like.frame_subframe
        cycles.shading_system = like.cycles.shading_system
        for name, value in layer_numbers(like).items():
            scene.view_layers[0][name] = value
    cycles.device, cycles.use_denoising, cycles.use_adaptive_sampling = "CPU", False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = cycles.max_bounces = 0
    cycles.pixel_filter_type, cycles.film_exposure = "BOX", 1
    render.use_compositing = render.use_sequencer = render.use_motion_blur = False
    render.film_transparent = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth, render.image_settings.color_mode = "32", "RGB"
