"""What a .glb holds is what the bake shows: read back by a reader of its own."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import GLBSettings, PRTError, export_glb, relight, run
from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.load import load
from prt_core.export.glb import glb_steps
from prt_core.scene import Mesh, Scene
from tests.gltf import Glb
from tests.meshes import glowing, plane, sphere

N_DIRECTIONS = 96
RNG = np.random.default_rng(7)
# A concave outline, counter-clockwise from above.
OUTLINE = np.array([[0, 0], [0.6, 0], [0.6, 0.2], [0.2, 0.2], [0.2, 0.5], [0, 0.5]])


def prism(name, matrix, **settings):
    """An L of six sides, each with a UV island of its own, and a lid of another material."""
    n = len(OUTLINE)
    low, high = (np.column_stack([OUTLINE, np.full(n, z)]) for z in (0.0, 0.3))
    faces = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)] + [list(range(n, 2 * n))]
    triangles = [[4 * i + a for a in t] for i in range(n) for t in ((0, 1, 2), (0, 2, 3))]
    lid = [(0, 1, 3), (1, 2, 3), (0, 3, 5), (3, 4, 5)]
    triangles = np.array(triangles + [[4 * n + a for a in t] for t in lid])
    corner_vertex = np.concatenate(faces)
    local = np.concatenate([low, high])
    sizes = np.array([len(face) for face in faces])
    uv = np.concatenate(
        [[[i / n, 0], [(i + 1) / n, 0], [(i + 1) / n, 0.5], [i / n, 0.5]] for i in range(n)]
        + [OUTLINE + [0, 0.5]]
    )
    material = np.repeat([0] * n + [1], sizes)
    albedo = np.where(material[:, None] == 0, [0.6, 0.3, 0.1], [0.1, 0.2, 0.7])
    linear = matrix[:3, :3]
    normal = np.repeat(
        [np.cross(*(local[f[k]] - local[f[0]] for k in (1, 2))) for f in faces], sizes, axis=0
    ) @ np.linalg.inv(linear)
    mirrored = np.linalg.det(linear) < 0
    return Mesh(
        name,
        local @ linear.T + matrix[:3, 3],
        corner_vertex,
        normal / np.linalg.norm(normal, axis=1, keepdims=True),
        triangles[:, ::-1] if mirrored else triangles,
        albedo,
        corner_material=material,
        material_names=("wände/1", "Deckel"),
        face_sizes=sizes,
        corner_uv=uv,
        matrix=matrix,
        **settings,
    )


def placed(translation, angle=0.0, scale=(1, 1, 1), shear=0.0):
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    turn = turn @ np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    matrix[:3, :3] = turn @ np.diag(scale) @ np.array([[1, shear, 0], [0, 1, 0], [0, 0, 1]])
    matrix[:3, 3] = translation
    return matrix


MATRICES = {
    "L": placed((-0.8, -0.8, 0.3)),
    "own/L": placed((0.2, 0.3, 0.4), 1.0, (1, 1, 1)),
    "spiegel": placed((0.6, -0.8, 0.3), 2.0, (-1, 1, 1)),
    "gross": placed((-0.7, 0.5, 0.3), 0.5, (0.5, 2, 1.5), shear=0.3),
}


def bake_of(meshes, path, **settings):
    scene = Scene.from_meshes(meshes, max_hidden=20)
    run(bake_steps(scene, path, BakeSettings(resolution=4, **settings)))
    return load(path)


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glb")
    meshes = [prism(name, matrix) for name, matrix in MATRICES.items()]
    meshes += [
        plane(4, albedo=(0.5, 0.4, 0.3), name="Boden"),
        sphere(5, 0.2, (0, 0, 0.5), name="ball"),
        plane(2, name="caster", z=2.0, receives=False),
    ]
    return bake_of(meshes, folder / "a.prt")


@pytest.fixture(scope="module")
def light():
    return (1 + RNG.random((N_DIRECTIONS, 3)) * 5).astype(np.float32)


@pytest.fixture(scope="module")
def read(baked, light, tmp_path_factory):
    path = tmp_path_factory.mktemp("read") / "a.glb"
    report = export_glb(baked, path, light)
    return Glb(path), report


def receivers(bake):
    return [item for item in bake.scene.objects if item.receives]


def test_corners_of_triangles_show_the_colours_of_the_bake(baked, light, read):
    glb, report = read
    colours = relight(baked, light)
    brightest = max(values.max() for values in colours.values())
    assert set(glb.nodes) == set(colours) and report["objects"] == len(colours)
    first_vertex = 0
    for item in baked.scene.objects:
        vertices = baked.scene.vertices[first_vertex : first_vertex + item.n_vertices]
        first_vertex += item.n_vertices
        if not item.receives:
            continue
        corners = item.parts.triangle_corners
        order = np.argsort(item.parts.corner_material[corners[:, 0]], kind="stable")
        corners = corners[order]
        place, normal, radiance, uv = glb.corners(item.name)
        world = baked.scene.to_world(vertices)[item.corner_vertex[corners]]
        np.testing.assert_allclose(place, world, atol=2e-6)
        expected = colours[item.name][corners]
        assert np.abs(radiance - expected).max() <= 1e-6 * brightest
        points = item.corner_point[corners]
        np.testing.assert_allclose(normal, baked.scene.points.normals[points], atol=1e-5)
        if item.parts.corner_uv is None:
            assert uv is None
        else:
            kept = item.parts.corner_uv[corners]
            np.testing.assert_allclose(uv, kept * [1, -1] + [0, 1], atol=1e-6)
        # Seen from where normals point, triangles go round counter-clockwise.
        a, b, c = np.moveaxis(place, 1, 0)
        assert (np.einsum("tx,tx->t", np.cross(b - a, c - a), normal.mean(axis=1)) > 0).all()


def test_colour_0_times_its_scale_is_the_radiance(read):
    glb, report = read
    scale = glb.json["extras"]["PRT"]["scale"]
    assert scale == report["scale"] > 1
    for name in glb.nodes:
        assert glb.json["meshes"][glb.nodes[name]["mesh"]]["extras"]["prt_scale"] == scale
        for attributes, _, material in glb.primitives(name):
            np.testing.assert_allclose(
                attributes["COLOR_0"] * scale, attributes["_PRT_RADIANCE"], rtol=1e-6
            )
            assert material["pbrMetallicRoughness"]["baseColorFactor"] == [1, 1, 1, 1]
            assert material["extensions"] == {"KHR_materials_unlit": {}}


def test_vertices_are_split_where_corners_differ_and_nowhere_else(baked, read):
    glb, _ = read
    names = {item.name: item for item in baked.scene.objects}
    # A smooth ball and a flat floor have one point a vertex; an L has one a corner.
    for name, count in (("ball", names["ball"].n_vertices), ("Boden", 16)):
        (part,) = glb.primitives(name)
        assert len(part[0]["POSITION"]) == count
    walls, lid = glb.primitives("L")
    assert (len(walls[0]["POSITION"]), len(lid[0]["POSITION"])) == (24, 6)
    assert [part[2]["name"] for part in (walls, lid)] == ["wände/1", "Deckel"]
    assert sum("wände/1" == m["name"] for m in glb.json["materials"]) == 1


def test_a_seam_of_the_uv_map_splits_a_smooth_vertex(light, tmp_path):
    mesh = plane(3)
    place = mesh.vertices[mesh.corner_vertex, :2]
    cut = np.repeat(np.arange(4) % 2, 4)
    seamed = replace(mesh, corner_uv=place + cut[:, None] * 5.0)
    bake = bake_of([seamed], tmp_path / "a.prt")
    assert bake.scene.points.visible.sum() == 9
    export_glb(bake, tmp_path / "a.glb", light)
    (part,) = Glb(tmp_path / "a.glb").primitives("plane")
    assert len(part[0]["POSITION"]) == 12


def test_instances_share_all_but_their_colours(read):
    glb, _ = read

    def accessors(name, key):
        mesh = glb.json["meshes"][glb.nodes[name]["mesh"]]
        return [part["attributes"].get(key, part.get(key)) for part in mesh["primitives"]]

    for key in ("POSITION", "NORMAL", "TEXCOORD_0", "indices"):
        for name in ("own/L", "spiegel"):
            assert accessors(name, key) == accessors("L", key), key
        if key in ("POSITION", "NORMAL"):
            # What a node cannot say stays in the vertices.
            assert accessors("gross", key) != accessors("L", key)
    assert accessors("own/L", "COLOR_0") != accessors("L", "COLOR_0")
    assert np.prod(glb.nodes["spiegel"]["scale"]) < 0


def test_equal_colours_make_equal_meshes(tmp_path):
    # One over the other, turned by nothing and lit alike.
    far = placed((0, 0, 0))
    meshes = [replace(prism(name, far), name=name) for name in ("a", "b")]
    bake = bake_of(meshes, tmp_path / "a.prt", bounces=0)
    radiance = np.ones((bake.transport.n_points, 3), np.float32)
    report = run(glb_steps(bake, tmp_path / "a.glb", radiance))
    assert (report["objects"], report["meshes"]) == (2, 1)
    nodes = Glb(tmp_path / "a.glb").nodes
    assert nodes["a"]["mesh"] == nodes["b"]["mesh"]


def test_sixteen_bits_and_white_are_said(baked, light, tmp_path):
    report = export_glb(baked, tmp_path / "a.glb", light, encoding="u16", white=2.0)
    glb, cut = Glb(tmp_path / "a.glb"), 0
    for name in glb.nodes:
        for attributes, _, _ in glb.primitives(name):
            true = attributes["_PRT_RADIANCE"]
            assert attributes["COLOR_0"].shape == (len(true), 4)
            expected = np.minimum(true / 2, 1)
            assert np.abs(attributes["COLOR_0"][:, :3] - expected).max() <= 0.5 / 65535 + 1e-7
            cut += (true > 2).any(axis=1).sum()
    assert cut and f"{cut:,} colours are brighter than 2 and cut in COLOR_0" in report["notes"]


def test_bright_suns_and_dark_scenes_keep_their_colours(baked, tmp_path):
    sun = np.zeros((N_DIRECTIONS, 3), np.float32)
    sun[-40] = 1e5
    for light, scale in ((sun, None), (sun * 1e-9, 1.0)):
        export_glb(baked, tmp_path / "a.glb", light)
        glb, colours = Glb(tmp_path / "a.glb"), relight(baked, light)
        said = glb.json["extras"]["PRT"]["scale"]
        assert scale == said if scale else said > 1e3
        (part,) = glb.primitives("Boden")
        assert np.isclose(part[0]["COLOR_0"].max() * said, colours["Boden"].max(), rtol=1e-6)


def test_multiplied_materials_times_light_are_what_surfaces_send_out(baked, light, tmp_path):
    export_glb(baked, tmp_path / "a.glb", light, material="multiplied", exposure=1.0)
    glb = Glb(tmp_path / "a.glb")
    assert glb.json["extras"]["PRT"]["colours"] == "light"
    colours = relight(baked, light, exposure=1.0)
    for item in receivers(baked):
        corners = item.parts.triangle_corners
        order = np.argsort(item.parts.corner_material[corners[:, 0]], kind="stable")
        shown = [
            attributes["_PRT_RADIANCE"][triangles if item.name != "spiegel" else triangles[:, ::-1]]
            * material["pbrMetallicRoughness"]["baseColorFactor"][:3]
            for attributes, triangles, material in glb.primitives(item.name)
        ]
        expected = colours[item.name][corners[order]]
        np.testing.assert_allclose(np.concatenate(shown), expected, rtol=2e-5, atol=1e-6)


def test_albedo_that_varies_is_left_to_the_texture_of_the_user(light, tmp_path):
    mesh = plane(3)
    albedo = np.where(mesh.vertices[mesh.corner_vertex, :1] < 0, 0.2, 0.8).repeat(3, axis=1)
    glow = glowing(replace(mesh, materials=albedo), (3.0, 2.0, 1.0))
    bake = bake_of([glow], tmp_path / "a.prt")
    report = export_glb(bake, tmp_path / "a.glb", light, material="multiplied")
    (part,) = Glb(tmp_path / "a.glb").primitives("plane")
    assert part[2]["pbrMetallicRoughness"]["baseColorFactor"] == [1, 1, 1, 1]
    assert report["notes"] == ["plane: base colour differs from place to place and is not written"]
    # An open floor receives what the sky sends, whatever its own colour, and not what it emits.
    received = part[0]["_PRT_RADIANCE"]
    np.testing.assert_allclose(received, np.broadcast_to(received[0], received.shape), rtol=1e-5)
    assert received.max() < 6


def test_what_lets_light_through_is_blended(light, tmp_path):
    mesh = plane(3, name="pane")
    pane = replace(mesh, materials=mesh.materials.replaced(opacity=np.full((16, 1), 0.25)))
    bake = bake_of([pane, plane(3, z=-1.0)], tmp_path / "a.prt")
    export_glb(bake, tmp_path / "a.glb", light)
    (part,) = Glb(tmp_path / "a.glb").primitives("pane")
    assert part[2]["alphaMode"] == "BLEND"
    assert np.isclose(part[2]["pbrMetallicRoughness"]["baseColorFactor"][3], 0.25, atol=1e-3)
    # A quarter of these colours is what the pane sends of all the light that it receives.
    _, _, radiance, _ = Glb(tmp_path / "a.glb").corners("pane")
    sent = relight(bake, light)["pane"][bake.scene.objects[0].parts.triangle_corners]
    np.testing.assert_allclose(radiance * 0.25, sent, rtol=1e-5)


def test_bakes_of_before_are_written_without_what_they_do_not_have(baked, light, tmp_path):
    objects = [replace(item, parts=None) for item in baked.scene.objects]
    old = replace(baked, scene=replace(baked.scene, objects=objects))
    report = export_glb(old, tmp_path / "a.glb", light)
    assert "kept no UV maps" in " ".join(report["notes"])
    glb, colours = Glb(tmp_path / "a.glb"), relight(baked, light)
    for item in receivers(baked):
        place, _, radiance, uv = glb.corners(item.name)
        corners = item.parts.triangle_corners
        assert uv is None and not {"translation", "rotation", "scale"} & set(glb.nodes[item.name])
        expected = colours[item.name][corners]
        assert np.abs(radiance - expected).max() <= 1e-6 * expected.max()
        assert [m["name"] for _, _, m in glb.primitives(item.name)] == [item.name]


def test_colours_that_are_no_numbers_are_refused_by_name(baked, tmp_path):
    radiance = np.ones((baked.transport.n_points, 3), np.float32)
    bad = baked.scene.objects[1].corner_point[3]
    radiance[bad] = np.inf
    with pytest.raises(PRTError, match="^own/L: 1 of its colours are NaN or infinite"):
        run(glb_steps(baked, tmp_path / "a.glb", radiance))
    assert not (tmp_path / "a.glb").exists()


def test_a_failed_write_leaves_what_was_there(baked, light, tmp_path, monkeypatch):
    (tmp_path / "a.glb").write_bytes(b"before")

    def full(self, path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(PRTError, match="no space left on device; free some space"):
        export_glb(baked, tmp_path / "a.glb", light)
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]
    assert (tmp_path / "a.glb").read_bytes() == b"before"


def test_objects_that_do_not_receive_are_left_out_and_said(read):
    glb, report = read
    assert "caster" not in glb.nodes
    assert report["notes"] == ["1 objects receive no colours and are not written"]


def test_settings_say_what_is_wrong():
    with pytest.raises(PRTError, match="would have it twice"):
        GLBSettings(material="multiplied", colours="albedo")
    with pytest.raises(PRTError, match="white: expected a number above 0"):
        GLBSettings(white=0)
    assert GLBSettings(material="multiplied").of_light
    assert not GLBSettings().of_light and GLBSettings(colours="light").of_light
