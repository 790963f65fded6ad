"""Realised objects and what they stand in for, so that nothing is seen or rendered twice.

The preview's copies hide the objects that they were made of, and what was kept of these; kept
objects hide theirs when there is no preview. `arrange` brings a scene to that state from any
other. What it hides it marks, to give it back as it was.
"""

from contextlib import contextmanager, suppress

import bpy

from prt_core.blender.compat import view_layer_of

# Custom properties of realised objects: the name of their mesh in the bake, as a copy of the
# preview's or as a kept object of the user's; what they were made of, and how that rendered.
COPY, KEPT, ORIGINAL, _BEFORE = "prt_copy", "prt_kept", "prt_original", "prt_original_before"
# Of what is hidden: how it rendered, and the view layers in which it was hidden. No file keeps
# these on a linked object, and not all on an overridden one: so `_BEFORE` is beside them.
_HIDDEN, _LAYERS = "prt_hidden", "prt_hidden_in"
_RENDERED, _DID_NOT = 1, 2


def is_copy(item):
    """Whether an object is a realised copy of the preview's, which goes with it."""
    return bool(item.get(COPY))


def is_kept(item):
    """Whether an object is a realised one that holds kept colours, and is the user's."""
    return bool(item.get(KEPT))


def renders(item):
    """Whether an object renders, were it not for those that stand in for it."""
    return not item.hide_render or item.get(_HIDDEN) == _RENDERED


def rendered_objects(scene):
    """`session_uid` of the objects whose collections and own switch let them render."""
    uids = set()

    def visit(collection):
        if not collection.hide_render:
            uids.update(o.session_uid for o in collection.objects if renders(o))
            for child in collection.children:
                visit(child)

    visit(scene.collection)
    return uids


def stands_in(item, rendered):
    """Whether an object stands in for another, which renders itself.

    Parameters
    ----------
    item : bpy.types.Object
    rendered : set of int
        `session_uid` of all objects that render.
    """
    original = item.get(ORIGINAL)
    return is_copy(item) or (original is not None and original.session_uid in rendered)


def hidden_by_libraries(scene):
    """Linked objects of a scene, or of what it instances, that are hidden since their library has
    a realised object in their place, which is not here."""
    found, collections = {}, [scene.collection]
    for collection in collections:
        found |= {item.session_uid: item for item in collection.all_objects}
        empties = [o for o in collection.all_objects if o.instance_type == "COLLECTION"]
        instanced = {o.instance_collection for o in empties} - {None, *collections}
        collections += instanced
    stood_for = {item[ORIGINAL].session_uid for item in found.values() if item.get(ORIGINAL)}
    return [
        item
        for uid, item in found.items()
        if item.library is not None and item.hide_render and item.get(_HIDDEN) == _RENDERED
        and uid not in stood_for
    ]  # fmt: skip


def hidden_in(item, view_layer):
    """Whether an object is hidden in a view layer because another stands in for it."""
    # Before the layers were noted all of them were meant.
    return bool(item.get(_HIDDEN)) and view_layer.name in item.get(_LAYERS, view_layer.name).split(
        "\n"
    )


@contextmanager
def originals_render(scene):
    """What realised objects stand in for renders as it would without them, for as long as it
    lasts."""
    hidden = [o for o in scene.objects if o.get(_HIDDEN) == _RENDERED and not is_kept(o)]
    hidden = [o for o in hidden if o.hide_render]
    for item in hidden:
        item.hide_render = False
    try:
        yield
    finally:
        for item in hidden:
            item.hide_render = True


def arrange(target):
    """Hide what a realised object stands in for, and show what none stands in for any more.

    What the user has shown again meanwhile stays so.

    Parameters
    ----------
    target : bpy.types.Scene

    Returns
    -------
    int
        How many originals appeared.
    """
    copies, kept = _stand_ins()
    shown, view_layer = 0, view_layer_of(target)
    for item in list(target.objects):
        over = copies.get(item.session_uid, []) + kept.get(item.session_uid, [])
        original = item.get(ORIGINAL) if is_kept(item) else None
        if over:
            _hide(item, over, view_layer)
        elif original is not None and original.session_uid in copies:
            _hide(item, [], view_layer)
        elif item.get(_HIDDEN):
            _show(item, target)
            shown += not is_kept(item)
    return shown


def let_go(item):
    """Leave a realised object that no longer fits to the user, hidden; it stands in for nothing."""
    for mark in (KEPT, ORIGINAL, _BEFORE, _HIDDEN, _LAYERS):
        item.pop(mark, None)
    item.hide_render = item.hide_viewport = True


def _stand_ins():
    """The preview's copies and the kept objects of all scenes, by what they stand in for."""
    copies, kept, by_name = {}, {}, set()
    for scene in bpy.data.scenes:
        for item in scene.objects:
            by_name.add(item.session_uid)
            original = item.get(ORIGINAL)
            if original is not None:
                group = copies if is_copy(item) else kept
                group.setdefault(original.session_uid, []).append(item)
    for uid in [uid for uid in kept if uid not in by_name]:
        # The user has deleted the original: a mark shall not keep it in the file.
        for item in kept.pop(uid):
            item.pop(ORIGINAL, None)
    return copies, kept


def _hide(item, over, view_layer):
    """Hide an object that those `over` it stand in for."""
    noted = next((other[_BEFORE] for other in over if _BEFORE in other), None)
    fresh = not item.get(_HIDDEN)
    if fresh:
        item[_HIDDEN] = noted or (_DID_NOT if item.hide_render else _RENDERED)
        item[_LAYERS] = ""
        item.hide_render = True
    for other in over:
        if _BEFORE not in other:
            other[_BEFORE] = item[_HIDDEN]
    hidden = item.hide_get(view_layer=view_layer)
    # Where only the mark was lost, with the file, it was hidden for the same reason.
    if (not hidden or (fresh and noted)) and not hidden_in(item, view_layer):
        _hide_set([item], True, view_layer)
        item[_LAYERS] = "\n".join([*filter(None, [item[_LAYERS]]), view_layer.name])


def _show(item, target):
    """Give back what `_hide` took."""
    for view_layer in target.view_layers:
        if hidden_in(item, view_layer):
            _hide_set([item], False, view_layer)
    item.hide_render = item[_HIDDEN] == _DID_NOT
    for mark in (_HIDDEN, _LAYERS):
        item.pop(mark, None)


def _hide_set(items, hide, view_layer):
    for item in items:
        # Objects of excluded collections are not in the view layer.
        with suppress(RuntimeError):
            item.hide_set(hide, view_layer=view_layer)
