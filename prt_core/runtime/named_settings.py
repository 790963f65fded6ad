"""`NAME:key=value,key=value`: a method and settings of its own, asked for in one word."""

from prt_core.errors import PRTError, expect, expect_kind, shown

_WORDS = {"none": None, "true": True, "false": False}


def named_settings(text):
    """The name and the settings of a `text`.

    Parameters
    ----------
    text : str
        `NAME` or `NAME:key=value,key=value`.

    Returns
    -------
    name : str
    settings : dict of str -> str
        Values as they were written (see `read_setting`).

    Raises
    ------
    PRTError
        A setting is not of the form key=value, or is named twice.
    """
    expect_kind("method", text, str, "a method's name")
    name, _, rest = text.partition(":")
    settings = {}
    for part in filter(None, rest.split(",")):
        key, equals, value = (word.strip() for word in part.partition("="))
        expect(
            equals and key and value,
            f"method: expected NAME:key=value,key=value, got {shown(text)}",
        )
        expect(key not in settings, f"method: {shown(text)} has '{key}' twice")
        settings[key] = value
    return name, settings


def read_setting(text, default=None):
    """The value that a `text` stands for: a number, none, true, false, or the text itself.

    Where the `default` is a text the value is one, whatever it looks like.
    """
    if isinstance(default, str):
        return text
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def expect_settings(name, given, known):
    """Raise `PRTError` unless all settings `given` to the method `name` are among those `known`."""
    wrong = [key for key in given if key not in known]
    if wrong:
        offers = f"has the settings {', '.join(known)}" if known else "has no settings"
        raise PRTError(f"method: '{name}' {offers}; got {shown(wrong[0])}")
