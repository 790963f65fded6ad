"""95 % intervals of rare events: a binomial share, and a weighted sum of Poisson counts."""

from scipy.special import betainc, gammainc, gammaincinv

_TAIL = 0.025


def binomial_interval(count, n):
    """95 % interval of a binomial share.

    The lower bound is the mid-P one (Lancaster 1961), the upper that of Clopper and Pearson:
    rare events are found too seldom more often than too often, and what is wrong with a bake had
    better not be understated.
    """

    def low(p):
        """P(X > count) + P(X = count) / 2 for a share p: rises with p."""
        more = betainc(count + 1, n - count, p) if count < n else 0.0
        return (more + betainc(count, n - count + 1, p)) / 2

    def high(p):
        """P(X > count)."""
        return betainc(count + 1, n - count, p)

    return (
        _solve(low, _TAIL, 1.0) if count else 0.0,
        _solve(high, 1 - _TAIL, 1.0) if count < n else 1.0,
    )


def weighted_interval(weights, unseen=0.0):
    """95 % interval of a sum of Poisson counts times weights, from one weight an event.

    The gamma interval (Fay and Feuer 1997), its lower bound in mid-P form (Fay and Kim 2017).

    Parameters
    ----------
    weights : (n,) float64
        Of the events that happened.
    unseen : float
        The weight that an event may have even if none of those that happened has it.
    """
    total, square = weights.sum(), (weights**2).sum()
    largest = max(unseen, weights.max(initial=0.0))
    if not largest:
        return 0.0, 0.0
    # The truth lies between two gamma laws: as seen, and with one more of the largest events.
    moments = ((total, square), (total + largest, square + largest**2))
    laws = [(mean**2 / variance, variance / mean) for mean, variance in moments if mean]

    def share(value):
        return sum(gammainc(shape, value / scale) for shape, scale in laws) / len(laws)

    shape, scale = laws[-1]
    high = float(gammaincinv(shape, 1 - _TAIL) * scale)
    return (_solve(share, _TAIL, high) if total else 0.0), high


def _solve(rising, wanted, most):
    """Where a function that rises from 0 to `most` reaches a value, by bisection."""
    low, high = 0.0, most
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return (low + high) / 2
