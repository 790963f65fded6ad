"""The parameters of estimators, by scikit-learn's conventions and without its weight."""

import inspect

from prt_core.errors import expect, expect_whole


class Parameters:
    """What `__init__` takes is kept under the same names, and can be read, set and cloned.

    `sklearn.base.clone`, grid searches and pipelines know estimators by these methods.
    """

    @classmethod
    def _names(cls):
        # The signature of a class leaves `self` out, and is empty where there is no `__init__`.
        return list(inspect.signature(cls).parameters)

    def get_params(self, deep=True):
        """Parameters by name; `deep` is scikit-learn's and changes nothing here."""
        return {name: getattr(self, name) for name in self._names()}

    def set_params(self, **params):
        """Set some of the parameters; unknown names raise `PRTError`; returns self."""
        unknown = sorted(set(params) - set(self._names()))
        expect(not unknown, f"{type(self).__name__}: unknown parameter {', '.join(unknown)}")
        for name, value in params.items():
            setattr(self, name, value)
        return self

    def clone(self):
        """A new estimator with the same parameters, not fitted."""
        return type(self)(**self.get_params())

    def __repr__(self):
        params = ", ".join(f"{name}={value!r}" for name, value in self.get_params().items())
        return f"{type(self).__name__}({params})"


def expect_optional(name, value, least):
    """`value`, where it is None or a whole number of at least `least`."""
    return None if value is None else expect_whole(name, value, least)
