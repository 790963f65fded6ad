"""The UV maps and seams of an atlas in a store, checked on the way out."""

import numpy as np

from prt_core.errors import expect
from prt_core.scene import Atlas, Seams
from prt_core.store.attributes import damage_as_error

_SEAMS = {
    "texel": ("int32", (None, 8)),
    "weight": ("float32", (None, 8)),
    "edge": ("int32", (None,)),
}


def write_atlas(store, image):
    """Store the atlas of an image; returns the attribute that belongs to it.

    Parameters
    ----------
    store : BakeStore
    image : PointImage or None

    Returns
    -------
    dict
        Empty where there is none.
    """
    atlas = getattr(image, "atlas", None)
    names = ["atlas_uv", *(f"seam_{name}" for name in _SEAMS)]
    if atlas is None:
        for name in names:
            store.remove(name)
        return {}
    store.keep("atlas_uv", np.concatenate(list(atlas.corner_uv.values())).astype(np.float32))
    for name in _SEAMS:
        store.keep(f"seam_{name}", getattr(atlas.seams, name))
    sizes = [[name, len(uv)] for name, uv in atlas.corner_uv.items()]
    return {"atlas": {"objects": sizes, "made": atlas.made}}


def read_atlas(store, n_texels):
    """The `Atlas` of a store; None where there is none.

    Parameters
    ----------
    store : BakeStore
    n_texels : int
        Of its image.
    """
    kept = store.attributes.get("atlas")
    if kept is None:
        return None
    with damage_as_error(store.path):
        sizes, made = kept["objects"], kept["made"]
        good = (
            isinstance(made, dict)
            and isinstance(made.get("uv"), str)
            and all(
                isinstance(name, str) and type(size) is int and size >= 0 for name, size in sizes
            )
        )
        expect(good, "the objects of its atlas are")
    uv = store.read("atlas_uv", (sum(size for _, size in sizes), 2), "float32")
    ends = np.cumsum([size for _, size in sizes])
    parts = np.split(uv, ends[:-1])
    seams = Seams(
        **{n: store.read(f"seam_{n}", shape, kind) for n, (kind, shape) in _SEAMS.items()}
    )
    inside = not seams.texel.size or (seams.texel.min() >= 0 and seams.texel.max() < n_texels)
    whole = len(seams.texel) == len(seams.weight) == len(seams.edge)
    whole = whole and np.isfinite(seams.weight).all() and (seams.edge >= 0).all()
    expect(inside and whole, f"{store.path}: the seams of its atlas are damaged; bake again")
    return Atlas({name: part for (name, _), part in zip(sizes, parts, strict=True)}, made, seams)
