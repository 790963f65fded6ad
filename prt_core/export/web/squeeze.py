"""Scripts without what only people read: comments, indentation, spaces around operators.

Statements end with a semicolon or a block there; strings and patterns stay as they are, but for
the shaders among them.
"""

import re

# Strings, templates and patterns; a pattern follows what no operand does.
_LITERAL = re.compile(r'"(?:[^"\\\n]|\\.)*"|`[^`]*`|(?<=[(,=])/(?:[^/\\\n\[]|\\.|\[[^\]\n]*\])+/')
# Two signs stay apart: together they would be another operator.
_OPERATORS = re.compile(r"( [+-] [+-])| ?([=+*/<>{}(),;:?&|!%^-]+) ?")
# What begins with a zero, is constant, or goes on in the next line.
_ZERO, _CONSTANT = re.compile(r"(?<![\w.$])0\.(?=\d)"), re.compile(r"\bconst ")
_CLOSED = re.compile(r";?\n?}\n?")
_OPEN, _PLAIN = re.compile(r"([{(\[,;=+?:&|])\n"), re.compile(r"([{};,])\n(?=[^#])")


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
        parts.append(_statements(script[end : literal.start()]))
        text = literal.group()
        parts.append(_shader(text) if "void main" in text or "vec3 shown" in text else text)
        end = literal.end()
    return "".join([*parts, _statements(script[end:])])


def _statements(code):
    """What comes before a brace that closes needs no end of its own; nor does the brace."""
    return _CLOSED.sub("}", _tight(_CONSTANT.sub("let ", code)))


def _tight(code):
    code = _OPERATORS.sub(lambda m: m.group(1) or m.group(2), code)
    return _OPEN.sub(r"\1", _ZERO.sub(".", code))


def _shader(text):
    """Lines that begin with # end where they end; all others are one."""
    lines = [line if line.startswith(("#", "`#")) else _tight(line) for line in text.split("\n")]
    return _PLAIN.sub(r"\1", "\n".join(lines))
