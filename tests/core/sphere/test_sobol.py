import numpy as np
import pytest
from scipy.stats import qmc

from prt_core.sphere import sobol_points


@pytest.mark.parametrize("power", [0, 1, 2, 5, 6, 13])
def test_the_points_are_those_of_scipy(power):
    wanted = qmc.Sobol(2, scramble=False).random_base2(power)
    np.testing.assert_array_equal(sobol_points(power), wanted)
