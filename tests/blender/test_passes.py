"""Any shader graph, at any place: as Cycles' own bake says."""

from collections import OrderedDict

import bpy
import numpy as np
import pytest

from prt_core.blender.depsgraph import read_meshes
from prt_core.blender.passes import surfaces
from prt_core.blender.passes.cryptomatte import name_number
from prt_core.blender.passes.openexr import read_channels
from prt_core.blender.passes.quantities import COLUMNS, quantities_of
from prt_core.errors import PRTError
from prt_core.reflectance.bump import bump_mean
from tests.blender.conftest import link_from_library


def grid(name="grid", size=(5, 3), location=(0.3, -0.2, 0.1)):
    """A bent grid with two UV maps, two colour attributes and others."""
    columns, rows = size
    mesh = bpy.data.meshes.new(name)
    x, y = np.linspace(-1, 1.5, columns + 1), np.linspace(-0.7, 0.8, rows + 1)
    places = [(a, b, 0.2 * a * b) for b in y for a in x]
    n = columns + 1
    faces = [(j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i)
             for j in range(rows) for i in range(columns)]  # fmt: skip
    mesh.from_pydata(places, [], faces)
    rng = np.random.default_rng(3)
    for number, layer in enumerate(("first", "second")):
        uv = mesh.uv_layers.new(name=layer)
        values = [(p[0] * 0.3 + 0.41, p[1] * 0.4 + 0.37 + number * 0.2) for p in places]
        uv.data.foreach_set("uv", np.float32([values[v] for f in faces for v in f]).ravel())
    mesh.uv_layers["second"].active_render = True
    for kind, domain, count in (
        ("paint", "CORNER", len(mesh.loops)),
        ("dots", "POINT", len(places)),
    ):
        data = mesh.color_attributes.new(kind, "FLOAT_COLOR", domain).data
        data.foreach_set("color", rng.random(count * 4, np.float32))
    data = mesh.attributes.new("level", "FLOAT", "FACE").data
    data.foreach_set("value", rng.random(len(faces)).astype(np.float32))
    item = bpy.data.objects.new(name, mesh)
    item.location, item.rotation_euler, item.scale = location, (0.2, 0.4, 0.9), (1.2, 0.7, 1)
    bpy.context.scene.collection.objects.link(item)
    return item


def material(item, build, name="m"):
    """A material of one node tree, whose Principled has no specular reflection."""
    new = bpy.data.materials.new(name)
    if new.node_tree is None:
        new.use_nodes = True
    tree = new.node_tree
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Specular IOR Level"].default_value = 0
    build(tree, shader)
    item.data.materials.append(new)
    return new


def add(tree, kind, **inputs):
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in inputs.items():
        socket = node.inputs[name]
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node


def picture(name="picture", size=(7, 5), seed=11, alpha=False):
    image = bpy.data.images.new(name, *size, alpha=True)
    pixels = np.random.default_rng(seed).random((size[1], size[0], 4), np.float32)
    if not alpha:
        pixels[..., 3] = 1
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def bake(item, kind):
    """(n_corners, 3) of Cycles' bake operator."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 1, "CPU"
    for other in bpy.context.view_layer.objects:
        other.select_set(other is item)
    bpy.context.view_layer.objects.active = item
    item.data.color_attributes.new("truth", "FLOAT_COLOR", "CORNER")
    item.data.color_attributes.active_color = item.data.color_attributes["truth"]
    options = {"pass_filter": {"COLOR"}} if kind == "DIFFUSE" else {}
    bpy.ops.object.bake(type=kind, target="VERTEX_COLORS", **options)
    data = item.data.color_attributes["truth"].data
    values = np.empty(len(data) * 4, np.float32)
    data.foreach_get("color", values)
    item.data.color_attributes.remove(item.data.color_attributes["truth"])
    return values.reshape(-1, 4)[:, :3]


def read(**options):
    messages = []
    meshes = {mesh.name: mesh for mesh in read_meshes(messages=messages, **options)}
    return meshes, messages


def base(node, output="Color"):
    """Builds a tree around the node that gives the base colour."""

    def build(tree, shader):
        built = node(tree)
        tree.links.new(built.outputs[output], shader.inputs["Base Color"])

    return build


def image_node(tree, vector=None, **settings):
    node = add(tree, "TexImage")
    node.image = picture()
    for name, value in settings.items():
        setattr(node, name, value)
    if vector is not None:
        tree.links.new(vector, node.inputs["Vector"])
    return node


def coordinates(tree, name):
    return add(tree, "TexCoord").outputs[name]


def grouped(tree, depth=2):
    """Noise inside a group inside a group."""
    group = bpy.data.node_groups.new(f"group {depth}", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    end = group.nodes.new("NodeGroupOutput")
    if depth == 1:
        node = group.nodes.new("ShaderNodeTexNoise")
    else:
        node = grouped(group, depth - 1)
    group.links.new(node.outputs["Color"], end.inputs[0])
    outer = tree.nodes.new("ShaderNodeGroup")
    outer.node_tree = group
    return outer


def ramp(tree):
    noise = add(tree, "TexNoise", Vector=coordinates(tree, "Generated"), Scale=2.3)
    node = add(tree, "ValToRGB", Fac=noise.outputs[0])
    node.color_ramp.elements[0].color = 0.7, 0.1, 0.05, 1
    node.color_ramp.elements[1].color = 0.1, 0.3, 0.9, 1
    return node


def gltf(tree):
    """A vertex colour times an image, as importers build it, with metal and roughness in one."""
    colour = add(tree, "VertexColor")
    colour.layer_name = "paint"
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    mix.inputs[0].default_value = 1
    tree.links.new(image_node(tree).outputs["Color"], mix.inputs[6])
    tree.links.new(colour.outputs["Color"], mix.inputs[7])
    parts = add(tree, "SeparateColor", Color=image_node(tree).outputs["Color"])
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(parts.outputs["Green"], shader.inputs["Roughness"])
    tree.links.new(mix.outputs[2], shader.inputs["Base Color"])


def curves(tree):
    node = add(tree, "RGBCurve", Color=ramp(tree).outputs["Color"])
    node.mapping.curves[3].points.new(0.3, 0.6)
    return node


def named(kind, name, output="Color"):
    def node(tree):
        built = add(tree, "Attribute" if kind == "Attribute" else kind)
        setattr(built, "attribute_name" if kind == "Attribute" else "layer_name", name)
        return built

    return base(node, output)


def object_coordinates(tree):
    return add(tree, "TexVoronoi", Vector=coordinates(tree, "Object"))


def other_object(tree):
    empty = bpy.data.objects.new("elsewhere", None)
    empty.location = 0.3, 0.4, -2
    bpy.context.scene.collection.objects.link(empty)
    node = add(tree, "TexCoord")
    node.object = empty
    return add(tree, "TexNoise", Vector=node.outputs["Object"])


def uv_of(name):
    def node(tree):
        layer = add(tree, "UVMap")
        layer.uv_map = name
        return image_node(tree, layer.outputs[0])

    return base(node)


def mapped(tree):
    mapping = add(tree, "Mapping", Vector=coordinates(tree, "UV"), Scale=(2, 3, 1))
    mapping.inputs["Rotation"].default_value[2] = 0.4
    return image_node(tree, mapping.outputs[0])


def tuned(tree):
    return add(tree, "HueSaturation", Color=ramp(tree).outputs["Color"], Hue=0.3, Saturation=1.4)


def brick(tree):
    return add(tree, "TexBrick", Vector=coordinates(tree, "Generated"), Scale=3.0)


def random_object(tree):
    return add(tree, "ValToRGB", Fac=add(tree, "ObjectInfo").outputs["Random"])


GRAPHS = {
    "without a link": lambda tree, shader: None,
    "group": base(grouped),
    "ramp of noise in generated coordinates": base(ramp),
    "curves": base(curves),
    "hue and saturation": base(tuned),
    "brick": base(brick),
    "object coordinates": base(object_coordinates),
    "coordinates of another object": base(other_object),
    "image": base(image_node),
    "image of the first UV map": uv_of("first"),
    "mapping": base(mapped),
    "vertex colours": named("VertexColor", "paint"),
    "vertex colours of points": named("VertexColor", "dots"),
    "attribute of faces": named("Attribute", "level", "Fac"),
    "attribute that is not there": named("Attribute", "nothing"),
    "as glTF is imported": lambda tree, shader: gltf(tree),
    "random of the object": base(random_object),
    "layer weight": base(lambda tree: add(tree, "LayerWeight", Blend=0.4), "Facing"),
    "backfacing": base(lambda tree: add(tree, "NewGeometry"), "Backfacing"),
    "light path": base(lambda tree: add(tree, "LightPath"), "Is Camera Ray"),
    "position": base(lambda tree: add(tree, "NewGeometry"), "Position"),
}


@pytest.mark.parametrize("name", GRAPHS)
def test_base_colours_are_those_of_the_bake(name):
    item = grid()
    material(item, GRAPHS[name])
    meshes, messages = read()
    albedo = meshes["grid"].materials.albedo
    wanted = bake(item, "DIFFUSE")
    if name in {"image", "image of the first UV map", "mapping", "brick", "layer weight"}:
        # A corner on an edge of colours belongs to either side.
        off = np.abs(albedo - wanted).max(axis=1) > 4e-3
        assert off.mean() < 0.1, np.flatnonzero(off)
    else:
        np.testing.assert_allclose(albedo, wanted, atol=4e-3)
    assert not any("did not see" in line for line in messages)


def test_emission_is_radiance_and_not_cut():
    item = grid()

    def build(tree, shader):
        noise = add(tree, "TexNoise", Vector=coordinates(tree, "Generated"))
        tree.links.new(noise.outputs["Color"], shader.inputs["Emission Color"])
        shader.inputs["Emission Strength"].default_value = 700

    material(item, build)
    meshes, _ = read()
    emission = meshes["grid"].materials.emission
    assert emission.max() > 300
    np.testing.assert_allclose(emission, bake(item, "EMIT"), rtol=4e-3, atol=0.1)


def plate(name, build, z=0.0, x=0.0):
    mesh = bpy.data.meshes.new(name)
    corners = [(x - 1, -1, z), (x + 1, -1, z), (x + 1, 1, z), (x - 1, 1, z)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", np.float32([0, 0, 1, 0, 1, 1, 0, 1]))
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    if build is not None:
        material(item, build, name)
    return item


def surface(node):
    """Builds a tree of one shader."""

    def build(tree, shader):
        tree.links.new(node(tree).outputs[0], tree.nodes["Material Output"].inputs["Surface"])

    return build


def principled(**inputs):
    def build(tree, shader):
        for name, value in inputs.items():
            shader.inputs[name.replace("_", " ")].default_value = value

    return build


def half_clear(tree):
    mix = add(tree, "MixShader", Fac=0.25)
    tree.links.new(add(tree, "BsdfTransparent").outputs[0], mix.inputs[1])
    tree.links.new(
        add(tree, "Emission", Color=(1, 0.5, 0.25, 1), Strength=8.0).outputs[0], mix.inputs[2]
    )
    return mix


def leaf(tree):
    mix = add(tree, "MixShader", Fac=0.5)
    colours = {"BsdfTranslucent": (0.2, 0.9, 0.3, 1), "BsdfDiffuse": (0.6, 0.4, 0.1, 1)}
    for number, (kind, colour) in enumerate(colours.items()):
        tree.links.new(add(tree, kind, Color=colour).outputs[0], mix.inputs[1 + number])
    return mix


def test_what_lets_light_through():
    """Above a shining floor, which must not show through what lies over it."""
    plate("floor", principled(Emission_Color=(1, 1, 1, 1), Emission_Strength=50.0), -0.5)
    plate("half", principled(Base_Color=(0.8, 0.4, 0.2, 1), Alpha=0.5))
    plate("clear", surface(lambda tree: add(tree, "BsdfTransparent")), 0.1)
    plate("glow", surface(half_clear), 0.2)
    plate("glass", surface(lambda tree: add(tree, "BsdfGlass", Color=(0.9, 0.6, 0.3, 1))), 0.3)
    plate("leaf", surface(leaf), 0.4)
    plate("metal", principled(Base_Color=(0.8, 0.4, 0.2, 1), Metallic=1.0), 0.5)
    plate("plastic", principled(Specular_IOR_Level=0.5), 0.6)
    plate(
        "diamond", principled(Base_Color=(0.8, 0.3, 0.2, 1), Specular_IOR_Level=0.5, IOR=2.4), 0.7
    )
    plate("half metal", principled(Base_Color=(0.8, 0.3, 0.2, 1), Metallic=0.5), 0.8)
    plate("iron", principled(Base_Color=(0.12, 0.12, 0.12, 1), Metallic=1.0), 0.9)
    plate("hole", surface(lambda tree: add(tree, "Holdout")), 1.0)
    meshes, messages = read()
    looks = {
        name: {k: v[0] for k, v in mesh.materials.arrays().items()} for name, mesh in meshes.items()
    }
    for mesh in meshes.values():
        for values in mesh.materials.arrays().values():
            np.testing.assert_allclose(values, values[:1].repeat(4, axis=0), atol=1e-3)
    wanted = {
        "floor": {"albedo": [0.8, 0.8, 0.8], "opacity": [1], "emission": [50, 50, 50]},
        "half": {"albedo": [0.4, 0.2, 0.1], "opacity": [0.5], "emission": [0, 0, 0]},
        "clear": {"albedo": [0, 0, 0], "opacity": [0], "emission": [0, 0, 0]},
        "glow": {"albedo": [0, 0, 0], "opacity": [0.25], "emission": [2, 1, 0.5]},
        "leaf": {"albedo": [0.3, 0.2, 0.05], "opacity": [1], "translucency": [0.1, 0.45, 0.15]},
        "metal": {"albedo": [0.786, 0.38, 0.187], "opacity": [1], "translucency": [0, 0, 0]},
        "plastic": {"albedo": [0.77, 0.77, 0.77], "opacity": [1]},
        "diamond": {"albedo": [0.673, 0.252, 0.168], "opacity": [1]},
        "half metal": {"albedo": [0.773, 0.29, 0.193], "opacity": [1]},
        "iron": {"albedo": [0.12, 0.12, 0.12], "opacity": [1]},
        "hole": {"albedo": [0, 0, 0], "opacity": [1]},
    }
    for name, quantities in wanted.items():
        for quantity, value in quantities.items():
            np.testing.assert_allclose(looks[name][quantity], value, atol=0.02, err_msg=name)
    assert 0.3 < looks["glass"]["opacity"][0] < 0.5
    for words in (
        ("'glass'", "thin"),
        ("'metal'", "specular"),
        ("'plastic'", "specular", "ignored"),
    ):
        assert any(all(word in line for word in words) for line in messages), words
    assert not any("did not see" in line for line in messages)
    assert not bpy.data.materials["leaf"].node_tree.nodes["Translucent BSDF"].mute


def test_light_path_nodes_tell_what_is_shown_from_what_is_met():
    """Glass that shadow rays pass, and a lamp that only the camera sees: as architects do."""

    def glass(tree):
        mix = add(tree, "MixShader", Fac=add(tree, "LightPath").outputs["Is Shadow Ray"])
        tree.links.new(add(tree, "BsdfDiffuse", Color=(0.1, 0.5, 0.2, 1)).outputs[0], mix.inputs[1])
        tree.links.new(add(tree, "BsdfTransparent").outputs[0], mix.inputs[2])
        return mix

    def lamp(tree):
        return add(tree, "Emission", Strength=add(tree, "LightPath").outputs["Is Camera Ray"])

    plate("window", surface(glass))
    plate("sign", surface(lamp), 1.0)
    links = {m.name: len(m.node_tree.links) for m in bpy.data.materials}
    nodes = {m.name: len(m.node_tree.nodes) for m in bpy.data.materials}
    meshes, messages = read()
    window, sign = meshes["window"], meshes["sign"]
    np.testing.assert_allclose(window.materials.albedo, [[0.1, 0.5, 0.2]] * 4, atol=1e-3)
    np.testing.assert_allclose(window.materials.opacity, 1, atol=1e-3)
    np.testing.assert_allclose(window.shadow.materials.opacity, 0, atol=1e-3)
    np.testing.assert_allclose(sign.materials.emission, 1, atol=1e-3)
    np.testing.assert_allclose(sign.bounced.materials.emission, 0, atol=1e-6)
    assert window.bounced is window.back is sign.back is sign.shadow is None
    # All of it is told apart exactly.
    assert not any("Light Path" in line for line in messages)
    for m in bpy.data.materials:
        assert (len(m.node_tree.links), len(m.node_tree.nodes)) == (links[m.name], nodes[m.name])
    sockets = {link.from_socket.name for link in bpy.data.materials["window"].node_tree.links}
    assert "Is Shadow Ray" in sockets


def test_light_path_nodes_of_linked_libraries_answer_as_well(tmp_path):
    def told_apart(tree):
        mix = add(tree, "MixShader", Fac=add(tree, "LightPath").outputs["Is Diffuse Ray"])
        for index, colour in ((1, (0.7, 0.1, 0.2, 1)), (2, (0, 0.3, 1, 1))):
            tree.links.new(add(tree, "BsdfDiffuse", Color=colour).outputs[0], mix.inputs[index])
        return mix

    def wires(tree):
        return sorted(
            (w.from_socket.name, w.to_node.name, w.to_socket.identifier) for w in tree.links
        )

    home = bpy.context.scene.collection
    item = link_from_library(plate("far", surface(told_apart)), tmp_path / "far.blend", home)
    tree = item.data.materials[0].node_tree
    before, n_nodes = wires(tree), len(tree.nodes)
    far = read()[0]["far"]
    np.testing.assert_allclose(far.materials.albedo, [[0.7, 0.1, 0.2]] * 4, atol=1e-3)
    np.testing.assert_allclose(far.bounced.materials.albedo, [[0, 0.3, 1]] * 4, atol=1e-3)
    assert wires(tree) == before and len(tree.nodes) == n_nodes


def test_between_two_texels_colours_change_as_the_file_encodes_them():
    image = bpy.data.images.new("steps", 4, 1)
    image.pixels.foreach_set(np.repeat(np.float32([0, 1, 1, 0]), 4))
    image.pack()

    def shown(tree):
        return add(tree, "TexImage", Vector=coordinates(tree, "UV"))

    def build(tree, shader):
        base(shown)(tree, shader)
        tree.nodes["Image Texture"].image = image

    item = plate("page", build)
    # From the middle of the first texel to that of the second.
    uv = np.float32([1 / 8, 0.5, 3 / 8, 0.5, 3 / 8, 0.5, 1 / 8, 0.5])
    item.data.uv_layers[0].data.foreach_set("uv", uv)
    paint = read()[0]["page"].paint
    halfway = paint.at(np.array([[0, 1, 2]]), np.array([[0.5, 0.5, 0]]))["albedo"][0]
    np.testing.assert_allclose(halfway, 0.214, atol=0.01)


def test_a_chequer_that_follows_the_mesh_is_not_blurred():
    """Where four checks meet the faces across are alike, those beside are not."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4, size=2)
    item = bpy.context.object
    item.name = "board"

    def checks(tree):
        return add(tree, "TexChecker", Vector=coordinates(tree, "UV"), Scale=4.0)

    material(item, base(checks))
    meshes, _ = read()
    albedo = meshes["board"].materials.albedo[:, 0].reshape(16, 4)
    np.testing.assert_allclose(np.ptp(albedo, axis=1), 0, atol=1e-3)
    np.testing.assert_allclose(np.ptp(albedo[:, 0]), 0.6, atol=1e-3)


def test_emission_that_cycles_mixes_of_two_kinds_of_rays_is_said():
    def glow(output):
        def build(tree):
            return add(tree, "Emission", Strength=add(tree, "LightPath").outputs[output])

        return surface(build)

    plate("fog lamp", glow("Is Diffuse Ray"))
    plate("sign", glow("Is Camera Ray"), 1.0)
    meshes, messages = read()
    np.testing.assert_allclose(meshes["fog lamp"].bounced.materials.emission, 1, atol=1e-3)
    np.testing.assert_allclose(meshes["fog lamp"].materials.emission, 0, atol=1e-6)
    said = [line for line in messages if "diffuse rays" in line]
    assert len(said) == 1 and "'fog lamp'" in said[0]


def sided(tree, front, back):
    mix = add(tree, "MixShader", Fac=add(tree, "NewGeometry").outputs["Backfacing"])
    for index, node in ((1, front), (2, back)):
        tree.links.new(node.outputs[0], mix.inputs[index])
    return mix


def test_backs_are_evaluated_where_nodes_tell_them_apart(monkeypatch):
    def two_colours(tree):
        red, blue = (
            add(tree, "BsdfDiffuse", Color=c) for c in ((0.7, 0.1, 0.2, 1), (0, 0.3, 1, 1))
        )
        return sided(tree, red, blue)

    def upwards(tree):
        return add(tree, "BsdfDiffuse", Color=add(tree, "NewGeometry").outputs["Normal"])

    def one_way(tree):
        return sided(tree, add(tree, "BsdfTransparent"), add(tree, "BsdfDiffuse"))

    plate("page", surface(two_colours))
    plate("roof", surface(upwards), 1.0)
    plate("mirror", surface(one_way), 2.0)
    plate("plain", surface(lambda tree: add(tree, "BsdfDiffuse")), 3.0)
    meshes, messages = read()
    page, roof = meshes["page"], meshes["roof"]
    np.testing.assert_allclose(page.materials.albedo, [[0.7, 0.1, 0.2]] * 4, atol=1e-3)
    np.testing.assert_allclose(page.back.materials.albedo, [[0, 0.3, 1]] * 4, atol=1e-3)
    np.testing.assert_allclose(roof.materials.albedo, [[0, 0, 1]] * 4, atol=1e-3)
    np.testing.assert_allclose(roof.back.materials.albedo, 0, atol=1e-3)
    assert all(mesh.bounced is None for mesh in meshes.values())
    assert meshes["plain"].back is None
    looked = "prt_core.blender.passes.probe.Probe.look"
    monkeypatch.setattr(looked, lambda *a, **k: 1 / 0)
    again, _ = read()
    assert again["page"].back.materials.equals(page.back.materials)


def test_sides_that_shadow_rays_tell_apart_are_said():
    def one_way(back):
        def build(tree):
            path = add(tree, "LightPath").outputs["Is Shadow Ray"]
            shadow = add(tree, "MixShader", Fac=path)
            diffuse = add(tree, "BsdfDiffuse")
            tree.links.new(diffuse.outputs[0], shadow.inputs[1])
            tree.links.new(add(tree, "BsdfTransparent").outputs[0], shadow.inputs[2])
            return sided(tree, shadow, diffuse) if back else shadow

        return surface(build)

    plate("one way", one_way(True))
    plate("both ways", one_way(False), 1.0)
    meshes, messages = read()
    np.testing.assert_allclose(meshes["one way"].shadow.materials.opacity, 0, atol=1e-3)
    said = [line for line in messages if "shadow rays" in line]
    assert said == ["material 'one way': Light Path: to shadow rays its back is as its front"]


def test_a_holdout_shader_is_black_and_said():
    plate("mask", surface(lambda tree: add(tree, "Holdout")))
    meshes, messages = read()
    np.testing.assert_allclose(meshes["mask"].materials.albedo, 0, atol=1e-3)
    np.testing.assert_allclose(meshes["mask"].materials.opacity, 1, atol=1e-3)
    assert any(line.startswith("material 'mask': a holdout is black") for line in messages)


def test_a_ray_portal_is_clear_and_said():
    plate("gate", surface(lambda tree: add(tree, "BsdfRayPortal")))
    meshes, messages = read()
    np.testing.assert_allclose(meshes["gate"].materials.opacity, 0, atol=1e-3)
    assert "material 'gate': a Ray Portal leads nowhere; light goes straight through it" in messages


def test_what_is_in_coordinates_of_the_camera_is_said():
    def matcap(tree):
        turned = add(tree, "VectorTransform", Vector=add(tree, "NewGeometry").outputs["Normal"])
        turned.convert_to = "CAMERA"
        return add(tree, "BsdfDiffuse", Color=turned.outputs[0])

    plate("matcap", surface(matcap))
    _, messages = read()
    assert any(line.startswith("material 'matcap': Layer Weight, Fresnel") for line in messages)


def test_what_depends_on_the_direction_of_view_is_said():
    def facing(tree):
        return add(tree, "BsdfDiffuse", Color=add(tree, "LayerWeight").outputs["Facing"])

    plate("silk", surface(facing))
    plate("felt", surface(lambda tree: add(tree, "BsdfDiffuse")), 1.0)
    said = [line for line in read()[1] if "Layer Weight" in line]
    assert len(said) == 1 and "'silk'" in said[0] and "'felt'" not in said[0]


def test_what_lies_in_one_plane_is_not_mixed_up():
    colours = {"red": (0.8, 0.1, 0.1), "green": (0.1, 0.8, 0.1), "blue": (0.1, 0.1, 0.8)}
    for number, (name, colour) in enumerate(colours.items()):
        plate(name, principled(Base_Color=(*colour, 1)), 0.0, 0.2 * number)
    bpy.data.objects["blue"].scale.z = -1
    meshes, messages = read()
    for name, colour in colours.items():
        np.testing.assert_allclose(meshes[name].materials.albedo, [colour] * 4, atol=2e-3)
    assert not any("did not see" in line for line in messages)


def test_instances_are_told_apart(monkeypatch):
    source = grid("source")
    material(source, base(random_object))
    collection = bpy.data.collections.new("box")
    bpy.context.scene.collection.objects.unlink(source)
    collection.objects.link(source)
    for number in range(3):
        empty = bpy.data.objects.new(f"copy {number}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location.x = 4 * number
        bpy.context.scene.collection.objects.link(empty)
    meshes, messages = read()
    greys = [mesh.materials.albedo[0, 0] for mesh in meshes.values()]
    assert len(meshes) == 3 and np.ptp(greys) > 0.05
    for mesh in meshes.values():
        np.testing.assert_allclose(mesh.materials.albedo, mesh.materials.albedo[:1].repeat(60, 0))
        # One material all over takes no room.
        assert mesh.materials.albedo.strides[0] == 0
    assert not any("did not see" in line for line in messages)
    # As if they had too many corners to be asked for together.
    monkeypatch.setattr(surfaces, "_TOGETHER", 1)
    monkeypatch.setattr(surfaces, "_KEPT", OrderedDict())
    apart, _ = read()
    assert {name: mesh.materials.albedo[0, 0] for name, mesh in apart.items()} == dict(
        zip(meshes, greys, strict=True)
    )


def test_rigid_bodies_are_looked_at_where_they_began():
    floor = plate("floor", principled(Base_Color=(0.1, 0.8, 0.1, 1)), -3)
    item = grid("falling", location=(0, 0, 3))
    material(item, base(ramp))
    wanted = read()[0]["falling"].materials.albedo
    bpy.context.view_layer.objects.active = item
    bpy.ops.rigidbody.world_add()
    bpy.ops.rigidbody.object_add(type="ACTIVE")
    for frame in range(1, 13):
        bpy.context.scene.frame_set(frame)
    meshes, messages = read()
    assert meshes["falling"].vertices[:, 2].max() < 3 and floor.location.z == 0
    np.testing.assert_allclose(meshes["falling"].materials.albedo, wanted, atol=4e-3)
    assert not any("did not see" in line for line in messages)


def test_a_normal_map_bends_shading_normals():
    def build(tree, shader):
        image = bpy.data.images.new("normals", 4, 4)
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.tile(np.float32([0.8, 0.5, 0.9, 1]), 16))
        node = add(tree, "TexImage")
        node.image = image
        bend = add(tree, "NormalMap", Color=node.outputs["Color"])
        tree.links.new(bend.outputs[0], shader.inputs["Normal"])

    plate("bent", build)
    plate("even", principled(), 0, 3)
    meshes, _ = read()
    np.testing.assert_allclose(meshes["bent"].corner_normal, [[0.6, 0, 0.8]] * 4, atol=0.01)
    strength = 0.125 * (0.6 / 0.8) ** 2
    np.testing.assert_allclose(meshes["bent"].materials.bump, strength, rtol=0.05)
    dimmed = 0.8 * bump_mean(strength)
    np.testing.assert_allclose(meshes["bent"].materials.albedo[0], dimmed, rtol=0.01)
    assert (meshes["even"].materials.bump == 0).all()
    np.testing.assert_array_equal(meshes["even"].corner_normal, [[0, 0, 1]] * 4)


def test_bump_is_left_out_as_in_bakes_and_said():
    def build(tree, shader):
        noise = add(tree, "TexNoise", Scale=3.0)
        bump = add(tree, "Bump", Height=noise.outputs[0], Strength=0.8)
        tree.links.new(bump.outputs[0], shader.inputs["Normal"])
        lift = add(tree, "Displacement", Height=noise.outputs[0])
        tree.links.new(lift.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])

    plate("rocky", build)
    tree = bpy.data.materials["rocky"].node_tree
    meshes, messages = read()
    np.testing.assert_allclose(meshes["rocky"].corner_normal, [[0, 0, 1]] * 4, atol=1e-6)
    assert any("'rocky'" in line and "bump" in line for line in messages)
    assert tree.nodes["Bump"].inputs["Strength"].default_value == np.float32(0.8)
    assert not any(link.is_muted for link in tree.links)


def test_a_view_layer_may_override_all_materials():
    plate("red", principled(Base_Color=(0.8, 0.1, 0.1, 1)))
    override = material(plate("plain", None, 0.5), base(ramp), "override")
    bpy.context.view_layer.material_override = override
    meshes, messages = read()
    alone = meshes["red"].materials.albedo
    assert np.ptp(alone, axis=0).max() > 0.01
    assert not any("did not see" in line for line in messages)
    bpy.context.view_layer.material_override = None
    bpy.data.objects["red"].data.materials[0] = override
    meshes, _ = read()
    np.testing.assert_allclose(meshes["red"].materials.albedo, alone, atol=1e-3)


def test_a_fine_normal_map_is_said():
    def build(tree, shader):
        noise = add(
            tree, "TexChecker", Scale=5.0, Color1=(0.8, 0.5, 0.9, 1), Color2=(0.5, 0.5, 1, 1)
        )
        bend = add(tree, "NormalMap", Color=noise.outputs["Color"])
        tree.links.new(bend.outputs[0], shader.inputs["Normal"])

    plate("bumpy", build)
    _, messages = read()
    assert any("'bumpy'" in line and "normal map" in line for line in messages)


@pytest.mark.parametrize("udim", [False, True])
def test_a_missing_image_is_said(udim, tmp_path):
    image = bpy.data.images.new("lost", 4, 4, tiled=udim)
    image.source = "TILED" if udim else "FILE"
    image.filepath = str(tmp_path / ("lost.<UDIM>.png" if udim else "lost.png"))
    image.reload()

    def build(tree, shader):
        node = add(tree, "TexImage")
        node.image = image
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        tree.links.new(add(tree, "TexImage").outputs["Alpha"], shader.inputs["Roughness"])

    plate("poster", build)
    _, messages = read()
    assert any("'lost'" in line and "missing" in line for line in messages)
    assert any("'poster'" in line and "has no image" in line for line in messages)


def test_tiles_of_an_image_are_told_apart(tmp_path):
    image = bpy.data.images.new("tiles", 4, 4, tiled=True)
    image.filepath = str(tmp_path / "tiles.<UDIM>.png")
    for number, colour in ((1001, (1, 0, 0, 1)), (1002, (0, 0, 1, 1))):
        plain = bpy.data.images.new(f"t{number}", 4, 4)
        plain.pixels.foreach_set(np.tile(np.float32(colour), 16))
        plain.save(filepath=str(tmp_path / f"tiles.{number}.png"))
        bpy.data.images.remove(plain)
    image.tiles.new(1002)
    image.reload()

    def build(tree, shader):
        node = add(tree, "TexImage")
        node.image = image
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])

    item = grid()
    material(item, build)
    uv = np.empty(len(item.data.loops) * 2, np.float32)
    layer = item.data.uv_layers["second"]
    layer.data.foreach_get("uv", uv)
    uv[::2] = (uv[::2] > 0.5) + 0.5
    layer.data.foreach_set("uv", uv)
    meshes, _ = read()
    right = uv[::2] > 1
    np.testing.assert_allclose(meshes["grid"].materials.albedo[right, 2], 1, atol=2e-3)
    np.testing.assert_allclose(meshes["grid"].materials.albedo[~right, 0], 1, atol=2e-3)


def test_nothing_of_the_file_is_changed_even_after_an_error(monkeypatch):
    item = plate("shy", surface(leaf))
    item.visible_camera = False
    item.is_holdout = True
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_WORKBENCH"

    def kinds():
        names = [
            name
            for name in dir(bpy.data)
            if isinstance(getattr(bpy.data, name), bpy.types.bpy_prop_collection)
        ]
        return {name: sorted(b.name for b in getattr(bpy.data, name)) for name in names}

    before = kinds()
    calls = []

    def note(scene, *_):
        calls.append(scene.name)

    bpy.app.handlers.render_init.append(note)
    try:
        meshes, _ = read()
        np.testing.assert_allclose(meshes["shy"].materials.albedo[0], [0.3, 0.2, 0.05], atol=2e-3)
        monkeypatch.setattr("prt_core.blender.quiet_render.read_channels", lambda path: 1 / 0)
        bpy.data.materials[0].node_tree.nodes["Diffuse BSDF"].inputs[0].default_value[0] = 0.1
        with pytest.raises(ZeroDivisionError):
            read()
        assert len(bpy.app.handlers.render_init) == 1 and "prt passes" not in calls
    finally:
        bpy.app.handlers.render_init.remove(note)
    assert kinds() == before
    assert scene.render.engine == "BLENDER_WORKBENCH"
    assert not item.visible_camera and item.is_holdout
    assert not bpy.data.materials[0].node_tree.nodes["Translucent BSDF"].mute


def test_weights_that_a_material_reads_are_part_of_what_is_kept():
    item = grid()
    other, worn = (item.vertex_groups.new(name=name) for name in ("bone", "wear"))
    every = list(range(len(item.data.vertices)))
    other.add(every, 0.7, "REPLACE")
    material(item, named("Attribute", "wear", "Fac"))
    for weight in (0.2, 0.9):
        worn.add(every, weight, "REPLACE")
        meshes, _ = read()
        np.testing.assert_allclose(meshes["grid"].materials.albedo, weight, atol=4e-3)


def test_an_unchanged_scene_is_not_evaluated_again(monkeypatch):
    item = grid()
    new = material(item, base(ramp))
    first, messages = read()
    renders = []
    looked = "prt_core.blender.passes.probe.Probe.look"
    monkeypatch.setattr(looked, lambda *a, **k: renders.append(1) or 1 / 0)
    again, same = read()
    assert not renders and same == messages
    assert again["grid"].materials.equals(first["grid"].materials)
    edits = [
        lambda: setattr(new.node_tree.nodes["Color Ramp"].color_ramp.elements[0], "position", 0.3),
        lambda: setattr(item, "pass_index", 3),
        lambda: setattr(item.data.attributes["level"].data[2], "value", 7.0),
        lambda: item.__setitem__("tint", 0.5),
        lambda: setattr(item.data.uv_layers["first"], "active_render", True),
    ]
    for edit in edits:
        edit()
        renders.clear()
        with pytest.raises(ZeroDivisionError):
            read()
        assert renders


def test_names_are_numbered_as_cryptomatte_does():
    # Reference values of MurmurHash3_x86_32 with seed 0; exponents of floats kept in range.
    assert name_number("test") == 0xBA6BD213
    assert name_number("Hello, world!") == 0xC0363E43
    assert name_number("") == 0x00800000


def test_what_is_no_uncompressed_image_is_refused(tmp_path):
    path = tmp_path / "noise.exr"
    path.write_bytes(bytes(64))
    with pytest.raises(PRTError, match="noise.exr: expected an OpenEXR file"):
        read_channels(path)
    image = bpy.data.images.new("small", 5, 3, float_buffer=True)
    image.pixels.foreach_set(np.arange(60, dtype=np.float32) / 60)
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    settings.color_mode = "RGBA"
    for codec in ("ZIP", "NONE"):
        settings.exr_codec = codec
        image.save_render(str(path))
        if codec == "ZIP":
            with pytest.raises(PRTError, match="expected uncompressed pixels"):
                read_channels(path)
    channels = read_channels(path)
    wanted = np.arange(60).reshape(3, 5, 4)[::-1] / 60
    for number, name in enumerate("RGBA"):
        np.testing.assert_allclose(channels[name], wanted[..., number], atol=1e-6)


def test_glass_glows_where_it_would_be_black():
    passes = {
        "diffuse": np.float32([[0, 0, 0], [0.3, 0.4, 0.2], [0.01, 0.025, 0]]),
        "glossy": np.zeros((3, 3), np.float32),
        "transmission": np.float32([[0.9, 0.6, 0.3]] * 3),
        "emission": np.zeros((3, 3), np.float32),
        "normal": np.float32([[0, 0, 1]] * 3),
        "share": np.ones(3, np.float32),
    }
    values, signs = quantities_of(passes)
    shown = values[:, COLUMNS["transmission"]]
    np.testing.assert_allclose(shown, [[0.9, 0.6, 0.3], [0, 0, 0], [0.45, 0.3, 0.15]], atol=1e-3)
    np.testing.assert_allclose(values[:, COLUMNS["opacity"]], 0.4, atol=1e-3)
    assert signs["glass"].all()
