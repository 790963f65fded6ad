"""The bake that another takes from: whether it can, and where its details still stand."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from prt_core.bake.settings import BakeSettings
from prt_core.errors import PRTError, expect, expect_all, expect_flag
from prt_core.runtime.address import expect_store_path
from prt_core.scene import Scene, compare, with_details
from prt_core.store import (
    GLOSS_FORM,
    BakeStore,
    compressed_attributes,
    damage_as_error,
    read_scene,
)
from prt_core.store.attributes import digest

# Details are sought again nearer to a change than this share of its size.
_AROUND = 0.5
# Methods whose bits can be asked again in part.
_METHODS = "exhaustive", "agreement"


@dataclass(frozen=True)
class Earlier:
    """A finished bake that another may take from.

    Attributes
    ----------
    store : BakeStore
    scene : Scene
    settings : BakeSettings
    """

    store: BakeStore
    scene: Scene
    settings: BakeSettings

    @cached_property
    def digest(self):
        """Hexadecimal: which bake it is."""
        attributes = self.store.attributes
        known = [attributes.get(name) for name in ("identity", "details", "reused")]
        rays = {k: v for k, v in attributes["arrays"].items() if not k.startswith("world")}
        return digest(json.dumps([known, rays], sort_keys=True).encode())

    @property
    def generation(self):
        """How many bakes it has taken from, one after the other."""
        return (self.store.attributes.get("reused") or {}).get("generation", 0)

    @property
    def whole_rays(self):
        """Rays of the whole bake that it, or those it took from, began with."""
        reused = self.store.attributes.get("reused") or {}
        return reused.get("whole_rays") or self.store.attributes["report"]["rays"]


def earlier_of(output, restart, reuse, update):
    """Which bake one at `output` takes from (see `prt_core.bake`), and how it begins.

    Returns
    -------
    reuse : str, Path or None
    restart : bool or "changed"
    """
    if expect_flag("update", update):
        expect(
            reuse is None and restart is not True,
            "update: takes what the output holds; leave out reuse and restart",
        )
        # What was stopped in its first bake goes on; where nothing is, a whole bake begins.
        return (output if _is_finished(output) else None), "changed"
    if reuse is not None:
        path, other = expect_store_path("reuse", reuse), expect_store_path("output", output)
        if _place(path) == _place(other) and not restart:
            restart = "changed"
    return reuse, restart


def _place(path):
    """What two names of the same bake have in common."""
    return path.resolve() if isinstance(path, Path) else path


def _is_finished(path):
    try:
        return BakeStore(path).is_complete
    except PRTError:
        return False


def has_form(path):
    """Whether there is a finished bake at a path that has a compressed form."""
    try:
        store = BakeStore(path)
        forms = compressed_attributes(store), compressed_attributes(store, GLOSS_FORM)
        return store.is_complete and any(forms)
    except PRTError:
        return False


def earlier_bake(path, scene, settings):
    """The `Earlier` bake at a path; or, in words, why nothing can be taken from it.

    Parameters
    ----------
    path : str or Path
    scene : Scene
        As it is now.
    settings : BakeSettings

    Raises
    ------
    PRTError
        There is no finished bake that can be read.
    """
    path = expect_store_path("reuse", path)
    try:
        store = BakeStore(path)
        expect(store.is_complete, f"{path}: the bake is not finished")
        attributes = store.attributes
        expect(attributes.get("kind") is None, f"{path}: is no bake")
        with damage_as_error(path):
            before = BakeSettings(**attributes["settings"])
            method = attributes["report"].get("method")
    except PRTError as error:
        raise PRTError(f"reuse: {error}; name a finished bake, or bake without it") from error
    one, two = (
        {k: v for k, v in each.stored().items() if k != "caster"} for each in (before, settings)
    )
    other = [
        f"{name} {one.get(name)}, now {two.get(name)}"
        for name in sorted({*one, *two})
        if one.get(name) != two.get(name)
    ]
    if other:
        return f"it was baked with {'; '.join(other)}"
    if method not in _METHODS:
        return f"it was sampled by '{method}', which asks all points together"
    if scene.image is not None or attributes.get("image") is not None:
        return "images of a camera or of surfaces are baked whole"
    old = read_scene(store)
    moved = old.size != scene.size or not np.array_equal(old.centre, scene.centre)
    if moved and (old.opacity is not None or scene.opacity is not None):
        return (
            "the scene has another extent, by which rays through what lets light pass are told "
            "apart"
        )
    return Earlier(store, old, before)


def expect_objects(scene, names):
    """Raise `PRTError` unless these are names of objects of the scene, one at least."""
    names = expect_all("only", names, str, "objects' names")
    expect(names, "only: expected the name of an object at least")
    known = {item.known_as for item in scene.objects}
    strange = [name for name in names if not objects_called(scene, [name]).any()]
    expect(
        not strange,
        f"only: there is no object '{', '.join(strange[:3])}' that is baked; there are "
        f"{', '.join(sorted(known)[:8])}{' …' if len(known) > 8 else ''}",
    )


def objects_called(scene, names):
    """(n_objects,) bool: objects of these names, and what is instanced by them."""
    names = set(names)
    owners = [item.known_as.removesuffix(f"/{item.source}") for item in scene.objects]
    return scene.objects_named(names) | np.array([owner in names for owner in owners], bool)


def taken(earlier, only):
    """What the parts of a bake are bound to that takes from an `Earlier` one; else None."""
    if not isinstance(earlier, Earlier):
        return None
    return {"digest": earlier.digest, "only": None if only is None else sorted(only)}


class KeptDetails:
    """Details of an earlier bake that still stand, and where new ones are sought: what has changed.

    Where details lie hangs on random rays: others than before would have to be asked anew.

    Parameters
    ----------
    earlier : Earlier
    sided : Scene
        As it is now, without details.
    """

    def __init__(self, earlier, sided):
        self._old, self._sided, compared = earlier.scene, sided, compare(earlier.scene, sided)
        self._changed = compared.before.joined(compared.after).grown(_AROUND)
        self._triangle_of = now = compared.triangle_of
        self._kept = np.zeros(len(sided.triangles), bool)
        self._kept[now[now >= 0]] = True

    def sought(self, triangles, places):
        """Whether new ones may lie at places of triangles, (m,) int and (m, 3) float."""
        return ~self._kept[triangles] | self._changed.overlap(places, places)

    def joined(self, detailed):
        """The scene with those that stand, and the new ones of `detailed` where it has changed."""
        old, new, sided = self._old.details, detailed.details, self._sided
        place = sided.to_frame(self._old.to_world(self._old.points.positions[old.point]))
        triangle = self._triangle_of[old.triangle]
        back = sided.lattice_back[sided.lattice_start[triangle]] >= 0
        stays = (triangle >= 0) & (back | ~old.back) & ~self._changed.overlap(place, place)
        comes = self.sought(new.triangle, detailed.points.positions[new.point])
        return with_details(
            sided,
            np.concatenate([triangle[stays], new.triangle[comes]]),
            np.concatenate([old.barycentric[stays], new.barycentric[comes]]),
            np.concatenate([old.back[stays], new.back[comes]]),
        )
