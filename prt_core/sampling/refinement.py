"""Refinement of meshes that cannot hold a shadow: edges are split where that spares most.

Vertex-based adaptive subdivision (Krivanek, Pattanaik and Zara 2004) splits where the transport of
neighbouring vertices differs. Here light at the middles of edges and inside of triangles tells what
each new vertex would spare of the error between vertices (see `edge_errors`), under the lights that
the scene has and an even sky. In rounds those edges are split that spare most for each new vertex,
each the best of a triangle, until the error is within the tolerance or the vertices are used up.
"""

import re
from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    PRTError,
    expect,
    expect_all,
    expect_array,
    expect_kind,
    expect_number,
    expect_whole,
)
from prt_core.light.environment import BRIGHTEST
from prt_core.light.local import Lamp
from prt_core.runtime.progress import Progress
from prt_core.sampling.edge_errors import EdgeErrors
from prt_core.scene import LOCAL, Mesh, Scene, SplitMeshes
from prt_core.transport.lamps import blocking_caster
from prt_core.transport.place_light import SKY, PlaceLight

# Of what could be spared a round takes this share, in at most this share of the vertices that may
# be added, but so many; rounds at most.
_OF_ALL, _OF_BUDGET, _LEAST, _ROUNDS = 0.5, 0.1, 32, 60
_FACTOR = re.compile(r"(\d+(?:\.\d*)?|\.\d+)x")
# Objects whose new vertices are written out.
_SHOWN = 4


@dataclass(frozen=True)
class RefineSettings:
    """How far meshes are refined.

    Parameters
    ----------
    tolerance : float
        Relative L2 error that drawing between vertices may make, under each of the lights.
    vertices : int or str
        Vertices in all, of the objects that receive, at most; "1.5x": so many times those there
        are.

    Raises
    ------
    PRTError
        One of them is out of range, or `vertices` is neither.
    """

    tolerance: float = 0.02
    vertices: int | str = "1.5x"

    def __post_init__(self):
        expect_number("refine tolerance", self.tolerance, above=0, below=1)
        if isinstance(self.vertices, str):
            if not _FACTOR.fullmatch(self.vertices):
                raise PRTError(
                    f"refine vertices: expected a number as 20000, or as 1.5x of those there are, "
                    f"got '{self.vertices}'"
                )
            expect_number("refine vertices", float(self.vertices[:-1]), least=0, below=1e6)
        else:
            expect_whole("refine vertices", self.vertices, 0)

    def most(self, count):
        """How many vertices there may be in all, where there are `count`."""
        if isinstance(self.vertices, str):
            return int(float(self.vertices[:-1]) * count)
        return self.vertices


@dataclass(frozen=True)
class Refinement:
    """What refinement came to.

    Attributes
    ----------
    before, added : int
        Vertices of the objects that receive, and those that are new.
    objects : dict of str -> int
        New vertices of each mesh that has some.
    errors_before, errors : dict of str -> float
        Relative L2 error between vertices under each group of lights.
    rounds, rays : int
    tolerance : float
    """

    before: int
    added: int
    objects: dict
    errors_before: dict
    errors: dict
    rounds: int
    rays: int
    tolerance: float

    @property
    def tolerance_met(self):
        """Whether the error is within the tolerance under every light."""
        return max(self.errors.values(), default=0) <= self.tolerance

    def __str__(self):
        errors = ", ".join(
            f"{self.errors_before[name]:.1%} to {error:.1%} under {name}"
            if self.added
            else f"{error:.1%} under {name}"
            for name, error in self.errors.items()
        )
        if not self.added:
            why = (
                f"fine enough for a tolerance of {self.tolerance:.1%}"
                if self.tolerance_met
                else "more vertices are not allowed; allow more with --refine-vertices"
            )
            return f"refined nothing: {why} (error between vertices {errors})"
        ranked = sorted(self.objects.items(), key=lambda item: -item[1])
        where = ", ".join(f"{name} {count:,}" for name, count in ranked[:_SHOWN])
        where += f" and {len(ranked) - _SHOWN} more" if len(ranked) > _SHOWN else ""
        left = "" if self.tolerance_met else "; more vertices would bring it further"
        return (
            f"refined: {self.added:,} vertices added to {self.before:,} ({where}); error between "
            f"vertices {errors}{left}"
        )


def refine_steps(meshes, lamps=(), world=None, settings=None, caster="auto", make=None):
    """Meshes with more vertices where shadows need them; a generator of `Progress`.

    Parameters
    ----------
    meshes : sequence of Mesh
    lamps : sequence of Lamp
    world : (n_directions, 3) float32, optional
        Radiance on the texels of a cube map, without the suns among the lamps.
    settings : RefineSettings, optional
    caster : str
        See `make_caster`.
    make : callable(function, ...) -> RayCaster, optional
        Has a caster made by the function, in the thread that it needs; default: in this one.

    Returns
    -------
    meshes : list of Mesh
        The same objects where nothing was split.
    refinement : Refinement
    """
    settings = RefineSettings() if settings is None else settings
    expect_kind("settings", settings, RefineSettings)
    meshes = expect_all("meshes", meshes, Mesh, "meshes")
    lamps = expect_all("lamps", lamps, Lamp, "lamps")
    if world is not None:
        world = expect_array("world", world, (None, 3), np.float32, 0, BRIGHTEST)
        side = round((len(world) / 6) ** 0.5)
        expect(
            len(world) == 6 * side**2 > 0,
            f"world: expected the texels of a cube map, 6 n x n of them, got {len(world)}",
        )
    make = make or (lambda function, *arguments: function(*arguments))
    yield Progress("refine", 0, 0)
    # Without hidden points: what is between the corners is asked for by rays here.
    scene = Scene.from_meshes(meshes, max_hidden=0)
    state = SplitMeshes(meshes)
    receives = np.array([mesh.receives for mesh in meshes], bool)
    before = int(receives[state.vertex_mesh].sum())
    budget = settings.most(before) - before
    casters = {}

    def shadows(lamp):
        key = lamp.blockers if lamp.casts_shadow else ()
        if key not in casters:
            casters[key] = make(blocking_caster, scene, lamp, caster)
        return casters[key]

    try:
        casters["sky"] = make(scene.make_caster, caster, "diffuse", SKY)
        light = PlaceLight(scene, casters["sky"], shadows, lamps, world, 2 * state.n_edges)
        solid = np.concatenate([mesh.is_solid() for mesh in meshes])
        errors = EdgeErrors(state, scene, solid, light)
        yield from errors.begin()
        added, rounds, first = 0, 0, None
        while True:
            scores, now = errors.scores()
            first = first or now
            left = budget - added
            if max(now.values()) <= settings.tolerance or left <= 0 or rounds == _ROUNDS:
                break
            most = min(left, max(_LEAST, int(_OF_BUDGET * budget)))
            marked = _marked(state, scores, receives, most)
            if not marked.any():
                break
            of, template = state.split(marked)
            yield from errors.follow(of, template, LOCAL[template])
            added = int(receives[state.vertex_mesh].sum()) - before
            rounds += 1
            yield Progress("refine", min(added, budget), budget)
    finally:
        for item in casters.values():
            if item is not None:
                item.close()
    new = np.bincount(state.vertex_mesh[state.vertex_round > 0], minlength=len(meshes))
    objects = {mesh.name: int(n) for mesh, n in zip(meshes, new, strict=True) if n}
    parts = before, added, objects, first, now, rounds, light.rays, settings.tolerance
    return state.meshes(), Refinement(*parts)


def _marked(state, scores, receives, most):
    """(n_edges,) bool: the edges that are split next."""
    rows = np.arange(len(state.edges))
    best = state.edges[rows, scores[state.edges].argmax(axis=1)]
    candidates = np.unique(best[scores[best] > 0])
    marked = np.zeros(state.n_edges, bool)
    marked[candidates] = True
    costs = state.split_vertices(marked, receives)[candidates]
    # What lies between objects that only cast is split for free, with others.
    candidates, costs = candidates[costs > 0], costs[costs > 0]
    value = scores[candidates] / costs
    order = np.argsort(-value, kind="stable")
    candidates, costs = candidates[order], costs[order]
    spared = np.cumsum(scores[candidates])
    enough = np.searchsorted(spared, _OF_ALL * scores.sum()) + 1
    kept = (np.cumsum(costs) <= most) & (np.arange(len(costs)) < enough)
    marked[:] = False
    marked[candidates[kept]] = True
    return marked
