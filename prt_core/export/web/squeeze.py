"""Scripts without what only people read: comments, indentation, spaces around operators.

Lines stay, so that a statement may end with one; strings and patterns stay as they are, but for
the shaders among them.
"""

import re

# Strings, templates and patterns; a pattern follows what no operand does.
_LITERAL = re.compile(r'"(?:[^"\\\n]|\\.)*"|`[^`]*`|(?<=[(,=])/(?:[^/\\\n\[]|\\.|\[[^\]\n]*\])+/')
# Two signs stay apart: together they would be another operator.
_OPERATORS = re.compile(r"( [+-] [+-])| ?([=+*/<>{}(),;:?&|!%^-]+) ?")


def squeezed(script):
    """A script of the page, shorter.

    Parameters
    ----------
    script : str
        Comments have lines of their own; templates hold none within each other.

    Returns
    -------
    str
    """
    lines = (line.strip() for line in script.splitlines())
    script = "\n".join(line for line in lines if line and not line.startswith("//")) + "\n"
    parts, end = [], 0
    for literal in _LITERAL.finditer(script):
        parts.append(_tight(script[end : literal.start()]))
        text = literal.group()
        parts.append(_shader(text) if "void main" in text or "vec3 shown" in text else text)
        end = literal.end()
    return "".join([*parts, _tight(script[end:])])


def _tight(code):
    return _OPERATORS.sub(lambda m: m.group(1) or m.group(2), code)


def _shader(text):
    lines = (line if line.startswith(("#", "`#")) else _tight(line) for line in text.split("\n"))
    return "\n".join(lines)
