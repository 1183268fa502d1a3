"""What is said of keys: read below the fields of models and of what they were made from."""

from typing import Any

from pydantic import BaseModel, Field

from replay.language.descriptions import described
from replay.language.fields import Part, with_keys
from replay.scenario.links import AxisPart


class _Plain(Part):
    """A part."""

    size: float = 1.0
    """How large
    it is."""
    count: int = Field(default=1, description="How many there are.")
    """Not this."""
    bare: int = 0


class Later(_Plain):
    """One made from it, which says something else of a key."""

    size: float = 2.0
    """How long it is."""


def test_it_is_the_text_below_a_field_of_the_nearest_model_or_what_the_field_says_itself():
    assert described(_Plain, "size") == "How large\nit is."
    assert described(Later, "size") == "How long it is." and described(Later, "count") == "How many there are."
    assert [described(_Plain, key) for key in ("bare", "nothing")] == [None, None]
    made = with_keys(_Plain, more=(int, Field(default=0, description="More.")))
    assert described(made, "size") == "How large\nit is." and described(made, "more") == "More."


def test_a_model_without_source_has_none():
    space: dict[str, Any] = {"__name__": "nowhere", "BaseModel": BaseModel}
    exec("class Typed(BaseModel):\n    size: float = 1.0\n    'How large.'", space)
    assert described(space["Typed"], "size") is None


def test_every_key_of_the_language_that_has_one_has_it_in_the_schema():
    said = AxisPart.model_json_schema()["properties"]
    for key in AxisPart.model_fields:
        assert said[key].get("description") == described(AxisPart, key)
