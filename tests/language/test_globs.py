"""Patterns of names."""

from replay.language.globs import Globs, any_of, fits, literal_glob

NAMES = ("arm/bar", "arm/hand", "Arm/bar", "a*", "arm/bar", "b[1]", "b1")


def test_a_glob_fits_whole_names_with_case():
    assert fits("arm/bar", "arm/*") and fits("b1", "b[0-9]") and fits("b1", "b?")
    assert not fits("Arm/bar", "arm/*") and not fits("xarm/bar", "arm/*") and not fits("b12", "b?")


def test_places_of_many_globs_are_those_that_fit_one_by_one():
    globs = Globs(NAMES)
    for pattern in ("arm/bar", "arm/*", "*", "b?", "b[1]", "nothing", "[Aa]rm/bar", "a*"):
        expected = tuple(place for place, name in enumerate(NAMES) if fits(name, pattern))
        assert globs.fitting(pattern) == expected == globs.fitting(pattern)
        assert [place for place, name in enumerate(NAMES) if any_of([pattern]).match(name)] == list(expected)
    assert globs.fitting("arm/bar") == (0, 4)
    both = any_of(["b?", "arm/hand"])
    assert [name for name in NAMES if both.match(name)] == ["arm/hand", "b1"]


def test_a_name_taken_literally_fits_itself_alone():
    for name in NAMES:
        assert Globs(NAMES).fitting(literal_glob(name)) == tuple(k for k, other in enumerate(NAMES) if other == name)
