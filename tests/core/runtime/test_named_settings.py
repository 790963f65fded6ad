"""NAME:key=value,key=value."""

import pytest

from prt_core import PRTError
from prt_core.runtime.named_settings import expect_settings, named_settings, read_setting


def test_names_and_settings_of_a_text():
    assert named_settings("pca") == ("pca", {})
    result = named_settings("cpca:n_clusters=7, method=static")
    assert result == ("cpca", {"n_clusters": "7", "method": "static"})


@pytest.mark.parametrize("text", ["a:b", "a:=1", "a:b=", "a:b=1,b=2", 3])
def test_other_texts_are_refused_in_one_line(text):
    with pytest.raises(PRTError, match="method: ") as caught:
        named_settings(text)
    assert "\n" not in str(caught.value)


def test_values_are_what_they_look_like_unless_text_is_wanted():
    result = [read_setting(text) for text in ("7", "0.5", "none", "True", "false", "d4")]
    assert result == [7, 0.5, None, True, False, "d4"]
    assert read_setting("none", "root") == "none" and read_setting("7", "root") == "7"


def test_settings_that_there_are_not_are_told_with_those_there_are():
    expect_settings("a", {"x": 1}, ("x", "y"))
    with pytest.raises(PRTError, match="method: 'a' has the settings x, y; got 'z'"):
        expect_settings("a", {"x": 1, "z": 2}, ("x", "y"))
    with pytest.raises(PRTError, match="method: 'a' has no settings; got 'x'"):
        expect_settings("a", {"x": 1}, ())
