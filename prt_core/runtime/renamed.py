"""Old names of what users call: they work for one release and warn."""

import warnings
from functools import wraps


def warn_renamed(old, new, stacklevel=3):
    """Warn that `old` is called `new` now."""
    warnings.warn(f"{old} is {new} now", DeprecationWarning, stacklevel=stacklevel)


def renamed(old, new):
    """A property of a class: what is called `new` now, by its `old` name.

    Parameters
    ----------
    old, new : str
        Of an attribute or a method.
    """

    def get(self):
        kind = type(self).__name__
        warn_renamed(f"{kind}.{old}", f"{kind}.{new}")
        return getattr(self, new)

    return property(get, doc=f"`{new}`: its old name, for one release.")


def renamed_keyword(**names):
    """Decorator of a function that takes keywords by their old names as well.

    Parameters
    ----------
    **names
        old=new.
    """

    def decorate(function):
        @wraps(function)
        def wrapper(*arguments, **keywords):
            what = function.__qualname__
            for old, new in names.items():
                if old in keywords and new in keywords:
                    raise TypeError(f"{what}: both '{old}' and '{new}', its new name")
                if old in keywords:
                    warn_renamed(f"{what}: the keyword '{old}'", f"'{new}'")
                    keywords[new] = keywords.pop(old)
            return function(*arguments, **keywords)

        return wrapper

    return decorate


def renamed_names(module, names):
    """A module's `__getattr__` that knows old names.

    Parameters
    ----------
    module : str
        Its `__name__`.
    names : dict of str -> (str, object)
        Old name -> the new one, with its module, and what it is.
    """

    def get(name):
        if name not in names:
            raise AttributeError(f"module '{module}' has no attribute '{name}'")
        new, value = names[name]
        warn_renamed(f"{module}.{name}", new)
        return value

    return get
