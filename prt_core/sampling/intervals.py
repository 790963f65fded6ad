"""95 % intervals of rare events: a binomial share, and a weighted sum of Poisson counts."""

from scipy.special import betainc, gammainc, gammaincinv

_TAIL = 0.025


def binomial_interval(count, n):
    """The 95 % mid-P interval (Lancaster 1961) of a binomial share.

    The two bounds solve P(X > count) + P(X = count) / 2 = 2.5 % and its mirror image; they lie
    between those of Clopper and Pearson for `count` and for its neighbour.
    """

    def above(p):
        """P(X > count) + P(X = count) / 2 for a share p: rises with p."""
        more = betainc(count + 1, n - count, p) if count < n else 0.0
        same_or_more = betainc(count, n - count + 1, p) if count else 1.0
        return (more + same_or_more) / 2

    return (
        _solve(above, _TAIL, 1.0) if count else 0.0,
        _solve(above, 1 - _TAIL, 1.0) if count < n else 1.0,
    )


def weighted_interval(weights):
    """95 % interval of a sum of Poisson counts times weights, from one weight an event.

    Parameters
    ----------
    weights : (n,) float64
        Of the events that happened, n >= 1.
    """
    total, square, largest = weights.sum(), (weights**2).sum(), weights.max()
    # The truth lies between two gamma laws: as seen, and with one more of the largest events.
    laws = []
    for mean, variance in ((total, square), (total + largest, square + largest**2)):
        laws.append((mean**2 / variance, variance / mean))

    def share(value):
        return sum(gammainc(shape, value / scale) for shape, scale in laws) / 2

    most = float(max(gammaincinv(shape, 0.9999) * scale for shape, scale in laws))
    return _solve(share, _TAIL, most), _solve(share, 1 - _TAIL, most)


def _solve(rising, wanted, most):
    """Where a function that rises from 0 to `most` reaches a value, by bisection."""
    low, high = 0.0, most
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return (low + high) / 2
