"""How nodes are linked."""


def linked_to(socket):
    """The output socket that feeds an input, past reroutes; None when nothing does."""
    while socket.is_linked:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None
