"""Lobes at directions of each place, against those of the materials."""

import numpy as np
import pytest

from prt_core.reflectance import Materials, principled_lobes
from prt_core.relight.point_lobes import PointLobes
from prt_core.relight.sampled_lobes import SampledLobes, local
from prt_core.sphere import sobol_points, square_to_cosine


def lacquered(roughness, anisotropy=0.0, n=6):
    """Metal below a coat, and ways to viewers from straight above to grazing."""
    metal = np.tile([0.9, 0.6, 0.3], (n, 1))
    materials = Materials(
        albedo=0 * metal, metal=metal, roughness=np.full((n, 1), roughness),
        anisotropy=np.full((n, 1), anisotropy), tangent=np.tile([1.0, 0, 0], (n, 1)),
        coat=np.full((n, 1), 0.6), coat_roughness=np.full((n, 1), 0.2),
        coat_ior=np.full((n, 1), 1.5),
    )  # fmt: skip
    height, turn = np.linspace(1, 0.05, n), np.linspace(0, 3, n)
    flat = np.sqrt(1 - height**2)
    view = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    return materials, view.astype(np.float32)


def towards(materials, view):
    lobes = PointLobes(materials, np.tile([0.0, 0, 1], (len(view), 1)))
    return SampledLobes(lobes.at(np.arange(len(view)), view[:, 2])[0], view)


@pytest.mark.parametrize("roughness, anisotropy", [(0.15, 0), (0.5, 0), (0.4, 0.8)])
def test_they_reflect_what_lobes_of_materials_do(roughness, anisotropy):
    materials, view = lacquered(roughness, anisotropy)
    ways = np.tile(square_to_cosine(sobol_points(8)), (len(view), 1, 1))
    # Also close to the mirror direction, where they are bright.
    ways[:, :16] = view[:, None] * [-1, -1, 1] + np.linspace(-0.1, 0.1, 16)[:, None]
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    light = np.random.default_rng(0).random(ways.shape)
    wanted = (principled_lobes(materials).eval(ways, view[:, None].astype(float)) * light).sum(1)
    shown = towards(materials, view).at(ways.astype(np.float32)).reflected(light.astype(np.float32))
    # Views that graze see curves of the coat that are fitted.
    np.testing.assert_allclose(shown[:-1], wanted[:-1], rtol=0.02)
    np.testing.assert_allclose(shown[-1], wanted[-1], rtol=0.1)


@pytest.mark.parametrize("roughness, anisotropy", [(0.3, 0), (0.5, 0.8)])
def test_samples_fall_as_densely_as_they_say(roughness, anisotropy):
    lobes = towards(*lacquered(roughness, anisotropy))
    ways = lobes.sample(np.tile(sobol_points(12), (6, 1, 1)))
    # The mean over samples of a function by their density is its integral: the half sphere.
    density = lobes.at(ways).density
    where = (ways[..., 2] > 0) & (density > 0)
    cap = where & (ways[..., 2] > 0.2)
    area = (cap / np.where(where, density, 1)).mean(axis=1)
    np.testing.assert_allclose(area[:4], 2 * np.pi * 0.8, rtol=0.2)
    even = np.tile(square_to_cosine(sobol_points(14)), (6, 1, 1)).astype(np.float32)
    below = (ways[..., 2] <= 0).mean(axis=1)
    whole = (lobes.at(even).density / (even[..., 2] / np.float32(np.pi))).mean(axis=1)
    np.testing.assert_allclose(whole[:5], 1 - below[:5], atol=0.05)


def test_the_bound_of_their_density_holds():
    lobes = towards(*lacquered(0.3, 0.6))
    rng = np.random.default_rng(1)
    axis = rng.normal(size=(6, 3)) * [1, 1, 0.5] + [0, 0, 0.6]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    around = axis[:, None] + 0.3 * rng.uniform(-1, 1, (6, 500, 3))
    around /= np.linalg.norm(around, axis=-1, keepdims=True)
    angle = np.arccos(np.einsum("kmx,kx->km", around, axis).min(axis=1))
    most = lobes.density_within(axis, angle)
    density = lobes.at(around.astype(np.float32)).density
    assert (density.max(axis=1) <= 1.001 * most).all() and (most < 1e3 * density.max(axis=1)).all()


def test_directions_in_frames_lie_component_by_component():
    frames = np.linalg.qr(np.random.default_rng(2).normal(size=(5, 3, 3)))[0]
    ways = np.random.default_rng(3).normal(size=(5, 4, 3))
    result = local(ways, frames)
    np.testing.assert_allclose(result, np.einsum("kmx,knx->kmn", ways, frames), atol=1e-6)
    assert result[..., 0].flags.c_contiguous and result.dtype == np.float32
