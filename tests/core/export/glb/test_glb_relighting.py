"""What an engine relights from: weights and harmonics of a .glb against the bake itself."""

import numpy as np
import pytest

from prt_core import PRTError, compress, export_glb, relight_points
from prt_core.basis import harmonics
from prt_core.compress import Harmonics
from prt_core.compress.rows import TransportRows
from prt_core.export.glb.clusters import ClusterWeights
from prt_core.export.glb.geometry import Geometry
from prt_core.light import EnvironmentMap, Lamp
from prt_core.relight.environments import Environments
from prt_core.relight.forms import load_compressed
from prt_core.relight.lighting import Lighting
from prt_core.scene import Scene
from tests.core.export.glb.test_glb_files import bake_of
from tests.gltf import TO_BLENDER, Glb
from tests.meshes import plane, sphere, wall

RNG = np.random.default_rng(3)


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    meshes = [
        plane(7, albedo=(0.7, 0.5, 0.3)),
        wall(0.9, 1.0, 1.0, 5, albedo=(0.2, 0.6, 0.8)),
        sphere(6, 0.3, (0, 0, 0.5)),
    ]
    path = tmp_path_factory.mktemp("weights") / "a.prt"
    bake = bake_of(meshes, path)
    compress(path, method="cpca:n_clusters=4,n_components=7")
    return bake


@pytest.fixture(scope="module")
def sky():
    """Dim below, bright and coloured at one side."""
    pixels = RNG.random((16, 32, 3)).astype(np.float32)
    pixels[:8, :6] += [4, 2, 1]
    return EnvironmentMap(pixels)


def vertices(glb):
    """Arrays of all vertices of a file, by the names of attributes."""
    parts = [attributes for name in glb.nodes for attributes, _, _ in glb.primitives(name)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def products(glb, light):
    """What an engine makes of light on the texels of a file: (clusters, rows, 3)."""
    said, total = glb.json["extras"]["PRT"]["weights"], 0
    for group in said["groups"]:
        rows = glb.array(group["rows"]).reshape(group["count"], said["texels"])
        each = (rows @ light) * glb.array(group["scale"])[:, None]
        if "mix" in group:
            each = glb.array(group["mix"]).reshape(-1, group["count"]) @ each
        total = total + each * group["shares"]
    return total.reshape(said["clusters"], 1 + said["components"], 3)


def relit(glb, products):
    """Radiance of all vertices by their weights."""
    of, said = vertices(glb), glb.json["extras"]["PRT"]["weights"]
    weights = np.hstack([of[name] for name in said["attributes"]])[:, : said["components"]]
    mine = products[of["_PRT_CLUSTER"].astype(int)]
    return of.get("_PRT_ALBEDO", 1) * (mine[:, 0] + np.einsum("vk,vkc->vc", weights, mine[:, 1:]))


def without_borders(bake, light):
    """Radiance of points by their own cluster alone, as the compressed form has it."""
    form, _ = load_compressed(bake)
    form.model.border_points_ = form.model.border_points_[:0]
    form.model.shares_ = form.model.shares_[:0]
    return bake.transport.exit_radiance(form.model.product(light)).toward()


def points_of(bake):
    """The bake point of each vertex of a file."""
    geometry = Geometry(bake.scene)
    parts = [geometry.surfaces(number)[1] for number in range(len(bake.scene.objects))]
    return np.concatenate([surface.points for part in parts for surface in part])


def test_weights_times_the_light_are_the_compressed_form(baked, sky, tmp_path):
    report = export_glb(baked, tmp_path / "a.glb", sky, rotation=40, strength=2, weights=True)
    glb = Glb(tmp_path / "a.glb")
    said, of = glb.json["extras"]["PRT"]["weights"], points_of(baked)
    assert (said["clusters"], said["components"], said["texels"]) == (4, 7, 96)
    assert report["notes"] == []
    # The light of the file, and any other, on the directions that the file gives.
    lighting = Lighting(sky, rotation=40, strength=2)
    own = Environments(baked).on_texels(lighting)
    directions = glb.array(said["directions"]) @ TO_BLENDER.T
    np.testing.assert_allclose(directions, baked.cube_map.directions, atol=1e-6)
    other = RNG.random((96, 3)).astype(np.float32)
    for light in (own, other):
        truth = without_borders(baked, light)[of]
        ours = relit(glb, products(glb, light))
        assert np.abs(ours - truth).max() < 2e-4 * truth.max()
    stored = glb.array(said["products"]).reshape(4, 8, 3)
    np.testing.assert_allclose(stored, products(glb, own), rtol=1e-3, atol=1e-4 * stored.max())


def test_fewer_components_and_texels_are_nearer_the_more_there_are(baked, sky, tmp_path):
    truth, errors = relight_points(baked, sky), {}
    for components, texels in ((1, 4), (7, 1), (7, 4)):
        report = export_glb(
            baked, tmp_path / "a.glb", sky, weights=True, components=components, texels=texels
        )
        glb = Glb(tmp_path / "a.glb")
        said = glb.json["extras"]["PRT"]["weights"]
        assert said["texels"] == 6 * texels**2 and len(said["attributes"]) == -(-components // 4)
        stored = glb.array(said["products"]).reshape(said["clusters"], -1, 3)
        error = relit(glb, stored) - truth[points_of(baked)]
        errors[components, texels] = np.linalg.norm(error) / np.linalg.norm(truth)
        cut = "1 components are written, the form has more"
        assert (cut in report["notes"]) == (components == 1)
    assert errors[7, 4] < 0.05 and errors[7, 4] < min(errors[1, 4], errors[7, 1])


def test_weights_of_light_leave_the_colour_to_the_material(baked, sky, tmp_path):
    export_glb(baked, tmp_path / "a.glb", sky, weights=True, material="multiplied")
    glb = Glb(tmp_path / "a.glb")
    of = vertices(glb)
    assert "_PRT_ALBEDO" not in of
    said = glb.json["extras"]["PRT"]["weights"]
    stored = glb.array(said["products"]).reshape(said["clusters"], -1, 3)
    error = relit(glb, stored) - of["_PRT_RADIANCE"]
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(of["_PRT_RADIANCE"])


def test_points_at_borders_have_the_weights_of_their_own_cluster(baked):
    form, _ = load_compressed(baked)
    assert len(form.model.border_points_)
    ours = ClusterWeights(form, 7)
    for point in form.model.border_points_[:5, 0]:
        affine = form.model.affine_[ours.cluster[point]]
        slot = form.model.place_[point] - form.model.starts_[ours.cluster[point]]
        np.testing.assert_array_equal(
            ours.weights[point, : len(affine.basis)], affine.weights[slot]
        )


def test_nine_harmonics_are_those_of_the_bake(baked, sky, tmp_path):
    export_glb(baked, tmp_path / "a.glb", sky, rotation=70, exposure=1, harmonics=True)
    glb = Glb(tmp_path / "a.glb")
    said, of = glb.json["extras"]["PRT"]["harmonics"], vertices(glb)
    values = np.stack([of[name] for name in said["attributes"]], axis=1)
    ours = np.einsum("vkc,kc->vc", values, said["light"])
    model = Harmonics(3).fit(TransportRows(baked.transport))
    light = 2 * Environments(baked).on_texels(Lighting(sky, rotation=70))
    received = model.product(light.astype(np.float32))
    truth = baked.transport.exit_radiance(received).toward()[points_of(baked)]
    assert np.linalg.norm(ours - truth) < 2e-3 * np.linalg.norm(truth)


def test_the_functions_that_a_file_names_are_harmonics_of_its_own_axes(baked, sky, tmp_path):
    export_glb(baked, tmp_path / "a.glb", sky, harmonics=True)
    said = Glb(tmp_path / "a.glb").json["extras"]["PRT"]["harmonics"]
    directions = RNG.normal(size=(9, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = directions.T
    values = [eval(text, {"x": x, "y": y, "z": z}) * np.ones(9) for text in said["functions"]]
    np.testing.assert_allclose(np.stack(values, axis=1), harmonics(directions, 3), atol=1e-7)
    # What an engine projects of its own environment, in glTF's axes, are the file's coefficients.
    cube = baked.cube_map
    texels = cube.directions @ TO_BLENDER  # Blender's directions, seen in glTF's axes
    light = Environments(baked).on_texels(Lighting(sky)) * cube.solid_angles[:, None]
    np.testing.assert_allclose(harmonics(texels, 3).T @ light, said["light"], rtol=0.1, atol=0.3)


def test_what_does_not_relight_is_said(baked, sky, tmp_path):
    lamp = Lamp("point", (5, 5, 5), (0, 0, 2))
    light = Lighting(lamps=[lamp])
    report = export_glb(
        baked, tmp_path / "a.glb", light, harmonics=True, weights=True, caster="brute"
    )
    said = Glb(tmp_path / "a.glb").json["extras"]["PRT"]
    assert said["harmonics"]["light"] is None and said["weights"]["products"] is None
    assert "lamps and sharp suns are in the colours, not in what relights" in report["notes"]


def test_weights_need_a_form_of_clusters(sky, tmp_path):
    bake = bake_of([plane(3)], tmp_path / "a.prt")
    assert isinstance(bake.scene, Scene)
    with pytest.raises(PRTError, match="weights: there is no compressed form"):
        export_glb(bake, tmp_path / "a.glb", sky, weights=True)
    compress(tmp_path / "a.prt", method="harmonics:order=2")
    with pytest.raises(PRTError, match="by harmonics, whose numbers are no weights"):
        export_glb(bake, tmp_path / "a.glb", sky, weights=True)
    compress(tmp_path / "a.prt", method="cpca:n_clusters=1,n_components=2")
    with pytest.raises(PRTError, match="texels: expected a divisor of the 4"):
        export_glb(bake, tmp_path / "a.glb", sky, weights=True, texels=3)
    with pytest.raises(PRTError, match="form: light without albedo is relit exactly"):
        export_glb(bake, tmp_path / "a.glb", sky, material="multiplied", form="compressed")
    assert not (tmp_path / "a.glb").exists()
