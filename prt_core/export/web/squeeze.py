"""Scripts without what only people read: comments, indentation, spaces around operators.

Statements end with a semicolon or a block there; strings and patterns stay as they are, but for
the shaders among them.
"""

import re

# Strings, templates and patterns; a pattern follows what no operand does.
_LITERAL = re.compile(r'"(?:[^"\\\n]|\\.)*"|`[^`]*`|(?<=[(,=])/(?:[^/\\\n\[]|\\.|\[[^\]\n]*\])+/')
# Two signs stay apart: together they would be another operator.
_OPERATORS = re.compile(r"( [+-] [+-])| ?([=+*/<>{}(),;:?&|!%^-]+) ?")
# What begins or ends with a zero, is constant, or goes on in the next line.
_ZEROS = re.compile(r"(?<![\w.$])(\d+\.\d*?)0+(?![\w.])")
_ZERO, _CONSTANT = re.compile(r"(?<![\w.$])0\.(?=\d)"), re.compile(r"\bconst ")
_BRACKET = re.compile(r"\b(let|return|of|in) (?=[\[{(])")
_CLOSED = re.compile(r";?\n?}\n?")
# What a script declares for all; a declaration after another.
_DECLARED = re.compile(r"^(?:async )?(?:function|const|class) (\w{4,})", re.MULTILINE)
_PLAIN_TEXT = r'"[^";{}\n]*"'
_AGAIN = re.compile(
    rf"\b(let(?:[^;{{}}\"`]|{_PLAIN_TEXT}|\{{(?:[^;{{}}\"`]|{_PLAIN_TEXT})*\}})*);let ?(?=[\w{{\[])"
)
_DIGITS, _LETTERS = ["", *"0123456789"], "abcdefghijklmnopqrstuvwxyz"
_OPEN, _PLAIN = re.compile(r"([{(\[,;=+?:&|])\n"), re.compile(r"([{};,])\n(?=[^#])")


def short_names(scripts):
    """Short names of what scripts declare for all of them.

    Not of what is a property's name somewhere as well, or stands in a string.

    Parameters
    ----------
    scripts : sequence of str

    Returns
    -------
    dict of str -> str
    """
    text = "\n".join(scripts)
    names = sorted(set(_DECLARED.findall(text)), key=lambda name: (-text.count(name), name))
    quoted = " ".join(_LITERAL.findall(text))
    free = [
        name
        for name in names
        if not re.search(rf"[.{{]{name}\b|[{{,]\s*{name}\s*[,}}:=]|\b{name}:", text)
        and not re.search(rf"\b{name}\b", quoted)
    ]
    return {name: f"${_DIGITS[i // 26]}{_LETTERS[i % 26]}" for i, name in enumerate(free)}


def squeezed(script, names=None):
    """A script of the page, shorter.

    Parameters
    ----------
    script : str
        Comments have lines of their own; templates hold none within each other.
    names : dict of str -> str, optional
        Of `short_names`.

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
    parts.append(_statements(script[end:]))
    text, count = "".join(parts), 1
    while count:
        text, count = _AGAIN.subn(r"\1,", text)
    for name, short in (names or {}).items():
        text = re.sub(rf"(?<![\w$.]){name}(?![\w$])", lambda _, short=short: short, text)
    return text


def _statements(code):
    """What comes before a brace that closes needs no end of its own; nor does the brace."""
    return _CLOSED.sub("}", _tight(_CONSTANT.sub("let ", code)))


def _tight(code):
    code = _OPERATORS.sub(lambda m: m.group(1) or m.group(2), code)
    return _BRACKET.sub(r"\1", _OPEN.sub(r"\1", _ZERO.sub(".", _ZEROS.sub(r"\1", code))))


def _shader(text):
    """Lines that begin with # end where they end; all others are one."""
    lines = [line if line.startswith(("#", "`#")) else _tight(line) for line in text.split("\n")]
    return _PLAIN.sub(r"\1", "\n".join(lines))
