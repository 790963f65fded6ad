"""Small meshes that tests are made of."""

from dataclasses import replace

import numpy as np

from prt_core.rays import BruteForceCaster
from prt_core.rays.caster import known_casters
from prt_core.scene import Mesh, Scene
from prt_core.scene.paint import Look


def caster_of(scene):
    """The quickest caster that is here; brute force is the oracle of the rays' own tests."""
    if "embree" in known_casters():
        return scene.make_caster("embree")
    return BruteForceCaster(scene.vertices, scene.triangles)


class Stripes:
    """Red where x < edge, else green; told by the corners of a mesh."""

    def __init__(self, mesh, edge=0.5):
        self._x = mesh.vertices[mesh.corner_vertex, 0]
        self.edge = edge

    def at(self, corners, weights):
        x = (self._x[corners] * weights).sum(axis=1)
        return {"albedo": np.where((x < self.edge)[:, None], [0.8, 0.1, 0.0], [0.0, 0.6, 0.2])}

    def alike(self, corners):
        return np.arange(len(corners))

    def texels(self, corners):
        return np.full(len(corners), 4000.0)

    def digest(self):
        return np.float64(self.edge).tobytes()


def plane(n=5, low=-1.0, high=1.0, name="plane", albedo=0.5, z=0.0, **settings):
    """A flat square of n x n vertices that faces up."""
    side = np.linspace(low, high, n)
    x, y = np.meshgrid(side, side)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.full(n * n, z)])
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    quads = np.column_stack([first, first + 1, first + n + 1, first + n])
    return _quads(name, vertices, quads, albedo, **settings)


def glowing(mesh, emission):
    """The mesh with an emission (3,) on all its corners."""
    colour = np.broadcast_to(np.asarray(emission, float), mesh.materials.albedo.shape)
    return replace(mesh, materials=mesh.materials.replaced(emission=colour))


def wall(x, height, half_width, n=3, name="wall", albedo=0.0):
    """A square that faces -x at a distance x."""
    side, up = np.linspace(-half_width, half_width, n), np.linspace(0, height, n)
    y, z = np.meshgrid(side, up)
    vertices = np.column_stack([np.full(n * n, x), y.ravel(), z.ravel()])
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    quads = np.column_stack([first, first + n, first + n + 1, first + 1])
    return _quads(name, vertices, quads, albedo)


def _quads(name, vertices, quads, albedo, **settings):
    corner_vertex = quads.ravel()
    a, b, c = np.moveaxis(vertices[quads[:, :3]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = np.arange(0, quads.size, 4)[:, None]
    triangles = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    return Mesh(
        name,
        vertices,
        corner_vertex,
        np.repeat(normal, 4, axis=0),
        triangles,
        np.broadcast_to(np.asarray(albedo, float), (quads.size, 3)),
        face_sizes=np.full(len(quads), 4),
        **settings,
    )


def sphere(n=16, radius=1.0, centre=(0, 0, 0), inside=False, name="sphere", albedo=0.5):
    """A smooth ball of 2 n^2 quads' worth of triangles; `inside` faces inwards."""
    theta, phi = np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1)[:-1]
    t, p = (x.ravel() for x in np.meshgrid(theta, phi, indexing="ij"))
    unit = np.column_stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])
    unit[: 2 * n], unit[-2 * n :] = [0, 0, 1], [0, 0, -1]
    faces, m = [], 2 * n
    for i in range(n):
        for j in range(m):
            a, b = i * m + j, (i + 1) * m + j
            c, d = (i + 1) * m + (j + 1) % m, i * m + (j + 1) % m
            if i < n - 1:
                faces.append((a, b, c))
            if i > 0:
                faces.append((a, c, d))
    faces = np.array(faces)[:, ::-1] if inside else np.array(faces)
    corner_vertex = faces.ravel()
    normal = unit[corner_vertex] * (-1 if inside else 1)
    return Mesh(
        name,
        unit * radius + centre,
        corner_vertex,
        normal,
        np.arange(len(corner_vertex)).reshape(-1, 3),
        np.broadcast_to(np.asarray(albedo, float), (len(corner_vertex), 3)),
    )


def ball_on_paint(emission=(0.5, 0.25, 0.0), more=(), rings=6, side=9, **options):
    """A scene with a painted floor, and details below a ball that glows; and `more` meshes."""
    ball = sphere(rings, 0.5, (0, 0, 0.52), name="ball", albedo=(0.9, 0.3, 0.1))
    ball, floor = glowing(ball, emission), plane(side)
    floor.paint = Stripes(floor, 0.4)
    return Scene.from_meshes([ball, floor, *more], **options)


def leaf(emission=(0.2, 0.1, 0.0)):
    """A sheet with all that a surface may have, beside the ball of `ball_on_paint`.

    Clear at one edge and opaque at the other, from behind more than from the front and to lamps
    less; translucent; and another colour to rays that gather light, and from behind, where it
    glows.
    """
    mesh = plane(3, -0.97, -0.55, name="leaf", z=0.31)
    x = mesh.vertices[mesh.corner_vertex, :1]
    shown = mesh.materials.replaced(
        albedo=np.tile((0.2, 0.6, 0.1), (len(x), 1)),
        translucency=np.tile((0.1, 0.3, 0.05), (len(x), 1)),
        opacity=np.clip((-0.55 - x) / 0.42, 0, 1),
    )
    looks = {
        "bounced": shown.replaced(albedo=np.tile((0.4, 0.5, 0.1), (len(x), 1))),
        "back": shown.replaced(
            albedo=np.tile((0.6, 0.1, 0.2), (len(x), 1)),
            opacity=np.sqrt(shown.opacity),
            emission=np.broadcast_to(emission, (len(x), 3)),
        ),
        "shadow": shown.replaced(opacity=shown.opacity / 2),
    }
    looks = {name: Look(materials) for name, materials in looks.items()}
    return replace(mesh, materials=shown, **looks)
