"""Light and shadow linking: which objects a lamp lights, and which are in its way."""

from prt_core.blender.identity import place_of


class Linking:
    """The objects of an evaluated scene, and who of them is meant by a collection of a lamp's.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    rendered : container of int
        `session_uid` of the objects that render.
    """

    def __init__(self, depsgraph, rendered):
        self._depsgraph, self._rendered, self._names = depsgraph, rendered, None

    def named(self, collection):
        """A tuple of the names of the objects that are meant, as `Lamp` has them; None: all.

        As Cycles has it: where something is included only that counts, what is excluded never
        does, and an instance is what makes it.
        """
        if collection is None:
            return None
        states = {"INCLUDE": set(), "EXCLUDE": set()}
        for state, item in _members(collection.original):
            states[state].add(item.session_uid)
        included, excluded = states["INCLUDE"], states["EXCLUDE"]
        if not included and not excluded:
            return None
        return tuple(
            name
            for uid, name in self._owners().items()
            if uid not in excluded and (uid in included or not included)
        )

    def _owners(self):
        """{session_uid: name} of the objects that render, those that instance others among them."""
        if self._names is None:
            self._names = {}
            for instance in self._depsgraph.object_instances:
                owner = (instance.parent or instance.object).original
                name, library = place_of(owner)
                self._names[owner.session_uid] = f"{name} [{library}]" if library else name
        return self._names


def _members(collection):
    """(state, object) of all that a collection of a lamp's links, nested collections included."""
    for item, entry in zip(collection.objects, collection.collection_objects, strict=True):
        yield entry.light_linking.link_state, item
    for child, entry in zip(collection.children, collection.collection_children, strict=True):
        yield from _nested(child, entry.light_linking.link_state)


def _nested(collection, state):
    # A nested collection has one state; of collections inside it each has its own.
    for item in collection.objects:
        yield state, item
    for child, entry in zip(collection.children, collection.collection_children, strict=True):
        yield from _nested(child, entry.light_linking.link_state)


def say_linked_surfaces(depsgraph, rendered, messages):
    """Say of which surfaces a linking is not followed: that of lamps is."""
    for item in depsgraph.objects:
        linking = item.light_linking
        linked = linking.receiver_collection or linking.blocker_collection
        if linked and item.type != "LIGHT" and item.original.session_uid in rendered:
            messages.append(
                f"{item.original.name}: the light linking of what its surface emits is ignored; "
                "that of lamps is followed"
            )
