"""K of any term from the rays of a bake, block by block, in the order in which they were cast."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from prt_core.bake import BakeSettings, bake_steps, gather_terms, load, visibility
from prt_core.errors import PRTError
from prt_core.runtime.progress import run
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import Scene
from prt_core.store import BakeStore
from prt_core.transport import gather_operator, ray_ends
from prt_core.transport.gather import REPRESENTED, cosine_directions
from tests.meshes import plane, sphere, wall

SETTINGS = BakeSettings(resolution=5, tolerance=0.05, seed=11)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    """Of several blocks of points."""
    path = tmp_path_factory.mktemp("terms") / "a.prt"
    meshes = [plane(7, -1, 1), wall(0.8, 0.9, 1.0), sphere(5, 0.3, (0, 0, 0.5))]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(visibility, "BLOCK", 32)
        run(bake_steps(Scene.from_meshes(meshes, max_hidden=30), path, SETTINGS))
        yield load(path)


def upward(block, directions):
    return directions[None, :, :, 2].clip(0)


def test_terms_that_weigh_one_are_the_k_of_the_bake(bake):
    store, n_points = BakeStore(bake.path), len(bake.scene.points)
    blocked = store.read("blocked")
    assert n_points > 3 * 32

    def ones(block, directions):
        return np.ones((2, *directions.shape[:2]), np.float32)

    for result in gather_terms(bake, ones, np.stack([blocked, blocked])):
        assert (result.data == bake.transport.gather.data).all()
        assert (result.indices == bake.transport.gather.indices).all()
        assert (result.indptr == bake.transport.gather.indptr).all()
    plain = gather_operator(store.read("gather"), n_points)
    for result in gather_terms(bake, ones):
        assert (result != plain).nnz == 0


def test_rays_come_with_the_directions_in_which_they_were_cast(bake):
    """Each ray that met the floor or the wall ended where its direction leads from its point."""
    points, n_points = bake.scene.points, len(bake.scene.points)
    hits = BakeStore(bake.path).read("gather")
    seen, along = np.zeros(n_points, int), []

    def weigh(block, directions):
        seen[block] += 1
        assert directions.shape == (block.stop - block.start, hits.shape[1], 3)
        assert directions.dtype == np.float32
        ends = ray_ends(hits[block])
        cast = hits[block] > REPRESENTED
        towards = points.positions[ends] - bake.scene.ray_origins[block][:, None]
        near = np.linalg.norm(towards, axis=-1)
        met = cast & (ends >= 0) & (near > 0.2)
        cosine = np.einsum("nrx,nrx->nr", directions, towards) / np.maximum(near, 1e-9)
        # The point that shares what was met lies within a cell of it.
        along.append(cosine[met])
        return np.stack([directions[..., 2].clip(0), directions[..., 0].clip(0)])

    first, second = gather_terms(bake, weigh)
    assert (seen == 1).all()
    along = np.concatenate(along)
    assert len(along) > 20 and np.median(along) > 0.97
    ends = ray_ends(hits)
    turns = hits.shape[1] // 32
    for x in (0, 40, n_points - 1):
        directions = directions_of(bake, x, turns)
        for term, axis in ((first, 2), (second, 0)):
            wanted = np.zeros(n_points)
            for end, direction in zip(ends[x], directions, strict=True):
                if end >= 0:
                    wanted[end] += max(direction[axis], 0) / len(directions)
            np.testing.assert_allclose(term[[x]].toarray()[0], wanted, rtol=1e-5, atol=1e-8)


def directions_of(bake, x, turns):
    """Those of one point, from the random shifts of its block."""
    start, parts = x // 32 * 32, []
    n = min(32, len(bake.scene.points) - start)
    for turn in range(turns):
        rng = generator(SETTINGS.seed, Stage.GATHER_SHIFT, turn % 2, start)
        shift = rng.random((n, 2), np.float32)[[x - start]]
        normal = bake.scene.points.normals[[x]]
        parts.append(cosine_directions(normal, shift, 32, turn // 2 * 32)[0])
    return np.concatenate(parts)


def test_a_term_is_scaled_by_its_own_share(bake):
    n_points = len(bake.scene.points)
    blocked = np.random.default_rng(1).uniform(0.2, 0.6, (3, n_points)).astype(np.float32)

    def weigh(block, directions):
        return np.repeat(upward(block, directions), 3, axis=0)

    result = gather_terms(bake, weigh, blocked)
    plain = gather_terms(bake, upward)[0]
    assert len(result) == 3
    sums = [np.asarray(k.sum(axis=1)).ravel() for k in result]
    unscaled = np.asarray(plain.sum(axis=1)).ravel()
    changed = [(s != unscaled) & (unscaled > 0) for s in sums]
    assert all(c.sum() > 30 for c in changed)
    both = changed[0] & changed[2]
    np.testing.assert_allclose(
        sums[0][both] / sums[2][both], (blocked[0] / blocked[2])[both], rtol=1e-5
    )


def test_what_cannot_be_weighed_is_said(bake, tmp_path):
    n_points = len(bake.scene.points)

    def said(match, bake=bake, weigh=upward, blocked=None):
        with pytest.raises(PRTError, match=match) as caught:
            gather_terms(bake, weigh, blocked)
        assert len(str(caught.value).splitlines()) == 1
        assert "damaged" not in str(caught.value)

    said("weigh: expected a function", weigh=3)
    said("weights: expected an array of shape \\(n, 32, ", weigh=lambda b, d: d[..., 2])
    said("weights: expected an array of shape", weigh=lambda b, d: d[None, :, 1:, 2])
    said(
        "weights: 1 values are NaN", weigh=lambda b, d: np.where(d[None, ..., 2] < 9, one_nan(d), 1)
    )
    said("weights: expected values from 0", weigh=lambda b, d: d[None, ..., 2] - 5)
    said("weights: expected those of 1 terms", weigh=lambda b, d: upward(b, d)[:0])
    said("weights: expected those of 2 terms", blocked=np.ones((2, n_points), np.float32))
    said("blocked: expected an array of shape", blocked=np.ones((1, n_points - 1), np.float32))
    said("bake: expected a Bake", bake="a.prt")
    other = tmp_path / "b.prt"
    shutil.copytree(bake.path, other)
    copy = load(other)
    seeded = replace(SETTINGS, seed=12)
    first, *rest = (
        Scene.from_meshes([plane(7), ball(*where)], max_hidden=0)
        for where in ((1, 0), (1.1, 0), (1, 0.1))
    )
    run(bake_steps(first, other, SETTINGS, restart=True))
    said("replaced since it was loaded; load it again", bake=copy)
    copy = load(other)
    for scene, settings in (*((scene, SETTINGS) for scene in rest), (first, seeded)):
        run(bake_steps(scene, other, settings, restart=True))
        assert len(load(other).scene.points) == len(copy.scene.points)
        said("replaced since it was loaded; load it again", bake=copy)
    run(bake_steps(Scene.from_meshes([plane(3)]), other, SETTINGS, restart=True))
    said("has no bounce rays", bake=load(other))
    copy.path = None
    said("expected one that was loaded", bake=copy)


def ball(height, tilt):
    """So far above the plane that there is no place in between that needs points of its own."""
    mesh = sphere(5, 0.3, (0, 0, height))
    mesh.corner_normal = mesh.corner_normal + [0, tilt, 0]
    return mesh


def one_nan(directions):
    weights = np.ones((1, *directions.shape[:2]))
    weights[0, 1, 2] = np.nan
    return weights


def test_a_damaged_ray_is_said_to_be_the_bakes(bake, tmp_path):
    path = tmp_path / "c.prt"
    shutil.copytree(bake.path, path)
    copy = load(path)
    store = BakeStore(path, "r+")
    hits = store.read("gather")
    hits[3, 5] = len(bake.scene.points)
    store.array("gather")[...] = hits
    with pytest.raises(
        PRTError, match="c.prt: a ray ends at a point that does not exist; 'gather'"
    ):
        gather_terms(copy, upward)
    hits[3, 5] = 0
    store.array("gather")[...] = hits
    with pytest.raises(PRTError, match="'gather' is not what the bake was finished with"):
        gather_terms(copy, upward)
