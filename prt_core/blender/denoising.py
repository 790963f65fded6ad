"""Pictures denoised by Open Image Denoise, through Cycles' denoiser of files.

Cycles denoises but the sum of all light while it renders. Its operator for files takes any layers
that have what it asks for: so the light of each lamp is a layer. It wants albedo, normals, depth
and motion as well; albedo and motion are the same everywhere, what is one surface has one normal.
It works as the scene of its context asks for, which is one of our own: what the user's renders are
denoised like changes nothing, and guides without noise are not denoised themselves.
"""

import tempfile
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.casters import mark_temporary, remove_blocks
from prt_core.blender.operator_context import context_of
from prt_core.blender.passes.openexr import read_channels, write_channels
from prt_core.blender.passes.traces import no_output
from prt_core.errors import PRTError, expect

_NAME = "prt{}"
_SETTINGS = {
    "use_denoising": True,
    "denoiser": "OPENIMAGEDENOISE",
    "denoising_input_passes": "RGB_ALBEDO_NORMAL",
    "denoising_prefilter": "NONE",
    "denoising_quality": "HIGH",
    "denoising_use_gpu": False,
}


def denoised(pictures, normals, samples):
    """Pictures without their noise.

    Parameters
    ----------
    pictures : (n, height, width, 3) float32
        Linear, of the same places.
    normals : (height, width, 3) float32
        What tells places apart: edges of it are kept.
    samples : int
        Of each pixel.

    Returns
    -------
    (n, height, width, 3) float32

    Raises
    ------
    PRTError
        This Blender has no denoiser, or it failed.
    """
    channels, texts = {}, {}
    ones, zeros = np.ones(normals.shape[:2], np.float32), np.zeros(normals.shape[:2], np.float32)
    for number, picture in enumerate(pictures):
        layer = _NAME.format(number)
        for axis, name in enumerate("RGB"):
            channels[f"{layer}.Combined.{name}"] = picture[..., axis]
            channels[f"{layer}.Noisy Image.{name}"] = picture[..., axis]
            channels[f"{layer}.Denoising Albedo.{name}"] = ones
            channels[f"{layer}.Denoising Normal.{'XYZ'[axis]}"] = normals[..., axis]
        channels[f"{layer}.Combined.A"] = channels[f"{layer}.Denoising Depth.Z"] = ones
        channels |= {f"{layer}.Vector.{axis}": zeros for axis in "XYZW"}
        texts[f"cycles.{layer}.samples"] = str(samples)
    with tempfile.TemporaryDirectory(prefix="prt-denoise-") as folder:
        noisy, clean = Path(folder) / "noisy.exr", Path(folder) / "clean.exr"
        write_channels(noisy, channels, texts)
        try:
            with no_output(), _settled():
                bpy.ops.cycles.denoise_animation(
                    input_filepath=str(noisy), output_filepath=str(clean)
                )
        except (RuntimeError, AttributeError) as error:
            reason = " ".join(str(error).split())
            raise PRTError(f"denoising: Cycles cannot do it ({reason}); leave it out") from error
        expect(clean.is_file(), "denoising: Cycles wrote nothing; leave it out")
        found = read_channels(clean)
    planes = [
        [found[f"{_NAME.format(number)}.Combined.{name}"] for name in "RGB"]
        for number in range(len(pictures))
    ]
    return np.moveaxis(np.array(planes, np.float32), 1, -1)


@contextmanager
def _settled():
    """A context of a scene that is denoised as we ask for."""
    scene = bpy.data.scenes.new("prt denoise")
    try:
        mark_temporary(scene)
        for name, value in _SETTINGS.items():
            if hasattr(scene.cycles, name):
                setattr(scene.cycles, name, value)
        with context_of(scene):
            yield
    finally:
        remove_blocks([scene])
