"""Whole light fields from renders by Cycles: a custom camera sends pixels to (point, direction).

Whatever Cycles has is in them: any material, caustics, all bounces. Each block of points is one
picture, of a copy of the scene; of the user's own nothing stays changed, and between two renders
there is nothing of ours in the file. A picture may be rendered in bands: Cycles draws the random
numbers of a pixel by its place in the whole picture, so that the bits are the same. What a pixel
has met is known from its position: where rounding let a ray miss its point, the nearest direction
that did meet it stands in.
"""

import hashlib
import tempfile
from contextlib import ExitStack
from pathlib import Path

import bpy
import numpy as np
from scipy.ndimage import distance_transform_edt

from prt_core.blender.casters import mark_temporary, remove_blocks
from prt_core.blender.colours import ACTIVE_BEFORE
from prt_core.blender.compat import custom_camera_missing
from prt_core.blender.covers import covers_of
from prt_core.blender.denoising import denoised
from prt_core.blender.identity import objects_by_place, scene_of
from prt_core.blender.light_field_shader import MOST_POINTS, shader_source
from prt_core.blender.light_groups import group_names, grouped_lights
from prt_core.blender.operator_context import context_of
from prt_core.blender.passes.traces import same_images, switched
from prt_core.blender.quiet_render import LAYER, SEEN, copied_scene, render_channels, settle
from prt_core.blender.stand_ins import originals_render, rendered_objects, stands_in
from prt_core.errors import PRTError, expect
from prt_core.runtime.progress import DearPace, Pace, Progress, run

_WHAT = "light field"
# Tiles in a row of the picture make it about as wide as high, up to so many pixels.
_WIDEST = 4096
_NEAR, _FAR = 1e-6, 1e9
# Paths of the first band, until the speed is known.
_FIRST_PATHS = 1 << 14


def expect_custom_camera():
    """Raise `PRTError` where this Blender has no cameras that are shaders."""
    missing = custom_camera_missing()
    expect(
        missing is None,
        f"{_WHAT}: {missing}, or bake with 'prt bake' and take the field of that bake: "
        "'prt lightfield bake NAME.prt'",
    )


class LightFieldCamera:
    """Radiance of points towards all directions, of one scene.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : sequence of (str, str)
        Name and library of the objects that the points are of.
    lights : sequence of Light
        See `light_groups.lights_of`: a field of each; none: one field of them all.

    Raises
    ------
    PRTError
        This Blender has no custom cameras, or the scene cannot be rendered as a copy.
    """

    name = "cycles"
    most_points = MOST_POINTS

    def __init__(self, scene, objects, lights=()):
        expect_custom_camera()
        expect(
            scene.rigidbody_world is None,
            f"scene '{scene.name}': its rigid bodies would begin anew in a copy; bake them to "
            "keyframes (Object > Rigid Body > Bake To Keyframes)",
        )
        self._uid, self._objects, self._lights = scene.session_uid, list(objects), tuple(lights)
        self._pace = None

    @property
    def lights(self):
        """Names of the lights that there is a field of; empty where there is one of all."""
        return tuple(light.name for light in self._lights)

    def shoot(self, points, angles, samples, seed, spread=1.0):
        """Radiance of points from all directions.

        Parameters
        ----------
        points : FieldPoints
            At most `most_points`.
        angles : (int, int)
            Rows and columns of the hemisphere's square.
        samples : int
            Of each direction, spread over its cell.
        seed : int
            Of Cycles, 31 bits.
        spread : float
            Share of its cell that a direction is spread over, 0 to 1: 0 is its middle alone.

        Returns
        -------
        radiance : (max(n_lights, 1), n, rows, columns, 3) float32
            Linear Rec.709.
        missed : (n,) float32
            Share of the directions from which something else than the point was met.
        apart : float
            How far the sum of the lights' fields is from the field of all, as a share of its
            largest value.
        """
        return run(self.shoot_steps(points, angles, samples, seed, spread))

    def shoot_steps(self, points, angles, samples, seed, spread=1.0, seconds=None):
        """`shoot` as a generator of `Progress`, in paths, which returns what it does.

        Parameters
        ----------
        seconds : float, optional
            That a render should take; more where the scene's own preparation does. Results do not
            depend on it. Default: all in one render.
        """
        tiles, bands = _Tiles(len(points), angles), []
        source = shader_source(points, tiles.across, tiles.down, angles, spread)
        row = tiles.across * tiles.columns * samples
        paths = tiles.down * tiles.rows * row
        pace = self._pace_of(seconds)
        for part in pace.parts(0, paths, row):
            band = slice(part.start // row, part.stop // row)
            bands.append(self._render(source, tiles, band, samples, seed))
            pace.worked()
            yield Progress(_WHAT, part.stop, paths)
        channels = {name: np.concatenate([band[name] for band in bands]) for name in bands[0]}
        return self._result(points, tiles, channels)

    def _pace_of(self, seconds):
        """How much is rendered at once: what one shot has shown holds for the next."""
        if seconds is None:
            return Pace()
        if self._pace is None:
            self._pace = DearPace(seconds, _FIRST_PATHS)
        return self._pace

    def _render(self, source, tiles, band, samples, seed):
        """Channels of a band of a picture's rows, counted from the top."""
        with ExitStack() as stack:
            scene = scene_of(self._uid)
            copy, idle = self._open(stack, scene, samples, seed)
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="prt-field-"))
            # A change of the camera's shader asks the engine of the scene it is made in for more.
            with context_of(idle):
                self._add_camera(stack, copy, _compiled(Path(folder), source))
            _show_band(copy.render, tiles, band)
            return render_channels(copy, idle, _WHAT)

    def _result(self, points, tiles, channels):
        """What `shoot` returns, of the channels of a whole picture."""
        whole = tiles.read(channels, "Combined", "RGB")
        missed = _missed(points, tiles.read(channels, "Position", "XYZ"))
        if self._lights:
            names = group_names(self._lights)
            parts = [tiles.read(channels, f"Combined_{name}", "RGB") for name in names]
            radiance = np.stack(parts)
            scale = max(float(np.abs(whole).max(initial=0)), 1e-30)
            apart = float(np.abs(radiance.sum(axis=0) - whole).max(initial=0)) / scale
        else:
            radiance, apart = whole[None], 0.0
        expect(
            np.isfinite(radiance).all(),
            f"{_WHAT}: Cycles gave radiance that is no number; a material divides by zero",
        )
        return _filled(radiance, missed), missed.mean(axis=(1, 2), dtype=np.float32), apart

    def denoise(self, radiance, points, samples):
        """Radiance of `shoot` without its noise.

        Parameters
        ----------
        radiance : (n_lights, n, rows, columns, 3) float32
        points : FieldPoints
        samples : int

        Returns
        -------
        (n_lights, n, rows, columns, 3) float32
        """
        tiles = _Tiles(len(points), radiance.shape[2:4])
        normals = np.broadcast_to(
            points.frames[:, None, None, 2], (*radiance.shape[1:4], 3)
        ).astype(np.float32)
        pictures = np.stack([tiles.picture(light) for light in radiance])
        clean = denoised(pictures, tiles.picture(normals), samples)
        return np.stack([tiles.tables(picture) for picture in np.maximum(clean, 0)])

    def _open(self, stack, scene, samples, seed):
        """The copy that is rendered, and an idle scene."""
        stack.enter_context(same_images())
        stack.enter_context(originals_render(scene))
        every = objects_by_place()
        for place in self._objects:
            item = every.get(place)
            expect(item is not None, f"{_WHAT}: the object '{place[0]}' was removed meanwhile")
            for name, value in SEEN.items():
                stack.enter_context(switched(item, name, value))
        _without_previews(stack, scene)
        copy, idle = stack.enter_context(copied_scene(scene, "prt light field"))
        settle(copy, scene, _WHAT, {"combined", "position"}, {"samples": samples, "seed": seed})
        copy.cycles.light_sampling_threshold = 0
        copy.render.film_transparent = False
        # Also of what is transparent the first surface is meant.
        copy.view_layers[0].pass_alpha_threshold = 0
        stack.enter_context(grouped_lights(copy, self._lights))
        return copy, idle

    def _add_camera(self, stack, copy, shader):
        data = bpy.data.cameras.new("prt light field")
        made = [data]
        stack.callback(remove_blocks, made)
        mark_temporary(data)
        item = bpy.data.objects.new("prt light field", data)
        made.append(item)
        mark_temporary(item)
        copy.collection.objects.link(item)
        copy.camera = item
        data.clip_start, data.clip_end = _NEAR, _FAR
        data.type, data.custom_mode = "CUSTOM", "EXTERNAL"
        data.custom_filepath = str(shader)


def _show_band(render, tiles, band):
    """Have a picture of tiles rendered, or a band of its rows."""
    width, height = tiles.across * tiles.columns, tiles.down * tiles.rows
    render.resolution_x, render.resolution_y = width, height
    if band.stop - band.start < height:
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_max_x = 0.0, 1.0
        # From below, and rounded down to whole pixels.
        render.border_min_y = (height - band.stop + 0.5) / height
        render.border_max_y = min((height - band.start + 0.5) / height, 1.0)


def _without_previews(stack, scene):
    """While the stack lasts, a scene renders as if no preview were shown and nothing kept."""
    rendered = rendered_objects(scene)
    for item in scene.objects:
        if stands_in(item, rendered):
            stack.enter_context(switched(item, "hide_render", True))
        for modifier in covers_of(item):
            stack.enter_context(switched(modifier, "show_render", False))
        before = item.data.get(ACTIVE_BEFORE) if item.data is not None else None
        if before is not None:
            stack.enter_context(switched(item.data.attributes, "default_color_name", before))


class _Tiles:
    """How points lie in a picture: a tile each, in reading order."""

    def __init__(self, count, angles):
        self.count, (self.rows, self.columns) = count, angles
        across = int(np.ceil(np.sqrt(count * self.rows / self.columns)))
        self.across = max(1, min(across, count, max(1, _WIDEST // self.columns)))
        # Cycles renders no picture of fewer than four pixels a side.
        self.across = max(self.across, -(-4 // self.columns))
        self.down = max(-(-count // self.across), -(-4 // self.rows))

    def read(self, channels, name, axes):
        """(count, rows, columns, 3) float32 of a pass."""
        try:
            planes = [channels[f"{LAYER}.{name}.{axis}"] for axis in axes]
        except KeyError as error:
            raise PRTError(f"{_WHAT}: Cycles gave no pass {error}") from error
        return self.tables(np.stack(planes, axis=-1))

    def tables(self, picture):
        """(count, rows, columns, 3) float32 of a picture."""
        picture = picture.reshape(self.down, self.rows, self.across, self.columns, 3)
        tiles = picture.transpose(0, 2, 1, 3, 4).reshape(-1, self.rows, self.columns, 3)
        return np.ascontiguousarray(tiles[: self.count], np.float32)

    def picture(self, tables):
        """The picture of tables: undo `tables`; the last stands in where there are no more."""
        which = np.minimum(np.arange(self.down * self.across), self.count - 1)
        tiles = tables[which].reshape(self.down, self.across, self.rows, self.columns, 3)
        return tiles.transpose(0, 2, 1, 3, 4).reshape(
            self.down * self.rows, self.across * self.columns, 3
        )


def _compiled(folder, source):
    """The path of a compiled shader: its name tells it from those of other blocks."""
    from _cycles import osl_compile

    name = f"prt_light_field_{hashlib.blake2b(source.encode(), digest_size=8).hexdigest()}"
    text, compiled = folder / f"{name}.osl", folder / f"{name}.oso"
    text.write_text(source)
    expect(
        osl_compile(str(text), str(compiled)) and compiled.is_file(),
        f"{_WHAT}: Blender cannot compile the camera's shader; its build lacks parts of OSL",
    )
    return compiled


def _missed(points, hits):
    """(n, rows, columns) bool: directions from which something else was met."""
    apart = hits - points.positions[:, None, None].astype(np.float32)
    return ~(np.linalg.norm(apart, axis=-1) <= points.reach[:, None, None])


def _filled(radiance, missed):
    """Radiance in which the nearest direction stands in for each that missed its point."""
    for n in np.flatnonzero(missed.any(axis=(1, 2)) & ~missed.all(axis=(1, 2))):
        nearest = distance_transform_edt(missed[n], return_distances=False, return_indices=True)
        radiance[:, n] = radiance[:, n][:, nearest[0], nearest[1]]
    return radiance
