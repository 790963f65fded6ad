"""Light and shadow linking: which objects a lamp lights, and which are in its way."""

from prt_core.blender.identity import place_of


class Linking:
    """The objects of an evaluated scene, and which of them a collection of a lamp's means.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    """

    def __init__(self, depsgraph):
        self._depsgraph, self._known = depsgraph, None

    def named(self, collection):
        """A tuple of the names of the objects that are meant, as `Lamp` has them; None: all.

        As Cycles has it: where anything is included only that counts, what is excluded never
        does; of an instance its owner is asked first, then the object that it shows.
        """
        if collection is None:
            return None
        states = {"INCLUDE": set(), "EXCLUDE": set()}
        for state, item in _members(collection.original):
            states[state].add(item.session_uid)
        included, excluded = states["INCLUDE"], states["EXCLUDE"]
        if not included and not excluded:
            return None

        def is_meant(*uids):
            uid = next((uid for uid in uids if uid in included or uid in excluded), None)
            return uid not in excluded and (uid is not None or not included)

        return tuple(name for name, uids in self._objects().items() if is_meant(*uids))

    def _objects(self):
        """{name: session_uids of what is asked about it} of all that is in the scene."""
        if self._known is None:
            self._known = {}
            for instance in self._depsgraph.object_instances:
                source = instance.object.original
                owner = instance.parent.original if instance.parent else source
                name, library = place_of(owner)
                name = f"{name} [{library}]" if library else name
                if owner == source:
                    self._known[name] = (owner.session_uid,)
                else:
                    uids = owner.session_uid, source.session_uid
                    self._known[f"{name}/{source.name}"] = uids
        return self._known


def _members(collection):
    """(state, object) of all that a collection of a lamp's links."""
    for item, entry in zip(collection.objects, collection.collection_objects, strict=True):
        yield entry.light_linking.link_state, item
    for child, entry in zip(collection.children, collection.collection_children, strict=True):
        # All that is in a collection inside has the state of that one.
        for item in child.all_objects:
            yield entry.light_linking.link_state, item


def say_linked_surfaces(depsgraph, rendered, messages):
    """Say of which surfaces a linking is not followed: that of lamps is.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    rendered : container of int
        `session_uid` of the objects that render.
    messages : list of str
    """
    for item in depsgraph.objects:
        linking = item.light_linking
        linked = linking.receiver_collection or linking.blocker_collection
        if linked and item.type != "LIGHT" and item.original.session_uid in rendered:
            messages.append(
                f"{item.original.name}: the light linking of what its surface emits is ignored; "
                "that of lamps is followed"
            )
