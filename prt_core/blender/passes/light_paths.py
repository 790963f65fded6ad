"""Lets a Light Path node answer for a while as if rays of light asked, not those of the camera."""

from contextlib import contextmanager

# Both kinds of rays that light takes: from the sky and lamps, and from surfaces.
_ANSWERS = {
    "Is Shadow Ray": 1.0,
    "Is Diffuse Ray": 1.0,
    "Is Reflection Ray": 1.0,
    "Ray Length": 1.0,
    "Ray Depth": 1.0,
    "Diffuse Depth": 1.0,
}


@contextmanager
def answering(node):
    """Values stand in for the outputs of a Light Path node for as long as it lasts."""
    tree, values, links = node.id_data, [], []
    try:
        if tree.library is None:
            for output in node.outputs:
                for link in list(output.links):
                    links.append((output, link.to_socket, link.is_muted))
            for output, socket, muted in links:
                value = tree.nodes.new("ShaderNodeValue")
                value.outputs[0].default_value = _ANSWERS.get(output.name, 0.0)
                values.append(value)
                tree.links.new(value.outputs[0], socket).is_muted = muted
        yield
    finally:
        for output, socket, muted in links:
            tree.links.new(output, socket).is_muted = muted
        for value in values:
            tree.nodes.remove(value)
