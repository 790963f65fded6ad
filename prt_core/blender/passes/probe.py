"""Cycles' light passes at any places of a scene, in one render.

A square screen before an orthographic camera carries a Ray Portal: through each pixel the ray goes
on from a place of its own in a direction of its own, both read from an image of floats. So real
objects are evaluated with all the coordinates and attributes that they have. Portals count as
transparent, hence passes hold the first surface behind them, and rays are still camera rays.
"""

from contextlib import ExitStack, contextmanager

import bpy
import numpy as np

from prt_core.blender.casters import remove_blocks
from prt_core.blender.colours import ACTIVE_BEFORE
from prt_core.blender.covers import covers_of
from prt_core.blender.passes.gloss_tree import PREFIX, add_gloss_outputs
from prt_core.blender.passes.traces import same_images, switched
from prt_core.blender.quiet_render import LAYER, SEEN, copied_scene, render_channels, settle

# Places of one render: a second or less of a slow machine.
MOST_PLACES = 1 << 16
# An attribute that only the plate has.
_PLATE = "prt plate"
# The names of passes before 5.0, and since.
_PASSES = {
    "diffuse": ("DiffCol", "Diffuse Color"),
    "glossy": ("GlossCol", "Glossy Color"),
    "transmission": ("TransCol", "Transmission Color"),
    "emission": ("Emit", "Emission"),
    "normal": ("Normal", "Normal"),
    "position": ("Position", "Position"),
}
_SWITCHES = set(
    "combined diffuse_color glossy_color transmission_color emit normal position "
    "cryptomatte_object cryptomatte_material".split()
)
# How often Cycles lets a ray pass what is transparent: through the portal, and no further.
_THROUGH_PORTAL = 2 if bpy.app.version >= (5, 0, 0) else 1


class Probe:
    """A scene of some objects of another scene, and a screen of portals; see `probe`.

    Parameters
    ----------
    scene, idle : bpy.types.Scene
        The temporary one, and an empty one: the operator evaluates that which it is called from.
    centre : (3,) float
    size : float
        Of what is looked at.
    samples : int
        Of each place.
    """

    def __init__(self, scene, idle, centre, size, samples):
        self.scene, self._idle, self.samples = scene, idle, samples
        self._planes, self._groups = None, []
        self._screen(np.asarray(centre, np.float64), max(float(size), 1e-6))

    def tell_gloss(self, planes):
        """Read what materials write of their gloss, from now on.

        Parameters
        ----------
        planes : set of str
            That they write (see `closures.PLANES`).
        """
        # With OSL materials have no passes of their own.
        self.scene.cycles.shading_system = False
        planes, layer = set(planes), self.scene.view_layers[0]
        if layer.material_override is not None:
            # The one material that everything has lies on the plate as well, and knows it.
            planes |= add_gloss_outputs(self._material.node_tree, self._groups.append)
        self._planes = sorted(planes)
        for name in self._planes:
            passed = layer.aovs.add()
            passed.name, passed.type = PREFIX + name, "COLOR"

    def show_only(self, objects):
        """Let these objects render, and no others."""
        collection = self.scene.collection
        for item in list(collection.objects):
            if item not in (self._plate, self._camera):
                collection.objects.unlink(item)
        for item in objects:
            collection.objects.link(item)

    def look(self, places, directions, first_only=False):
        """What rays from places meet first.

        Parameters
        ----------
        places, directions : (n, 3) float
            Directions have length 1. At most `MOST_PLACES`.
        first_only : bool
            Only whether something is met and what it emits, be it quite transparent.

        Returns
        -------
        dict of str -> array
            diffuse, glossy, transmission, emission, normal, position (n, 3) float32; share (n,):
            of the light that does not go straight through; name, material (n,) uint32:
            `cryptomatte.name_number` of both; met (n,) bool (with `first_only`). After
            `tell_gloss` gloss: a dict of (n, 3) float32 by the names of planes.

        Raises
        ------
        PRTError
            Cycles did not render.
        """
        n = len(places)
        side = max(4, int(np.ceil(np.sqrt(n))))
        images = [self._table(side, values) for values in (places, directions)]
        try:
            for node, image in zip(self._nodes, images, strict=True):
                node.image = image
            cycles = self.scene.cycles
            cycles.transparent_max_bounces = 0 if first_only else _THROUGH_PORTAL
            channels = self._render(side)
        finally:
            for node, image in zip(self._nodes, images, strict=True):
                node.image = None
                bpy.data.images.remove(image)

        def values(name, axes):
            planes = [channels[f"{LAYER}.{name}.{axis}"][::-1].ravel()[:n] for axis in axes]
            return np.stack(planes, axis=-1)

        since_5 = bpy.app.version >= (5, 0, 0)
        passes = {
            key: values(names[since_5], "XYZ" if key in {"normal", "position"} else "RGB")
            for key, names in _PASSES.items()
        }
        for key, name in (("name", "CryptoObject00"), ("material", "CryptoMaterial00")):
            # Number and share of what was met, twice: the plate may have left a trace as well.
            layer = values(name, "rgba")
            passes[key] = np.where(layer[:, 1] >= layer[:, 3], layer[:, 0], layer[:, 2])
            passes[key] = passes[key].view(np.uint32)
            passes["share"] = np.maximum(layer[:, 1], layer[:, 3])
        passes["met"] = values("Combined", "A")[:, 0] > 0.5
        if self._planes is not None:
            passes["gloss"] = {name: values(PREFIX + name, "RGB") for name in self._planes}
        return passes

    def _screen(self, centre, size):
        """The camera, and before it the plate of portals, away from everything."""
        layer = self.scene.view_layers[0]
        material = self._material = _plain_material(layer.material_override)
        if layer.material_override is not None:
            # It lies on the plate as well.
            layer.material_override = material
        nodes, links = material.node_tree.nodes, material.node_tree.links
        portal = nodes.new("ShaderNodeBsdfRayPortal")
        _onto_plate(material.node_tree, portal.outputs[0])
        uv = nodes.new("ShaderNodeUVMap")
        uv.uv_map = "UVMap"
        self._nodes = []
        for name in ("Position", "Direction"):
            node = nodes.new("ShaderNodeTexImage")
            node.interpolation, node.extension = "Closest", "EXTEND"
            links.new(uv.outputs[0], node.inputs["Vector"])
            links.new(node.outputs["Color"], portal.inputs[name])
            self._nodes.append(node)
        mesh = bpy.data.meshes.new("prt portals")
        half = size / 2
        corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", np.float32([0, 0, 1, 0, 1, 1, 0, 1]))
        mesh.materials.append(material)
        mesh.attributes.new(_PLATE, "FLOAT", "POINT").data.foreach_set("value", np.ones(4, "f"))
        self._plate = bpy.data.objects.new("prt portals", mesh)
        self._plate.location = centre + [0, 0, 3 * size]
        camera = bpy.data.cameras.new("prt camera")
        camera.type, camera.ortho_scale = "ORTHO", size
        camera.clip_start, camera.clip_end = 0.1 * size, 2 * size
        self._camera = bpy.data.objects.new("prt camera", camera)
        self._camera.location = centre + [0, 0, 4 * size]
        for item in (self._plate, self._camera):
            self.scene.collection.objects.link(item)
        self.scene.camera = self._camera

    def _table(self, side, values):
        """An image of floats, a pixel a place, as they are."""
        image = bpy.data.images.new("prt table", side, side, float_buffer=True, is_data=True)
        # Else Cycles keeps sixteen bits of each.
        image.use_half_precision = False
        pixels = np.ones((side * side, 4), np.float32)
        pixels[: len(values), :3] = values
        # Pixels without a place of their own repeat the last.
        pixels[len(values) :, :3] = values[-1]
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        return image

    def _render(self, side):
        self.scene.render.resolution_x = self.scene.render.resolution_y = side
        return render_channels(self.scene, self._idle, "materials")

    def remove(self):
        """Take away all that was made."""
        mesh, camera = self._plate.data, self._camera.data
        bpy.data.objects.remove(self._plate)
        bpy.data.objects.remove(self._camera)
        bpy.data.meshes.remove(mesh)
        bpy.data.cameras.remove(camera)
        bpy.data.materials.remove(self._material)
        remove_blocks(self._groups)


def _plain_material(override):
    """A material of nodes: a copy of the view layer's own for everything, or an empty one."""
    if override is not None:
        material = override.copy()
        if material.node_tree is None:
            material.use_nodes = True
        return material
    material = bpy.data.materials.new("prt portals")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material


def _onto_plate(tree, shader):
    """Let the plate have a shader, and all else what it has."""
    nodes, links = tree.nodes, tree.links
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        output = nodes.new("ShaderNodeOutputMaterial")
    before = [link.from_socket for link in output.inputs["Surface"].links]
    if not before:
        links.new(shader, output.inputs["Surface"])
        return
    mix, plate = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeAttribute")
    plate.attribute_name = _PLATE
    links.new(plate.outputs["Fac"], mix.inputs[0])
    for socket in before:
        links.new(socket, mix.inputs[1])
    links.new(shader, mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])


@contextmanager
def probe(scene, objects, centre, size, samples=1):
    """A `Probe` of some objects of a scene; afterwards all is as it was.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : dict
        bpy.types.Object -> whether it is put into the temporary scene (else something instances
        it there).
    centre : (3,) float
    size : float
        A box around everything.
    samples : int

    Raises
    ------
    PRTError
        Cycles is not there.
    """
    with ExitStack() as stack:
        stack.enter_context(same_images())
        for item in objects:
            for name, value in SEEN.items():
                stack.enter_context(switched(item, name, value))
            for modifier in covers_of(item):
                stack.enter_context(switched(modifier, "show_render", False))
            before = item.data.get(ACTIVE_BEFORE) if item.data is not None else None
            if before is not None:
                stack.enter_context(switched(item.data.attributes, "default_color_name", before))
        temporary, idle = stack.enter_context(copied_scene(scene, "prt passes"))
        _settings(temporary, scene, samples)
        built = Probe(temporary, idle, centre, size, samples)
        stack.callback(built.remove)
        built.show_only([item for item, own in objects.items() if own])
        yield built


def _settings(scene, own, samples):
    """Everything about the render of places that the user's `own` scene may have otherwise."""
    for child in list(scene.collection.children):
        scene.collection.children.unlink(child)
    scene.world = None
    cycles = {"samples": samples, "max_bounces": 0, "min_transparent_bounces": 0}
    settle(scene, own, "materials", _SWITCHES, cycles)
    scene.render.film_transparent = True
    layer = scene.view_layers[0]
    # Above that of portals, or they would be what is looked at; below that of all else.
    layer.pass_alpha_threshold, layer.pass_cryptomatte_depth = 1e-6, 2
