"""Which pairs are planned."""

import numpy as np
import pytest

from replay.collision.pairs import CollisionBody, DisabledPair, plan, plan_pairs
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


def test_names_are_unique():
    linkage = arm()
    with pytest.raises(InvalidValue, match="unique"):
        plan_pairs(bodies(linkage, "arm/upper", "arm/upper"), linkage)
