import shutil

import numpy as np
import pytest

from prt_core import BakeSettings, BakeStore, PRTError, Scene, bake_steps, load, run
from prt_core.compress import (
    PCA,
    ClusteredPCA,
    HaarLighting,
    Harmonics,
    TransportRows,
    VectorQuantisation,
    neighbour_pairs,
)
from prt_core.store import (
    compressed_attributes,
    read_compressed,
    remove_compressed,
    write_compressed,
)
from tests.meshes import plane, sphere

LIGHT = np.random.default_rng(2).random((96, 3)).astype(np.float32)
KINDS = [PCA(3), VectorQuantisation(9), ClusteredPCA(4, 3), HaarLighting(40), Harmonics(3)]


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    ball = sphere(6, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(9, albedo=0.7)])
    run(bake_steps(scene, path, BakeSettings(resolution=4, tolerance=0.05)))
    return path


@pytest.fixture
def baked(original, tmp_path):
    return shutil.copytree(original, tmp_path / "a.prt")


@pytest.fixture(scope="module")
def rows(original):
    return run(TransportRows(load(original).transport, 20).prepare_steps())


def keep(path, model, **attributes):
    for _ in write_compressed(BakeStore(path, "a"), model.state(), attributes):
        pass


def kept(path, kind):
    store = BakeStore(path)
    return kind.from_state(read_compressed(store, compressed_attributes(store)))


def folder_of(path):
    return compressed_attributes(BakeStore(path))["folder"]


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: type(k).__name__)
def test_what_is_read_relights_bit_by_bit(baked, rows, kind):
    before = BakeStore(baked).nbytes()
    model = kind.fit(rows)
    keep(baked, model, method="some")
    result = kept(baked, type(kind))
    np.testing.assert_array_equal(result.product(LIGHT), model.product(LIGHT))
    assert result.nbytes == model.nbytes and result.get_params() == model.get_params()
    assert compressed_attributes(BakeStore(baked))["method"] == "some"
    load(baked)
    assert remove_compressed(BakeStore(baked, "a"))
    assert not remove_compressed(BakeStore(baked, "a"))
    assert abs(BakeStore(baked).nbytes() - before) < 100


def test_a_form_that_holds_the_albedo_is_read_without_it(baked, rows):
    """Forms of before held the albedo, as a gain; it is the bake's."""
    model = Harmonics(2).fit(rows)
    state = {**model.state(), "gain": np.full((model.n_points_, 3), 0.3, np.float32)}
    for _ in write_compressed(BakeStore(baked, "a"), state, {}):
        pass
    np.testing.assert_array_equal(kept(baked, Harmonics).product(LIGHT), model.product(LIGHT))
    assert "gain" not in model.state()


def test_blended_borders_are_kept(baked, rows):
    points = load(baked).scene.points
    pairs = neighbour_pairs(points.positions, points.normals, points.object_index)
    model = ClusteredPCA(4, 2).fit(rows).blend_borders(rows, pairs)
    assert len(model.border_points_)
    keep(baked, model)
    result = kept(baked, ClusteredPCA)
    np.testing.assert_array_equal(result.product(LIGHT), model.product(LIGHT))


def test_a_kill_leaves_the_old_form_or_the_new(baked, rows, monkeypatch):
    old, new = ClusteredPCA(3, 2).fit(rows), PCA(2).fit(rows)
    keep(baked, old)
    for killed_after in (1, 2):
        steps = write_compressed(BakeStore(baked, "a"), new.state(), {})
        for _ in range(killed_after):
            next(steps)
        steps.close()
        assert len(list(baked.glob("compressed*"))) == killed_after
        # Killed outright, in the middle of a file.
        (baked / f"compressed9{killed_after}" / "half").mkdir(parents=True, exist_ok=True)
        half = baked / f"compressed9{killed_after}" / "half" / "zarr.json"
        half.write_text('{"zarr_')
        np.testing.assert_array_equal(kept(baked, ClusteredPCA).product(LIGHT), old.product(LIGHT))
        load(baked)
    keep(baked, new)
    np.testing.assert_array_equal(kept(baked, PCA).product(LIGHT), new.product(LIGHT))
    assert [p.name for p in baked.glob("compressed*")] == [folder_of(baked)]
    # Killed after the switch, before the old folder went.
    monkeypatch.setattr(BakeStore, "remove", lambda *_: None)
    keep(baked, old)
    assert len(list(baked.glob("compressed*"))) == 2
    np.testing.assert_array_equal(kept(baked, ClusteredPCA).product(LIGHT), old.product(LIGHT))


@pytest.mark.parametrize("ahead", [0, 1, 3])
def test_of_two_at_once_the_first_stays(baked, rows, ahead):
    """However much of the second is written when the first ends; nothing else is left of it."""
    one, two = ClusteredPCA(3, 2).fit(rows), PCA(2).fit(rows)
    stores = [BakeStore(baked, "a") for _ in range(2)]
    first, second = (
        write_compressed(store, model.state(), {})
        for store, model in zip(stores, (one, two), strict=True)
    )
    next(first)
    for _ in range(ahead):
        next(second)
    for _ in first:
        pass
    with pytest.raises(PRTError, match="was compressed by another program meanwhile"):
        for _ in second:
            pass
    np.testing.assert_array_equal(kept(baked, ClusteredPCA).product(LIGHT), one.product(LIGHT))
    assert [p.name for p in baked.glob("compressed*")] == [folder_of(baked)]


def _replace(name, change):
    def damage(path):
        store = BakeStore(path, "a")
        name_there = f"{folder_of(path)}/{name}"
        built = store.write(name_there, change(store.read(name_there)))
        # As if by somebody who knows how the store is sealed.
        attributes = store.attributes["compressed"]
        arrays = {**attributes["arrays"], name: built.digest()}
        store.update(compressed={**attributes, "arrays": arrays})

    return damage


def _attributes(**changes):
    def damage(path):
        store = BakeStore(path, "a")
        store.update(compressed={**store.attributes["compressed"], **changes})

    return damage


def _flip(path):
    chunk = path / folder_of(path) / "weights" / "c" / "0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(bytes(data))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_flip, "'weights' of its compressed form cannot be read"),
        (_replace("bases", lambda a: a[:-1]), "'bases' is "),
        (_replace("means", lambda a: a.astype(np.float64)), "'means' is "),
        (_replace("order", lambda a: a + 10**6), "'order' holds what it cannot"),
        (_replace("labels", lambda a: a - 1), "'labels' holds what it cannot"),
        (_replace("weights", lambda a: a * np.nan), "'weights' holds what it cannot"),
        (_replace("ranks", lambda a: a * 0 - 5), "clusters do not fit"),
        (_replace("code_ranks", lambda a: a - 7), "code"),
        (lambda p: shutil.rmtree(p / folder_of(p) / "means"), "'means' of its compressed"),
        (_attributes(folder="../x"), "is said of its compressed form is damaged"),
        (_attributes(arrays={"../labels": ""}), "is said of its compressed form is damaged"),
        (_attributes(values={}), "'params' is wrong"),
        (_attributes(arrays={}), "is missing"),
    ],
)
def test_damage_gives_one_clear_line(baked, rows, damage, message):
    keep(baked, ClusteredPCA(3, 2).fit(rows))
    damage(baked)
    with pytest.raises(PRTError, match=message) as caught:
        kept(baked, ClusteredPCA)
    assert "\n" not in str(caught.value)


def test_damaged_columns_are_refused(rows):
    model = HaarLighting(20).fit(rows)
    state = model.state()
    for name, change in (("indptr0", lambda a: a[::-1].copy()), ("indices0", lambda a: a - 1)):
        with pytest.raises(PRTError, match="compressed form"):
            HaarLighting.from_state({**state, name: change(state[name])})


def test_links_are_refused(baked, rows, tmp_path):
    keep(baked, ClusteredPCA(3, 2).fit(rows))
    folder = baked / folder_of(baked)
    shutil.move(folder, tmp_path / "outside")
    folder.symlink_to(tmp_path / "outside")
    with pytest.raises(PRTError, match="symbolic link"):
        load(baked)
