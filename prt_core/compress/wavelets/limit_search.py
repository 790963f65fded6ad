"""How small a term may be so that an error, or a size, is what was asked for."""

import math

# Of the logarithm of the limit.
_LEAST_STEP = 0.05


class LimitSearch:
    """A limit whose measured value comes close to the wanted one and not above it.

    The secant method on logarithms, within a bracket as soon as there is one.

    Parameters
    ----------
    start : float
        The first limit tried.
    wanted : float
    rising : bool
        Whether the value grows with the limit (an error) or falls (a size).
    near : float
        Share of the wanted value below which another limit is tried.
    most : int
        Limits tried.
    least : float
        Below it nothing is tried any more.

    Attributes
    ----------
    limit : float or None
        To be tried next, with `tell` to follow; None: the search is over.
    best : float or None
        The value nearest to the wanted one that is not above it.
    """

    def __init__(self, start, wanted, rising=True, near=0.98, most=8, least=1e-60):
        self.limit, self.best = start, None
        self._wanted, self._sign, self._near = wanted, 1 if rising else -1, near
        self._left, self._least = most, least
        self._good = self._bad = None
        self._told = 0

    def tell(self, value):
        """The value that was measured at `limit`. True where it is the best so far."""
        x = math.log(self.limit)
        y = math.log(max(value, 1e-300) / self._wanted)
        good = y <= 0
        better = good and (self.best is None or value > self.best)
        if good:
            self.best, self._good = max(value, self.best or 0.0), (x, y)
        else:
            self._bad = x, y
        self._left -= 1
        self._told += 1
        done = good and y >= math.log(self._near)
        self.limit = None if done or self._left <= 0 else self._next()
        return better

    def _next(self):
        aim = math.log((1 + self._near) / 2)
        if self._good and self._bad:
            (a, low), (b, high) = self._good, self._bad
            if abs(a - b) < 1e-4:
                return None
            share = min(max((aim - low) / (high - low), 0.1), 0.9)
            return math.exp(a + share * (b - a))
        x, y = self._good or self._bad
        # Errors grow about as the root of the root of the limit to the root of it.
        step = self._sign * (aim - y) / 0.4
        # Values of few terms are stairs: steps grow, or the next stair is never reached.
        least = _LEAST_STEP * 2 ** max(self._told - 2, 0)
        step = math.copysign(min(max(abs(step), least), 12.0), step)
        limit = math.exp(x + step)
        return limit if limit >= self._least else None
