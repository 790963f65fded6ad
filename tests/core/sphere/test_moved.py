"""What moved to this folder answers to its old name for one release, and says so."""

import pytest

from prt_core import light, sphere


@pytest.mark.parametrize("name", ["CubeMap", "rotation_about_z", "rotation_matrix"])
def test_old_names_are_the_new_ones(name):
    with pytest.warns(DeprecationWarning, match=f"prt_core.sphere.{name}"):
        assert getattr(light, name) is getattr(sphere, name)
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = light.no_such_thing
