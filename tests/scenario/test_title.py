"""A scenario's name becomes the name of files, everywhere."""

import pytest
from pydantic import TypeAdapter, ValidationError

from replay.scenario.fields import Title

TITLE = TypeAdapter(Title)


@pytest.mark.parametrize("name", ["carm", "<script>", "a b", "x" * 100, "é" * 100, "🦴" * 50])
def test_names_that_every_file_system_takes(name):
    assert TITLE.validate_python(name) == name


@pytest.mark.parametrize("name", ["", ".hidden", "a/b", "a\\b", "a\nb", "x" * 101, "🦴" * 51])
def test_names_that_some_file_system_refuses(name):
    with pytest.raises(ValidationError):
        TITLE.validate_python(name)
