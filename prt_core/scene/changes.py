"""Whether a bake still belongs to its meshes: a digest of each, and what differs."""

import hashlib
from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect_named, expect_offers
from prt_core.scene.mesh import RAYS
from prt_core.scene.paint import LOOKS


def mesh_digests(meshes):
    """Digests of all that a bake takes from meshes but their names.

    Parameters
    ----------
    meshes : sequence of Mesh

    Returns
    -------
    dict of str -> str
        Hexadecimal, by the name of the mesh.
    """
    digests = {}
    for mesh in meshes if isinstance(meshes, list | tuple) else [meshes]:
        expect_offers("meshes", mesh, ("corner_vertex", "materials"), "a list of Mesh")
        digest = hashlib.blake2b(digest_size=16)
        for array in (
            mesh.vertices,
            mesh.corner_vertex,
            mesh.corner_normal,
            mesh.triangle_corners,
            *mesh.materials.digested(),
            mesh.corner_material,
            mesh.face_sizes,
            np.array([mesh.receives, mesh.two_sided, mesh.own_mesh]),
        ):
            digest.update(np.ascontiguousarray(array))
        met_by = [getattr(mesh, name) for name in RAYS]
        if not all(met_by):
            digest.update(np.array(met_by))
        if mesh.flat:
            digest.update(b"flat")
        if "emission" in mesh.materials.nondefault():
            # What emits light is known by the name of its material.
            digest.update("\0".join(mesh.material_names).encode())
        if mesh.paint is not None:
            digest.update(mesh.paint.digest())
        for kind in LOOKS:
            look = getattr(mesh, kind)
            if look is not None:
                digest.update(kind.encode())
                for array in look.materials.digested():
                    digest.update(np.ascontiguousarray(array))
                digest.update(look.paint.digest() if look.paint is not None else b"")
        digests[mesh.name] = digest.hexdigest()
    return digests


@dataclass(frozen=True)
class Changes:
    """How meshes differ from those a bake was made from; all empty where it is fresh.

    Attributes
    ----------
    renamed : dict of str -> str
        Unchanged meshes by their name in the bake, and their name now; no change of the light.
    missing, changed, added : tuple of str
        Names.
    """

    renamed: dict
    missing: tuple
    changed: tuple
    added: tuple

    @property
    def fresh(self):
        """Whether the light of the bake is that of the meshes."""
        return not (self.missing or self.changed or self.added)

    def __str__(self):
        parts = [
            f"{', '.join(names[:3])}{' …' if len(names) > 3 else ''} {what}"
            for names, what in (
                (self.changed, "changed"),
                (self.missing, "gone"),
                (self.added, "new"),
            )
            if names
        ]
        return "; ".join(parts) or "nothing changed"


def changes(source, digests):
    """`Changes` from the digests `source` of a bake to the digests of now."""
    for name, given in (("source", source), ("digests", digests)):
        expect_named(name, given, str, "digests")
    old = [name for name in source if digests.get(name) != source[name]]
    new = {name: None for name in digests if digests[name] != source.get(name)}
    by_digest = {}
    for name in new:
        by_digest.setdefault(digests[name], []).append(name)
    # A mesh is the same one whatever it is called, even where two have changed their names.
    renamed = {}
    for name in old:
        same = by_digest.get(source[name])
        if same:
            renamed[name] = same.pop(0)
            del new[renamed[name]]
    rest = [name for name in old if name not in renamed]
    changed = tuple(name for name in rest if name in new)
    return Changes(
        renamed,
        tuple(name for name in rest if name not in new),
        changed,
        tuple(name for name in new if name not in changed),
    )
