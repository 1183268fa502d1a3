"""Which pairs are planned."""

from fnmatch import fnmatchcase

import numpy as np
import pytest

from replay.collision.pairs import CollisionBody, DisabledPair, PairRules, plan, plan_pairs
from replay.errors import InvalidValue
from replay.geometry.primitives import cube
from replay.kinematics.linkage import Joint, JointType, Link, Linkage


def arm():
    """Return a stand with an arm, a fixed cover on the arm, a tool on the cover, and a table."""

    def link(name, parent, kind):
        return Link(name, parent, np.identity(4), Joint(name, kind))

    return Linkage(
        [
            link("stand", None, JointType.FIXED),
            link("arm", "stand", JointType.REVOLUTE),
            link("cover", "arm", JointType.FIXED),
            link("tool", "cover", JointType.FIXED),
            link("table", None, JointType.FIXED),
        ]
    )


def bodies(linkage, *names):
    return [CollisionBody(name, linkage.link_index(name.split("/")[0]), cube(1.0)) for name in names]


ALL = ("stand/base", "arm/upper", "arm/lower", "cover/shell", "tool/tip", "table/top")


def test_pairs_are_all_but_one_link_and_adjacent_links():
    linkage = arm()
    pairs = plan_pairs(bodies(linkage, *ALL), linkage)
    assert [pair.name for pair in pairs] == sorted(pair.name for pair in pairs)
    assert {pair.name: pair.static for pair in pairs} == {
        "arm/lower|table/top": False,
        "arm/lower|tool/tip": True,
        "arm/upper|table/top": False,
        "arm/upper|tool/tip": True,
        "cover/shell|stand/base": False,
        "cover/shell|table/top": False,
        "stand/base|table/top": True,
        "stand/base|tool/tip": False,
        "table/top|tool/tip": False,
    }
    names = [ALL[pair.a] + "|" + ALL[pair.b] for pair in pairs]
    assert names == [pair.name for pair in pairs]


def test_disabled_pairs_match_links_and_shapes_and_report_what_matches_nothing():
    linkage = arm()
    rules = [
        DisabledPair("table", "arm/*", "far away"),
        DisabledPair("t?ol", "*", "thin"),
        DisabledPair("tabel", "arm", "misspelt"),
        DisabledPair("arm/upper", "arm/lower", "one link: never a pair"),
    ]
    planned = plan(bodies(linkage, *ALL), linkage, disabled=rules)
    assert [pair.name for pair in planned.pairs] == [
        "cover/shell|stand/base",
        "cover/shell|table/top",
        "stand/base|table/top",
    ]
    assert planned.unmatched == (rules[2], rules[3])


def test_many_rules_leave_out_what_each_says():
    """Against every rule asked about every pair; rules that share sides, hold few pairs or many, or match nothing."""
    rng = np.random.default_rng(3)
    names = [f"{a}{k}" for a in "abc" for k in range(12)]
    joint = JointType.FREE
    linkage = Linkage([Link(name, None, np.identity(4), Joint(f"j{name}", joint)) for name in names])
    several = [
        CollisionBody(f"{name}/{shape}", linkage.link_index(name), cube(1.0)) for name in names for shape in ("s", "t")
    ]
    patterns = ["a*", "*", "b1?", "c[135]", "a0/*", "*/t", "b3", "b3/s", "none", "[!a]*/s", "c7/t", "a1", "a2"]
    for _ in range(30):
        rules = [DisabledPair(*rng.choice(patterns[2:], 2), "") for _ in range(rng.integers(0, 25))]
        rules += [DisabledPair("a*", "a*", "")] * int(rng.integers(0, 2))
        asked = PairRules(several, linkage, disabled=rules)
        fits = {p: {k for k, body in enumerate(several) if fits_either(body, p)} for p in patterns}
        missed = []
        for rule in rules:
            pairs = {(a, b) for a in fits[rule.a] for b in fits[rule.b] if several[a].link != several[b].link}
            if not pairs:
                missed.append(rule)
        assert asked.unmatched() == tuple(missed)
        everyone = np.arange(len(several))
        for a in everyone:
            expected = [
                several[a].link != several[b].link
                and not any(
                    (a in fits[rule.a] and b in fits[rule.b]) or (b in fits[rule.a] and a in fits[rule.b])
                    for rule in rules
                )
                for b in everyone
            ]
            assert asked.tested(int(a), everyone).tolist() == expected


def fits_either(body, pattern):
    return fnmatchcase(body.name, pattern) or fnmatchcase(body.name.split("/")[0], pattern)


def test_names_are_unique():
    linkage = arm()
    with pytest.raises(InvalidValue, match="unique"):
        plan_pairs(bodies(linkage, "arm/upper", "arm/upper"), linkage)
