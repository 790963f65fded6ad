"""Wrong calls of `prt_core.transport` and `prt_core.sampling`."""

from dataclasses import fields

import numpy as np
import pytest
import scipy.sparse as sp

from prt_core import light, sampling, sphere, transport
from prt_core.bake import gather_terms
from prt_core.runtime.progress import run
from prt_core.sampling.groups import certified_together

from .calls import RESOLUTION, Call, caster, faults_of, method, plain, with_scene

BEYOND = "a NaN", "an infinity"


def sampled(there):
    """Every entry traced."""
    points = slice(0, len(there.scene.points))
    bits = transport.visibility_bits(there.scene, sphere.CubeMap(RESOLUTION), caster(there), points)
    return sampling.Sampled(bits, np.full_like(bits, 255), 0)


def of_transport(there):
    baked = there.bake.transport
    names = "cube_map", "bits", "gather", "normals", "materials", "tolerance", "mean_materials"
    good = {name: getattr(baked, name) for name in names}

    def call(**arguments):
        return transport.Transport(**arguments).radiance(there.light)

    may = "gather None", "bounces None", "mean_materials None", "normals"
    return Call(call, {**good, "bounces": 2}, may)


def refine_call(there):
    def refine(**arguments):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sampling.edge_errors, "_LEAST", 50)
            meshes, _ = run(sampling.refine_steps(**arguments))
        return [mesh.vertices for mesh in meshes]

    good = {
        "meshes": there.meshes,
        "lamps": [light.Lamp("sun", (1.0, 2.0, 3.0))],
        "world": there.light,
        "settings": sampling.RefineSettings(0.9),
        "caster": "brute",
    }
    return Call(refine, good, ("lamps no elements", "world None", "settings None"))


def of_partial(there):
    baked = there.bake.transport
    names = "cube_map", "bits", "gather", "normals", "materials"
    good = {name: getattr(baked, name) for name in names}
    good |= {"spread": sp.identity(baked.n_points, np.float32, "csr"), "row_map": baked.cube_map}

    def call(**arguments):
        return transport.PartialTransport(**arguments).radiance(there.light)

    return Call(call, good, ("gather None", "normals", "spread None", "row_map None"))


CALLS = {
    "refine_steps": refine_call,
    "RefineSettings": plain(sampling.RefineSettings, tolerance=0.1, vertices=20),
    "Transport": lambda t: of_transport(t),
    "PartialTransport": of_partial,
    "Spread": lambda t: Call(sampling.Spread, {"scene": t.scene}),
    "Spread.shares": method(lambda t: sampling.Spread(t.scene), "shares", known=np.arange(4)),
    "Spread.left_out": method(
        lambda t: sampling.Spread(t.scene), "left_out", known=np.arange(4), wanted=np.arange(2)
    ),
    "Transport.relight": method(
        lambda t: t.bake.transport,
        "relight",
        ("lamps", "light None", "bounces None"),
        light=lambda t: t.light,
        lamps=lambda t: np.ones((t.bake.transport.n_points, 3), np.float32),
        bounces=1,
    ),
    "Transport.received": method(lambda t: t.bake.transport, "received", light=lambda t: t.light),
    "Transport.product": method(
        lambda t: t.bake.transport,
        "product",
        ("lamps", "light None", "bounces None"),
        light=lambda t: t.light,
        lamps=lambda t: np.ones((t.bake.transport.n_points, 3), np.float32),
        bounces=1,
    ),
    "ExitRadiance": lambda t: Call(
        lambda received, albedo: transport.ExitRadiance(received, albedo).toward(),
        {
            "received": np.ones((t.bake.transport.n_points, 3), np.float32),
            "albedo": t.bake.transport.albedo,
        },
        # What is received is checked where the light comes in, not once more for each view.
        (*(f"{name} {label}" for name in ("received", "albedo") for label in BEYOND),),
    ),
    "Transport.exit_radiance": method(
        lambda t: t.bake.transport,
        "exit_radiance",
        (*(f"received {label}" for label in BEYOND),),
        received=lambda t: np.ones((t.bake.transport.n_points, 3), np.float32),
    ),
    "received_with_bounces": lambda t: Call(
        transport.received_with_bounces,
        {
            "gather": t.bake.transport.gather,
            "albedo": t.bake.transport.albedo,
            "received": np.ones_like(t.bake.transport.albedo),
            "tolerance": 1e-3,
            "bounces": 2,
        },
        ("gather None", "bounces None"),
    ),  # fmt: skip
    "Transport.with_bounces": method(
        lambda t: t.bake.transport,
        "with_bounces",
        ("bounces None",),
        received=lambda t: np.ones((t.bake.transport.n_points, 3), np.float32),
        bounces=2,
    ),
    "Transport.rows": method(
        lambda t: t.bake.transport, "rows", points=np.array([0, 2]), indirect=True
    ),
    "Transport.direct": method(lambda t: t.bake.transport, "direct", points=np.array([0, 2])),
    "Transport.columns": method(
        lambda t: t.bake.transport, "columns", directions=np.array([0, 2]), indirect=True
    ),
    "View": plain(
        lambda points, **rest: transport.View(**rest).outgoing(points),
        position=np.array([2.0, 3.0, 7.0]),
        points=np.ones((5, 3)),
    ),
    "View by directions": plain(
        lambda points, **rest: transport.View(**rest).outgoing(points),
        ("direction negative",),
        direction=np.ones((5, 3)),
        points=np.zeros((5, 3)),
    ),
    "all_bounces": lambda t: Call(
        transport.all_bounces,
        {
            "gather": t.bake.transport.gather,
            "albedo": t.bake.transport.albedo,
            "received": np.ones_like(t.bake.transport.albedo),
            "tolerance": 1e-3,
            "bounces": 2,
            "mean_albedo": t.bake.transport.mean_albedo,
        },
        ("gather None", "bounces None", "mean_albedo None"),
    ),  # fmt: skip
    "gather_hits": with_scene(
        transport.gather_hits,
        points=lambda t: slice(0, 3),
        seed=lambda t: 0,
        round_index=lambda t: 0,
    ),
    "gather_operator": plain(
        transport.gather_operator,
        hits=np.tile(np.array([[0, 1], [-1, 1]], np.int32), 16),
        n_points=2,
        blocked=np.array([0.5, 0.5], np.float32),
    ),
    "gather_operator of weights": plain(
        transport.gather_operator,
        ("weights None", "blocked None"),
        hits=np.tile(np.array([[0, 1], [-1, 1]], np.int32), 16),
        n_points=2,
        blocked=np.array([0.5, 0.5], np.float32),
        weights=np.linspace(0.3, 2, 64).reshape(2, 32),
    ),
    "gather_terms": lambda t: Call(
        gather_terms,
        {
            "bake": t.bake,
            "weigh": lambda block, directions: np.abs(directions[None, :, :, 2]),
            "blocked": np.full((1, len(t.bake.scene.points)), 0.2, np.float32),
        },
        ("blocked None",),
    ),
    "lamp_light": with_scene(
        transport.lamp_light,
        ("lamps no elements",),
        lamps=lambda t: [light.Lamp("point", (1, 2, 3), (0, 0, 4))],
        n_samples=lambda t: 3,
        seed=lambda t: 0,
    ),
    "received_light": lambda t: Call(
        transport.received_light,
        {
            "bits": t.bake.transport.bits,
            "normals": t.bake.transport.normals,
            "cube_map": sphere.CubeMap(RESOLUTION),
            "light": t.light,
        },
    ),  # fmt: skip
    "reference_rows": with_scene(
        transport.reference_rows,
        points=lambda t: [0],
        n_paths=lambda t: 4,
        max_bounces=lambda t: 1,
        seed=lambda t: 0,
    ),
    "visibility_bits": with_scene(
        transport.visibility_bits, ("points number",), points=lambda t: slice(0, 3)
    ),
    "AgreementSettings": plain(
        sampling.AgreementSettings,
        ("most_wrong None",),
        **{f.name: f.default for f in fields(sampling.AgreementSettings)} | {"most_wrong": 0.3},
    ),
    "CertificateSettings": plain(
        sampling.CertificateSettings,
        **{f.name: f.default for f in fields(sampling.CertificateSettings)},
    ),
    "HuangSettings": plain(
        sampling.HuangSettings, **{f.name: f.default for f in fields(sampling.HuangSettings)}
    ),
    "sample_agreement": with_scene(
        sampling.sample_agreement, settings=lambda t: sampling.AgreementSettings()
    ),
    "sample_huang": with_scene(
        sampling.sample_huang, settings=lambda t: sampling.HuangSettings(features=3)
    ),
    "refine_agreement": with_scene(
        sampling.refine_agreement,
        settings=lambda t: sampling.AgreementSettings(),
        sampled=sampled,
        points=lambda t: np.zeros(len(t.scene.points), bool),
        turn=lambda t: 0,
    ),
    "trace_rest": with_scene(
        sampling.trace_rest,
        sampled=sampled,
        points=lambda t: np.zeros(len(t.scene.points), bool),
    ),
    "certificate_steps": with_scene(
        sampling.certificate_steps,
        ("lights no elements", "groups None", "wanted None", "wanted no elements"),
        sampled=sampled,
        lights=lambda t: {"sky": t.light},
        settings=lambda t: sampling.CertificateSettings(64, 4),
        turn=lambda t: 0,
        groups=lambda t: certified_together(t.scene),
        wanted=lambda t: [0],
    ),
    "probe_lights": lambda t: Call(sampling.probe_lights, {"cube_map": sphere.CubeMap(2)}),
    "tiles_of": lambda t: Call(sampling.tiles_of, {"scene": t.scene, "size": 5}),
    "tile_scene": lambda t: Call(
        sampling.tile_scene, {"scene": t.scene, "points": np.array([0, 2, 3])}
    ),
    "sampler_named": plain(sampling.sampler_named, name="agreement"),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    faults = faults_of(CALLS[name](there), there.folder)
    assert not faults, "\n".join(faults)
