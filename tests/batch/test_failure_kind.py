"""Failures with one cause are one group, whatever paths, numbers and names their messages have."""

from pathlib import Path

import pytest

from replay.batch import failure_kind, raised
from replay.batch.case import CaseResult, CaseStatus
from replay.batch.groups import groups
from replay.batch.judge import unjudged

ALIKE = {
    "places of files": (
        "in/a.yaml:3:5: links.arm: its parent is not there",
        "/srv/my night 7/in/other b.yaml:112:1: links.forearm: its parent is not there",
        "C:\\nights\\c.yaml:1: links.leg_2: its parent is not there",
    ),
    "numbers": (
        "stopped: 512 MiB of memory are above the limit 400 MiB",
        "stopped: 1024 MiB of memory are above the limit 400 MiB",
        "stopped: 600.5 MiB of memory are above the limit 1e3 MiB",
    ),
    "amounts of one and of many": (
        "part.stl: 1 triangle is degenerate",
        "meshes/other part.stl: 12 triangles are degenerate",
    ),
    "names in quotes": (
        "joint 'lift': position = 3.1 m at t = 0.5 s is above the upper limit 2.9 m",
        "joint 'arm of the stand': position = -inf m at t = 1e-05 s is above the upper limit 3 m",
    ),
    "names of pairs, and of numbered parts": (
        "no proof for person/body | forearm/tube in frame 7",
        "no proof for leg_2/shin | tube17 in frame 12",
    ),
    "addresses and digests": (
        "the file has the digest 9f86d081884c7d65 and not 60303ae22b998861",
        "the file has the digest abcdef0123456789 and not 1",
    ),
    "what was raised at one place of the code": (
        "KeyError: 'arm' (replay/scenario/links.py:88)",
        "KeyError: (3, 'leg') (replay/scenario/links.py:88)",
    ),
    "the scenario's own name": ("it is alpha that stopped at night", "it is my beta that stopped at night"),
}
APART = (
    "the process was ended by SIGSEGV",
    "the process was ended by SIGKILL; the system may have run out of memory",
    "KeyError: 'arm' (replay/scenario/links.py:88)",
    "KeyError: 'arm' (replay/scenario/links.py:90)",
    "ValueError: 'arm' (replay/scenario/links.py:88)",
    "part.stl: holds no triangles",
    "part.stl: no such file",
    "joint 'lift': position = 3 m at t = 1 s is above the upper limit 2 m",
    "joint 'lift': velocity = 3 m/s at t = 1 s is above the upper limit 2 m/s",
)
NAMES = ("alpha", "my beta", "c_7[arm=3 deg]")


def failed(messages, status=CaseStatus.CRASHED):
    return [unjudged(name, CaseResult(name, status, error=message)) for name, message in messages.items()]


@pytest.mark.parametrize("messages", ALIKE.values(), ids=ALIKE)
def test_what_is_a_scenarios_own_does_not_split_a_group(messages):
    assert len(groups(failed(dict(zip(NAMES, messages, strict=False))))) == 1


def test_what_is_said_keeps_causes_apart():
    found = groups(failed({f"s{k}": message for k, message in enumerate(APART)}))
    assert {group.name for group in found} == {f"crashed: {message}" for message in APART}


def test_one_way_to_fail_is_not_another():
    items = [*failed({"a": "no room"}), *failed({"b": "no room"}, CaseStatus.FAILED)]
    assert {group.name for group in groups(items)} == {"crashed: no room", "failed: no room"}


def test_a_group_is_named_by_what_its_messages_have_in_common():
    (group,) = groups(failed(dict(zip(NAMES, ALIKE["names in quotes"][:1] * 3, strict=True))))
    assert group.name == f"crashed: {ALIKE['names in quotes'][0]}"
    several = {f"s{k}": f"joint 'lift': position = {k}.5 m at t = 1 s is above the upper limit 2 m" for k in range(9)}
    (group,) = groups(failed(several))
    assert group.name == "crashed: joint 'lift': position = ... m at t = 1 s is above the upper limit 2 m"


@pytest.mark.parametrize("name", ["process", "the", "a", "e", "...", "#", "(", ""])
def test_a_scenario_called_like_a_word_of_the_message_stays_with_the_others(name):
    messages = dict.fromkeys((name, "other", "third"), "the process was ended by SIGSEGV")
    assert set(failure_kind.kinds(messages).values()) == {"the process was ended by SIGSEGV"}


def test_three_hundred_failures_of_four_causes():
    def message(k):
        return (
            f"/nights/night {k}/in/s_{k}.stl: {k + 1} triangle{'s' if k else ''} {'are' if k else 'is'} degenerate",
            f"IndexError: index {k} is out of bounds for axis 0 (replay/collision/pairs.py:120)",
            "the process was ended by SIGSEGV",
            f"stopped: still running after the time limit of {k}.5 s",
        )[k % 4]

    found = groups(failed({f"s{k}": message(k) for k in range(300)}))
    assert sorted(len(group.members) for group in found) == [75] * 4
    assert {group.name.split()[1] for group in found} == {"/nights/night", "IndexError:", "the", "stopped:"}


def test_messages_that_say_nothing():
    assert [group.name for group in groups(failed({"a": "", "b": ""}))] == ["crashed"]


class Fails(dict):
    """Raises an error when it is asked."""

    def __init__(self, error):
        super().__init__()
        self.error = error

    def items(self):
        raise self.error


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (KeyError("arm"), "KeyError: 'arm' (replay/batch/failure_kind.py:NUMBER)"),
        (ValueError("two\n lines"), "ValueError: two lines (replay/batch/failure_kind.py:NUMBER)"),
        (AssertionError(), "AssertionError (replay/batch/failure_kind.py:NUMBER)"),
        (MemoryError("no room"), "MemoryError: no room"),
    ],
)
def test_an_error_that_nobody_has_foreseen_tells_where_it_was_raised(error, line):
    source = Path(failure_kind.__file__).read_text().splitlines()
    number = next(k for k, text in enumerate(source, start=1) if "in messages.items()}" in text)
    with pytest.raises(type(error)) as caught:
        failure_kind.kinds(Fails(error))
    assert raised.told(caught.value) == line.replace("NUMBER", str(number))


def test_an_error_that_others_raise_is_told_as_it_is():
    with pytest.raises(ZeroDivisionError) as caught:
        1 / 0  # noqa: B018
    assert raised.told(caught.value) == "ZeroDivisionError: division by zero"
