"""Frames along a surface."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.lightfield import frames_along, frames_along_uv, smooth_frames, uv_tangents
from prt_core.lightfield.tangent_frames import _turning
from prt_core.sphere import tangent_frames


def sphere(across=17, down=11):
    """Positions (= normals), edges, triangles and corner UV of a sphere without its poles."""
    turn = np.arange(across) / across * 2 * np.pi
    tilt = (np.arange(down) + 0.5) / down * np.pi
    tilt, turn = np.meshgrid(tilt, turn, indexing="ij")
    points = np.stack(
        [np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1
    ).reshape(-1, 3)
    index = np.arange(across * down).reshape(down, across)
    beside = np.roll(index, -1, axis=1)
    edges = np.concatenate(
        [
            np.stack([index.ravel(), beside.ravel()], axis=1),
            np.stack([index[:-1].ravel(), index[1:].ravel()], axis=1),
        ]
    )
    lower, lower_beside = index[1:], beside[1:]
    index, beside = index[:-1], beside[:-1]
    triangles = np.concatenate(
        [
            np.stack([index, lower, lower_beside], axis=-1).reshape(-1, 3),
            np.stack([index, lower_beside, beside], axis=-1).reshape(-1, 3),
        ]
    )
    uv = np.stack([turn / (2 * np.pi), 1 - tilt / np.pi], axis=-1).reshape(-1, 2)[triangles]
    # Corners beyond the seam of the map.
    wraps = np.ptp(uv[..., 0], axis=1) > 0.5
    uv[wraps, :, 0] += uv[wraps, :, 0] < 0.5
    return points, edges, triangles, uv


def assert_frames(frames, normals):
    assert frames.dtype == np.float32 and frames.shape == (len(normals), 3, 3)
    assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(3), atol=1e-5)
    assert np.allclose(np.linalg.det(frames), 1, atol=1e-5)
    assert np.allclose(frames[:, 2], normals, atol=1e-6)


def turning(frames, edges):
    """Mean squared angle by which frames turn along edges."""
    return (_turning(frames.astype(np.float64), *edges.T) ** 2).mean()


def test_frames_follow_the_lines_of_the_map():
    points, edges, triangles, uv = sphere()
    for mirrored in (1, -1):
        # A map that is seen from behind has the same direction of u.
        frames = frames_along_uv(points, points, triangles, uv * [1, mirrored])
        assert_frames(frames, points)
        along = np.stack([-points[:, 1], points[:, 0], 0 * points[:, 0]], axis=1)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        assert ((frames[:, 0] * along).sum(axis=1) > 0.97).all()
    assert turning(frames, edges) < 0.25 * turning(tangent_frames(points), edges)


def test_smooth_frames_have_no_seam():
    # A tube along y: the normals' z changes its sign twice, and one direction runs along it all.
    angles, down = np.arange(13) / 13 * 2 * np.pi, 5
    normals = np.tile(np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1), (down, 1))
    index = np.arange(13 * down).reshape(down, 13)
    around = np.stack([index.ravel(), np.roll(index, -1, axis=1).ravel()], axis=1)
    edges = np.concatenate([around, np.stack([index[:-1].ravel(), index[1:].ravel()], axis=1)])
    frames = smooth_frames(normals, edges)
    assert_frames(frames, normals)
    assert turning(frames, edges) < 1e-6 < 0.1 < turning(tangent_frames(normals), edges)


def test_smooth_frames_turn_less_around_singularities():
    points, edges, _, _ = sphere(31, 17)
    frames = smooth_frames(points, edges)
    assert_frames(frames, points)
    assert turning(frames, edges) < 0.5 * turning(tangent_frames(points), edges)


def test_a_plane_has_one_frame():
    up = np.tile([0, 0, 1.0], (6, 1))
    edges = np.array([[0, 1], [1, 2], [3, 4], [4, 5]])
    assert np.ptp(smooth_frames(up, edges), axis=0).max() < 1e-6


def test_without_a_direction_frames_are_those_of_the_normal():
    points, edges, triangles, _ = sphere()
    plain = tangent_frames(points).astype(np.float32)
    assert np.allclose(smooth_frames(points, np.zeros((0, 2), int)), plain, atol=1e-6)
    assert np.allclose(smooth_frames(points, np.array([[4, 4]])), plain, atol=1e-6)
    flat = frames_along_uv(points, points, triangles, np.zeros((len(points), 2)))
    assert np.allclose(flat, plain, atol=1e-6)
    assert np.allclose(frames_along(points, 3 * points), plain, atol=1e-6)
    # A point of its own beside a mesh.
    alone = smooth_frames(np.append(points, [[0, 0.6, 0.8]], axis=0), edges)
    assert np.allclose(alone[-1], tangent_frames(np.array([[0, 0.6, 0.8]]))[0], atol=1e-6)


def test_directions_of_u_weigh_as_much_as_their_triangles():
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0.0]])
    rising = uv_tangents(corners, np.array([[0, 1, 2]]), np.array([[0, 0], [0, 1], [5, 0.0]]))
    assert np.allclose(rising, [[0, 6, 0]])


def test_wrong_meshes_are_refused():
    points, edges, triangles, uv = sphere()
    with pytest.raises(PRTError, match="normals: expected unit vectors"):
        smooth_frames(points / 2, edges)
    with pytest.raises(PRTError, match="edges: expected values"):
        smooth_frames(points, edges + 1)
    with pytest.raises(PRTError, match="uv: expected an array of shape"):
        uv_tangents(points, triangles, uv[:-1])
