"""A scenario's name becomes the name of files, everywhere."""

import pytest
from pydantic import TypeAdapter, ValidationError

from replay.language.fields import Title, is_title

TITLE = TypeAdapter(Title)


@pytest.mark.parametrize(
    "name", ["carm", "<script>", "a b", "x" * 100, "é" * 100, "🦴" * 50, "a:b", "contact", "null", "👩\u200d⚕️"]
)
def test_names_that_every_file_system_takes(name):
    assert TITLE.validate_python(name) == name
    assert is_title(name)


@pytest.mark.parametrize(
    "name", ["", ".hidden", "a/b", "a\\b", "a\nb", "x" * 101, "🦴" * 51, "CON", "nul.x", "com1 ", "a ", " a", "a."]
)
def test_names_that_some_file_system_refuses(name):
    with pytest.raises(ValidationError):
        TITLE.validate_python(name)
    assert not is_title(name)


@pytest.mark.parametrize("mark", ["\u202e", "\u2066", "\u200f", "\u200b", "\u2028", "\ufeff"])
def test_names_that_look_like_others(mark):
    with pytest.raises(ValidationError, match=f"U\\+{ord(mark):04X}"):
        TITLE.validate_python(f"carm{mark}near")
