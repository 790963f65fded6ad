"""Lets a Light Path node answer for a while as if a ray of light asked, not one of the camera."""

from contextlib import contextmanager

# What is told to both kinds of rays that light takes, and to each.
_LIGHT = {"Ray Length": 1.0, "Ray Depth": 1.0, "Diffuse Depth": 1.0}
ANSWERS = {
    "diffuse": {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, **_LIGHT},
    "shadow": {"Is Shadow Ray": 1.0, **_LIGHT},
}
# Outputs whose answer is certain: a ray of light has been cast by a diffuse surface.
_KINDS = ("Camera", "Shadow", "Diffuse", "Glossy", "Singular", "Reflection", "Transmission")
CERTAIN = {f"Is {kind} Ray" for kind in (*_KINDS, "Volume Scatter")}
# Outputs that are one thing to glossy rays and another to diffuse ones.
_APART = {"Is Diffuse Ray", "Is Glossy Ray", "Is Singular Ray", "Diffuse Depth", "Glossy Depth"}


def tells_gloss_apart(node):
    """Whether a Light Path node is asked whether a ray is glossy or diffuse."""
    return any(output.is_linked for output in node.outputs if output.name in _APART)


@contextmanager
def answering(node, ray):
    """Values stand in for the outputs of a Light Path node for as long as it lasts.

    `ray` : "diffuse" or "shadow".
    """
    tree, values, links = node.id_data, [], []
    try:
        for output in node.outputs:
            for link in list(output.links):
                links.append((output, link.to_socket, link.is_muted))
        for output, socket, muted in links:
            value = tree.nodes.new("ShaderNodeValue")
            value.outputs[0].default_value = ANSWERS[ray].get(output.name, 0.0)
            values.append(value)
            tree.links.new(value.outputs[0], socket).is_muted = muted
        yield
    finally:
        for output, socket, muted in links:
            tree.links.new(output, socket).is_muted = muted
        for value in values:
            tree.nodes.remove(value)
