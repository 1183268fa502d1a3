"""A night holds all its scenarios at once: none of them holds the tree of its text, and each knows its places."""

from replay.language.node import Place
from tests.batch import scenes


def test_a_scenario_holds_its_text_packed_until_somebody_asks_where_something_is_written():
    provenance = scenes.scene("one").provenance
    assert "root" not in vars(provenance)
    assert len(provenance.tree) < 4096, "a tenth of what the tree takes as objects"
    assert provenance.place(("rate",)) == Place("one.yaml", 4, 7)
    assert provenance.problem(("duration",), "is too long").line == 5
