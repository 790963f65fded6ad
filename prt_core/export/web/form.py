"""The compressed form of a page: clustered principal components in steps of eight bits.

Errors of a component matter as much as its weights are large, so all steps are chosen for about
the same error of the rows: a mean's is `_STEP`, a component's that over the root mean square of
its weights; weights, of components of unit length, have one step throughout. What is small then
takes few codes, which deflate well. Coarse wavelets are far larger than fine ones, so each level
has a step of its own where eight bits are too few.
"""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from prt_core.basis import haar_areas
from prt_core.compress import ClusteredPCA, Task, method_named
from prt_core.compress.clusters.clusters import ClusterCompressor
from prt_core.errors import expect
from prt_core.relight.forms import load_compressed
from prt_core.runtime.main_thread import in_thread

# The step of a mean's codes over the root mean square of all means' finest wavelets; that of
# weights over the root mean square of all weights.
_STEP, _WEIGHT_STEP = 1.2, 1 / 16
# The same at most, of what rows are in the root mean square: small scenes of few directions have
# fewer codes, whose errors add up to less than one another's size.
_SHARE = 0.004
# Points a cluster has on average, and components, where there is no form to take; of few points
# there are more clusters, up to so many, of so many points at least.
_POINTS_A_CLUSTER, _COMPONENTS = 1000, 24
_FEW_CLUSTERS, _FEW_POINTS = 64, 100
_MOST = 127
# The step of the strongest feature of bounced light over the expected size of a texel in it.
_BASIS_STEP = 0.0015


def form_steps(bake):
    """The clusters that a page shows a bake by: those it is compressed to, or new ones.

    A generator of `Progress`.

    Returns
    -------
    ClusterCompressor
    str
        Where it comes from.
    """
    form, _ = yield from in_thread("compressed form", load_compressed, bake)
    if form is not None and form.of == "points" and _is_apart(form.model):
        return form.model, f"the bake's own {form.method}"
    n_points = bake.transport.n_points
    n_clusters = max(
        round(n_points / _POINTS_A_CLUSTER), 1, min(_FEW_CLUSTERS, n_points // _FEW_POINTS)
    )
    model = ClusteredPCA(n_clusters, _COMPONENTS)
    task = Task.of(bake.transport, bake.scene.points, dense=bake.dense)
    yield from model.fit_steps(task.rows)
    yield from in_thread("seams", method_named("cpca").finish, model, task)
    return model, f"cpca of {len(model.affine_)} clusters, made for the page"


def _is_apart(model):
    """Whether a form has clusters, and direct light apart from the rest."""
    return (
        isinstance(model, ClusterCompressor)
        and model.code_.groups[0].direct
        and not any(group.direct for group in model.code_.groups[1:])
    )


@dataclass(frozen=True)
class CodedForm:
    """A form in codes, and what the codes mean.

    Attributes
    ----------
    model : ClusterCompressor
        With the values that the codes stand for.
    rows : (n_rows, n_features) int8
        Means and components, cluster by cluster.
    steps : (n_rows, n_levels + 1) float32
        Of each level's wavelets, the coarsest first, and of all other features.
    weights : (n_slots, most_rank) int8
    weight_steps : (n_rows,) float32
        1 where a row is a mean.
    energies : (n_rows,) float32
        Sum of the squared weights of each.
    basis : (n_others, n_directions) int8
        What the features of bounced light stand for.
    basis_steps : (n_others, n_levels) float32
    """

    model: object
    rows: np.ndarray
    steps: np.ndarray
    weights: np.ndarray
    weight_steps: np.ndarray
    energies: np.ndarray
    basis: np.ndarray
    basis_steps: np.ndarray


def coded_form(model):
    """The `CodedForm` of a fitted `ClusterCompressor`."""
    code = model.code_
    parts = _parts(code)
    means = np.stack([a.mean[parts[-2]] for a in model.affine_])
    step = _STEP * max(float(np.sqrt((means.astype(np.float64) ** 2).mean())), 1e-30)
    squares = sum(float((a.weights.astype(np.float64) ** 2).sum()) for a in model.affine_)
    count = sum(a.weights.size for a in model.affine_)
    weight_step = _WEIGHT_STEP * np.sqrt(squares / max(count, 1))
    most_rank = int(model.ranks_.max())
    # What rows are in the root mean square, and steps whose errors are a share of that.
    sizes = [len(a.weights) * float((a.mean.astype(np.float64) ** 2).sum()) for a in model.affine_]
    size = np.sqrt((sum(sizes) + squares) / max(len(model.order_), 1))
    least = _SHARE * np.sqrt(12) * max(size, 1e-30)
    step = min(step, least / np.sqrt(code.n_directions))
    weight_step = min(weight_step, least / np.sqrt(max(most_rank, 1)))
    weights = np.zeros((len(model.order_), most_rank), np.int8)
    affine, rows, steps, weight_steps, energies = [], [], [], [], []
    for a, first in zip(model.affine_, model.starts_[:-1], strict=True):
        n, rank = a.weights.shape
        mine = np.maximum(np.abs(a.weights).max(axis=0, initial=0) / _MOST, weight_step)
        mine = np.maximum(mine, 1e-30)
        codes = np.rint(a.weights / mine)
        weights[first : first + n, :rank] = codes
        size = np.sqrt((a.weights.astype(np.float64) ** 2).mean(axis=0)) if n else np.ones(rank)
        vectors = np.concatenate([a.mean[None], a.basis])
        coded, own = _coded(vectors, parts, step / np.concatenate([[1.0], np.maximum(size, 1e-12)]))
        values = np.empty_like(vectors)
        for part, column in zip(parts, own.T, strict=True):
            values[:, part] = coded[:, part] * column[:, None]
        near = copy(a)
        near.mean, near.basis = values[0], values[1:]
        near.weights = (codes * mine).astype(np.float32)
        affine.append(near)
        rows.append(coded)
        steps.append(own)
        weight_steps.append(np.concatenate([[1.0], mine]))
        energies.append(np.concatenate([[float(n)], a.energies]))
    near = copy(model)
    near.affine_ = affine
    near.shares_ = np.rint(model.shares_ * 510).astype(np.float32) / 510
    joined = [np.concatenate(p) for p in (rows, steps, weight_steps, energies)]
    rows, *floats = joined
    steps, weight_steps, energies = (values.astype(np.float32) for values in floats)
    size = _feature_sizes(rows, steps, energies, code.n_directions)
    basis, basis_steps, near.code_ = _coded_basis(code, size)
    return CodedForm(near, rows, steps, weights, weight_steps, energies, basis, basis_steps)


def _feature_sizes(rows, steps, energies, n_directions):
    """(n_others,) root mean squares of the features of bounced light."""
    values = rows[:, n_directions:] * steps[:, -1:]
    return np.sqrt(energies @ values**2 / max(float(energies.sum()), 1e-30))


def _coded_basis(code, size):
    """Codes and steps of what features of bounced light stand for, and the code with their values.

    Parameters
    ----------
    code : RowCode
    size : (n_others,) float
        Of the features.
    """
    n, parts = code.n_directions, _parts(code)[:-1]
    bases = [group.basis for group in code.groups[1:] if group.basis is not None]
    if not bases:
        return np.zeros((0, n), np.int8), np.zeros((0, len(parts)), np.float32), code
    basis = np.concatenate(bases)
    # Errors of all features matter alike; those of many texels add up.
    step = _BASIS_STEP / np.sqrt(n) * max(size.max(initial=0), 1e-30) / np.maximum(size, 1e-30)
    codes, steps = _coded(basis, parts, step)
    values, first, groups = np.empty_like(basis), 0, []
    for part, column in zip(parts, steps.T, strict=True):
        values[:, part] = codes[:, part] * column[:, None]
    for group in code.groups:
        if group.basis is not None:
            last = first + len(group.basis)
            group, first = replace(group, basis=values[first:last]), last
        groups.append(group)
    return codes, steps, replace(code, groups=tuple(groups))


def _levels(code):
    """(n_directions,) level of each wavelet, 0 the coarsest."""
    if not code.resolution:
        return np.zeros(code.n_directions, int)
    return haar_areas(code.resolution)[0]


def _parts(code):
    """Features whose codes have a step of their own: wavelets by level, all others."""
    level = _levels(code)
    parts = [np.flatnonzero(level == n) for n in range(level.max() + 1)]
    return [*parts, np.arange(code.n_directions, code.n_features)]


def _coded(vectors, parts, step):
    """int8 codes of rows (n, n_features), and the step of each part (n, n_parts)."""
    codes = np.zeros(vectors.shape, np.int8)
    steps = np.ones((len(vectors), len(parts)), np.float32)
    step = np.maximum(step, 1e-30)
    for index, part in enumerate(parts):
        if len(part):
            wanted = np.maximum(np.abs(vectors[:, part]).max(axis=1) / _MOST, step)
            steps[:, index] = wanted
            codes[:, part] = np.rint(vectors[:, part] / wanted[:, None].astype(np.float32))
    return codes, steps


def pack_form(pack, coded, points):
    """Put a `CodedForm` into a `Pack`, for some points of the bake in a page's order.

    Returns
    -------
    dict
        What the page is told of it: resolution, ranks of the groups and their shares.
    """
    model, code = coded.model, coded.model.code_
    expect(code.resolution is not None, "bake: its form is not on a cube map; compress again")
    number = np.full(model.n_points_, -1)
    number[points] = np.arange(len(points))
    border = np.flatnonzero(number[model.border_points_[:, 0]] >= 0)
    border = border[np.argsort(number[model.border_points_[border, 0]])]
    guests, slots = model.border_points_[border].T
    every = np.concatenate([model.place_[points], slots])
    cluster = np.searchsorted(model.starts_, every, side="right") - 1
    pack.add("rank", model.ranks_.astype(np.uint16))
    pack.add("cluster", cluster.astype(np.uint16))
    # Component by component: neighbours along the curve are alike in each.
    pack.add("weight", np.ascontiguousarray(coded.weights[every].T))
    pack.add("weight_step", coded.weight_steps)
    pack.add("border", number[guests].astype(np.uint32), differences=True)
    pack.add("border_share", np.rint(model.shares_[border] * 510).astype(np.uint8))
    # Term by term: a light is cut to its most important terms.
    pack.add("row", np.ascontiguousarray(coded.rows.T))
    pack.add("row_step", coded.steps)
    pack.add("energy", coded.energies)
    scale = np.ones(code.n_directions, np.float32) if code.scale is None else code.scale
    pack.add("scale", scale.astype(np.float32))
    pack.add("level", _levels(code).astype(np.uint8))
    if len(coded.basis):
        pack.add("basis", coded.basis.T)
        pack.add("basis_step", coded.basis_steps)
    groups = [
        {"size": code.slices[i].stop - code.slices[i].start, "shares": list(map(float, g.shares))}
        for i, g in enumerate(code.groups)
    ]
    return {"resolution": code.resolution, "rank": coded.weights.shape[1], "groups": groups}


def pack_bits(pack, transport, points):
    """Put visibility into a `Pack`: a row of bits a direction, differences down each face."""
    n = transport.cube_map.resolution
    bits, rows = transport.bits[points], []
    for byte in range(bits.shape[1]):
        spread = np.unpackbits(bits[:, byte, None], axis=1, bitorder="little")
        rows.append(np.packbits(spread.T, axis=1, bitorder="little"))
    rows = np.concatenate(rows)[: transport.n_directions].reshape(6, n, n, -1)
    rows[:, 1:] ^= rows[:, :-1].copy()
    pack.add("bits", rows.reshape(transport.n_directions, -1))
