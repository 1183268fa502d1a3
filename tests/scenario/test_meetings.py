"""Expectations of pairs, of what lies between the frames."""

from __future__ import annotations

import numpy as np
import pytest

from replay.collision.columns import Between, CollisionColumns, Crossings, Level
from replay.scenario.expectation_check import ExpectationCheck
from replay.scenario.layout import Layout
from replay.scenario.load import load_sources
from replay.scenario.meetings import shown
from replay.scenario.unseen import Unseen

PAIRS = ("cube/a|plate/b", "cube/a|post/c")
LAYOUT = Layout(links=("cube", "plate", "post"), pairs=PAIRS)
TEXT = """version: 1
name: a
rate: 10
duration: 1
collision: {{margin: 0.5}}
links:
  cube: {{shapes: {{a: {{type: cube, size: 1}}}}}}
  plate: {{shapes: {{b: {{type: cube, size: 1}}}}}}
  post: {{shapes: {{c: {{type: cube, size: 1}}}}}}
expect: [{}]
"""
FRAMES = 11
TIME = np.arange(FRAMES, dtype=np.int64) * 100_000_000
Row = tuple[int, int, bool, float]
"""Pair, level, whether it begins, and when [s]: the bracket is 1 us around it."""


def crossings(rows: list[Row]) -> Crossings:
    rows = sorted(rows, key=lambda row: (row[3], row[0]))
    at = np.array([round(row[3] * 1e9) for row in rows], dtype=np.int64)
    pair, level, begins = (np.array([row[k] for row in rows]) for k in range(3))
    return Crossings(
        pair.astype(np.int64),
        level.astype(np.uint8),
        begins.astype(bool),
        at - 400,
        at + 600,
        np.searchsorted(TIME, at + 600),
    )


def part_of(found: Crossings, first: int, end: int) -> Crossings:
    mine = (found.frame >= first) & (found.frame < end)
    values = (found.pair, found.level, found.begins, found.earliest, found.latest, found.frame)
    return Crossings(*(value[mine] for value in values))


def blocks(
    contact: list[tuple[int, int]], rows: list[Row], undecided: list[tuple[int, int]], size: int, looked: bool = True
):
    """Yield blocks in which pairs are in contact at some (frame, pair), and cross at others."""
    level = np.zeros((FRAMES, 2), dtype=np.uint8)
    between = np.full((FRAMES, 2), Between.CLEAR, dtype=np.uint8)
    bound = np.full((FRAMES, 2), 0.125)
    for frame, pair in contact:
        level[frame, pair] = Level.CONTACT
        between[frame : frame + 2, pair] = Between.CONTACT
    found = crossings(rows)
    mine = found.level == Level.CONTACT
    between[found.frame[mine], found.pair[mine]] = Between.CONTACT
    for frame, pair in undecided:
        between[frame, pair] = Between.UNDECIDED
    bound[between > 0] = 0.0
    between[0], bound[0] = Between.NOT_LOOKED, np.nan
    if not looked:
        between[:], bound[:], found = Between.NOT_LOOKED, np.nan, Crossings.none()
    clearance = np.where(level == Level.CONTACT, 0.0, 0.25)
    for first in range(0, FRAMES, size):
        rows_ = slice(first, first + size)
        count = len(TIME[rows_])
        yield (
            TIME[rows_],
            CollisionColumns(
                level[rows_],
                clearance[rows_],
                np.ones((count, 2), dtype=bool),
                np.zeros((count, 2), dtype=bool),
                between[rows_],
                bound[rows_],
                part_of(found, first, first + size),
            ),
        )


TUNNEL: list[Row] = [(0, 2, True, 0.46), (0, 2, False, 0.49)]
AGAIN: list[Row] = [*TUNNEL, (1, 2, True, 0.76), (1, 2, False, 0.78)]
SEEN: list[Row] = [(0, 2, True, 0.46), (0, 2, False, 0.71)]
HANDED: list[Row] = [(0, 2, False, 0.42), (1, 2, True, 0.47)]
KEPT: list[Row] = [(1, 2, True, 0.42), (0, 2, False, 0.47)]
NEVER, ALWAYS = "{pair: [cube, '*'], contact: never}", "{pair: [cube, '*'], contact: always}"
SOMETIMES = "{pair: [cube, '*'], contact: sometimes}"
CLEARANCE = "{pair: [cube, '*'], clearance: {min: 0.2}}"
FIRST, SECOND = [(k, 0) for k in range(5)], [(k, 1) for k in range(5, FRAMES)]


def within(begin: float, end: float) -> str:
    return f"{{pair: [cube, '*'], contact: {{between: [{begin}, {end}]}}}}"


@pytest.mark.parametrize("size", [1, 3, 5, 11])
@pytest.mark.parametrize(
    ("expectation", "contact", "rows", "undecided", "passed", "detail"),
    [
        (NEVER, [], [], [], True, "contact in 0 of 11 frames"),
        (NEVER, [], TUNNEL, [], False, "contact between frames 4 and 5, @ first at 0.46 s, until 0.49 s"),
        (NEVER, [], AGAIN, [], False, "contact between frames 4 and 5 and once more, @ first at 0.46 s, until 0.49 s"),
        (NEVER, [(5, 0), (6, 0), (7, 0)], SEEN, [], False, "contact in 3 of 11 frames, @ first at 0.46 s"),
        (
            NEVER,
            [(9, 1)],
            TUNNEL,
            [],
            False,
            "contact in 1 of 11 frames and between frames 4 and 5, @ first at 0.46 s, until 0.49 s",
        ),
        (NEVER, [], [], [(5, 1)], False, "contact in 0 of 11 frames, not proven between frames 4 and 5"),
        (
            NEVER,
            [],
            [],
            [(5, 1), (9, 0)],
            False,
            "contact in 0 of 11 frames, not proven between frames 4 and 5 and once more",
        ),
        ("{pair: [cube, post], contact: never}", [], TUNNEL, [(3, 0)], True, "contact in 0 of 11 frames"),
        (SOMETIMES, [], TUNNEL, [], True, "contact between frames 4 and 5, @ first at 0.46 s, until 0.49 s"),
        (SOMETIMES, [], [], [(5, 1)], False, "contact in 0 of 11 frames"),
        (within(0.46, 0.5), [], TUNNEL, [], True, "contact of @ begins at 0.46 s"),
        (within(0.45, 0.46), [], TUNNEL, [], True, "contact of @ begins at 0.46 s"),
        (within(0.47, 0.5), [(5, 0)], SEEN, [], False, "contact of @ begins at 0.46 s"),
        (within(0.46, 0.5), [], TUNNEL, [(8, 1)], True, "contact of @ begins at 0.46 s"),
        (
            within(0.46, 0.5),
            [],
            TUNNEL,
            [(2, 1)],
            False,
            "contact of @ begins at 0.46 s, not proven between frames 1 and 2",
        ),
        (within(0, 1), [], [], [(2, 1)], False, "contact in no frame, not proven between frames 1 and 2"),
        (ALWAYS, [(k, 0) for k in range(FRAMES)], [], [], True, "contact in 11 of 11 frames"),
        (ALWAYS, [*FIRST, *SECOND], HANDED, [], False, "contact in 11 of 11 frames, first not at 0.420001 s"),
        (ALWAYS, [*FIRST, *SECOND], KEPT, [], True, "contact in 11 of 11 frames"),
        (ALWAYS, FIRST, [], [], False, "contact in 5 of 11 frames, first not at 0.5 s"),
        (
            "{pair: [cube, plate], bounds: never}",
            [],
            [(0, 1, True, 0.46), (0, 1, False, 0.47)],
            [],
            False,
            "bounds meet between frames 4 and 5, @ first at 0.46 s, until 0.47 s",
        ),
        (
            CLEARANCE,
            [],
            [],
            [],
            True,
            "smallest clearance 0.25 m of @ at 0 s, proven at least 0.125 m between frames",
        ),
        (
            CLEARANCE,
            [],
            TUNNEL,
            [],
            False,
            "smallest clearance 0.25 m of @ at 0 s; 0 m between frames 4 and 5, @ first at 0.46 s",
        ),
        (CLEARANCE, [], [], [(3, 1)], False,
 "smallest clearance 0.25 m of @ at 0 s, not proven between frames 2 and 3"),
        (CLEARANCE, [(5, 0)], SEEN[:1], [], False, "smallest clearance 0 m of @ at 0.5 s"),
    ],
)  # fmt: skip
def test_what_lies_between_frames_counts(size, expectation, contact, rows, undecided, passed, detail):
    outcome = judged(expectation, blocks(contact, rows, undecided, size))
    assert (outcome.passed, outcome.detail) == (passed, detail.replace("@", "cube/a | plate/b"))


@pytest.mark.parametrize(
    ("expected", "rows", "value", "time", "margin"),
    [
        ("min: 0.2", [], 0.25, 0.0, 0.05),
        ("min: 0.3", [], 0.25, 0.0, -0.05),
        ("min: 0.2", TUNNEL, 0.0, 0.46, -0.2),  # on the wrong side of the limit by all of it
    ],
)
def test_a_clearance_as_a_number_is_none_where_bodies_meet_between_frames(expected, rows, value, time, margin):
    told = judged(f"{{pair: [cube, '*'], clearance: {{{expected}}}}}", blocks([], rows, [], 4)).measure
    assert (told.value, told.unit, told.subject) == (value, "m", "cube/a | plate/b")
    assert told.time == pytest.approx(time, abs=1e-6)
    assert (told.margin, told.limit) == (pytest.approx(margin, rel=1e-12), float(expected[5:]))


def judged(expectation, found):
    scenario = load_sources("f.yaml", {"f.yaml": TEXT.format(expectation).encode()})
    check = ExpectationCheck(scenario.expect, LAYOUT, margin=0.5, provenance=scenario.provenance)
    for time, collision in found:
        check.update(time, collision, {})
    (outcome,) = check.finish()
    return outcome


def test_frames_alone_prove_nothing_and_judge_as_before():
    outcome = judged(NEVER, blocks([], TUNNEL, [], 4, looked=False))
    assert (outcome.passed, outcome.detail) == (True, "contact in 0 of 11 frames")
    outcome = judged(CLEARANCE, blocks([], TUNNEL, [], 4, looked=False))
    assert (outcome.passed, outcome.detail) == (True, "smallest clearance 0.25 m of cube/a | plate/b at 0 s")


@pytest.mark.parametrize(
    ("bracket", "text"),
    [
        ((459_999_600, 460_000_600), "0.46 s"),
        ((0, 700), "0 s"),
        ((400, 900), "0.0000004 s"),
        ((999_999_999, 1_000_000_500), "1 s"),
        ((12_345_678_912, 12_345_679_012), "12.345679 s"),
        ((123, 124), "0.000000123 s"),
        ((500_000_000, 500_000_000), "0.5 s"),
        ((400_000_000, 500_000_000), "0.5 s"),
    ],
)
def test_a_moment_is_told_by_the_shortest_number_in_its_bracket(bracket, text):
    assert shown(bracket) == text


@pytest.mark.parametrize("size", [1, 4, 11])
def test_contacts_that_no_frame_shows_are_told_for_people(size):
    unseen = Unseen(LAYOUT)
    for _, collision in blocks([(9, 0)], [*AGAIN, (0, 2, True, 0.85), (0, 2, False, 0.95)], [(3, 1), (4, 1)], size):
        unseen.update(collision)
    assert unseen.lines() == (
        "contact between frames 4 and 5, from 0.46 s until 0.49 s: cube/a | plate/b",
        "contact between frames 7 and 8, from 0.76 s until 0.78 s: cube/a | post/c",
        "not proven in 2 intervals of a pair, first between frames 2 and 3: cube/a | post/c",
    )


def test_many_contacts_are_counted():
    unseen = Unseen(LAYOUT)
    rows = [(0, 2, k % 2 == 0, 0.401 + 0.002 * k) for k in range(46)]
    for _, collision in blocks([], rows, [], 11):
        unseen.update(collision)
    assert len(unseen.lines()) == 21
    assert unseen.lines()[-1] == "3 more contacts between frames"
