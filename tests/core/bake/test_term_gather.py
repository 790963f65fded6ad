import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.bake import gather_terms
from prt_core.bake.term_gather import in_out_gather
from prt_core.reflectance import Lambert, Phong, Sum, in_out_factors, local_frames
from prt_core.transport.terms import TermView
from tests.meshes import plane, sphere


def test_terms_receive_what_surfaces_send(tmp_path):
    ball = sphere(6, 0.5, (0, 0, 0.6), albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(9, albedo=0.7)])
    run(bake_steps(scene, tmp_path / "a.prt", BakeSettings(resolution=4, bounces=2)))
    bake = load(tmp_path / "a.prt")
    normals = bake.transport.normals
    sent = np.random.default_rng(0).random((len(normals), 3), np.float32)
    frames = local_frames(normals)
    outgoing = 0.8 * normals + 0.6 * frames[:, 0]
    for lobe, n_terms in ((Lambert(0.8), 1), (Sum([Lambert(0.4), Phong(3, 0.4)]), 20)):

        def weigh(block, directions, lobe=lobe):
            incoming = np.einsum("nrj,nij->nri", directions, frames[block])
            local = np.einsum("nj,nij->ni", outgoing[block], frames[block])
            return np.pi * lobe.eval(incoming, local[:, None])[None, ..., 0]

        (whole,) = gather_terms(bake, weigh)
        factors = in_out_factors(lobe, n_terms)
        terms = in_out_gather(bake, factors, frames)
        received = np.stack([k @ sent for k in terms], axis=1).astype(np.float32)
        result = TermView(factors, normals, frames).receive(received).toward(outgoing)
        wanted = whole @ sent
        assert np.linalg.norm(result - wanted) < 0.02 * np.linalg.norm(wanted)
    assert min(k.min() for k in terms) < 0


def test_a_bake_without_rays_is_refused(tmp_path):
    scene = Scene.from_meshes([plane(5)])
    run(bake_steps(scene, tmp_path / "a.prt", BakeSettings(resolution=4, bounces=0)))
    with pytest.raises(PRTError, match="has no bounce rays"):
        in_out_gather(load(tmp_path / "a.prt"), in_out_factors(Lambert(), 1))
