"""What is seen on stderr while a run goes on."""

import io
import re
import sys
import threading

import pytest

from replay.batch.case import CaseResult, CaseStatus
from replay.cli import interruption, terminal
from replay.cli.progress import RunProgress
from replay.numerics.compiling import Compiling


def test_kernels_are_counted_while_they_are_compiled_and_told_in_one_line_at_the_end(capsys):
    with RunProgress() as progress:
        progress.plan({"a": 1.0})
        progress.prepare(Compiling(1, 9, 2.0))
        progress.prepare(Compiling(4, 9, 3.0))  # of another worker; lines come every five seconds
        progress.prepare(Compiling(3, 9, 4.0))
        progress.follow("a", 0, 0)
        progress.follow("a", 1, 2)
    assert capsys.readouterr().err.splitlines() == [
        "replay: compiling kernels: 1 of 9, 2 s",
        "replay: compiled 9 kernels in 4.0 s; they are kept",
    ]


def test_nothing_is_told_where_nothing_is_compiled(capsys):
    with RunProgress() as progress:
        progress.plan({"a": 1.0})
        progress.follow("a", 0, 0)
    assert capsys.readouterr().err == ""


def test_a_log_has_a_line_every_few_seconds_and_one_for_each_scenario_that_fails(capsys):
    names = [f"s{k}" for k in range(1000)]
    with RunProgress() as progress:
        progress.plan(dict.fromkeys(names, 1.0))
        for name in names:
            status = CaseStatus.BROKEN if name in ("s100", "s500") else CaseStatus.PASSED
            progress.done(CaseResult(name, status, seconds=0.1))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("replay: [1/1000] s0: passed in 0.1 s")
    assert lines[-1].startswith("replay: [1000/1000] s999: passed in 0.1 s")
    assert [line.split()[2] for line in lines if "broken" in line] == ["s100:", "s500:"]
    assert len(lines) < 20


@pytest.mark.parametrize(
    "tell",
    [
        lambda progress: progress.plan({"a": 1.0}),
        lambda progress: progress.prepare(Compiling(1, 9, 2.0)),
        lambda progress: progress.follow("a", 1, 2),
        lambda progress: progress.done(CaseResult("a", CaseStatus.PASSED, seconds=0.1)),
        lambda progress: progress.compare("a"),
        lambda progress: progress.check(),
    ],
    ids=["plan", "prepare", "follow", "done", "compare", "check"],
)
def test_a_request_to_stop_that_native_code_lost_ends_a_run_at_the_next_news(monkeypatch, tell):
    requested = threading.Event()
    monkeypatch.setattr(interruption, "_requested", requested)
    with RunProgress() as progress:
        requested.set()
        with pytest.raises(KeyboardInterrupt):
            tell(progress)


def clock(monkeypatch, *times):
    """Let the time be what is set: a list of one number of seconds."""
    now = [times[0]]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    return now


def test_time_left_goes_by_what_scenarios_cost_and_not_by_their_number(monkeypatch, capsys):
    now = clock(monkeypatch, 1000.0)
    with RunProgress() as progress:
        progress.plan({"a": 1.0, "b": 2.0, "c": 3.0, "d": 0.01, "e": 6.0})
        now[0] += 500.0  # kernels are compiled: no time of scenarios
        for name, seconds in (("a", 60.0), ("b", 30.0), ("c", 30.0), ("e", 18.0), ("d", 3.0)):
            progress.follow(name, 0, 0)
            now[0] += seconds
            progress.done(CaseResult(name, CaseStatus.PASSED, seconds=seconds))
    assert capsys.readouterr().err.splitlines() == [
        "replay: [1/5] a: passed in 60.0 s, 1 a minute, about 11 min left",  # 11.01 of 1
        "replay: [2/5] b: passed in 30.0 s, 1 a minute, about 5 min left",  # 9.01 of 3, in 90 s
        "replay: [3/5] c: passed in 30.0 s, 2 a minute, about 2 min left",  # 6.01 of 6, in 120 s
        "replay: [4/5] e: passed in 18.0 s, 2 a minute, less than a minute left",
        "replay: [5/5] d: passed in 3.0 s",
    ]


def test_of_scenarios_that_pass_one_line_is_told_in_five_seconds(monkeypatch, capsys):
    now = clock(monkeypatch, 1000.0)
    with RunProgress() as progress:
        progress.plan(dict.fromkeys("abcdef", 1.0))
        for name, seconds in zip("abcde", (0.0, 4.9, 0.1, 4.9, 0.1), strict=True):
            now[0] += seconds
            progress.done(CaseResult(name, CaseStatus.PASSED, seconds=seconds))
    assert [line.split()[2] for line in capsys.readouterr().err.splitlines()] == ["a:", "c:", "e:"]


def test_one_scenario_alone_has_no_line(capsys):
    with RunProgress() as progress:
        progress.plan({"a": 1.0})
        progress.done(CaseResult("a", CaseStatus.BROKEN, seconds=1.0))
    assert capsys.readouterr().err == ""


@pytest.fixture
def drawn(monkeypatch):
    """What a terminal shows last of a progress to which something happens: a list of lines without bars and times."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "200")

    def last(happen):
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", terminal.Door(screen))
        with RunProgress() as progress:
            progress.plan(dict.fromkeys("abcd", 1.0))
            happen(progress)
        frames = re.split(r"\x1b\[\d*[AK]", screen.getvalue())  # each begins where the cursor went up
        plain = [re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", frame) for frame in frames]
        lines = next(frame for frame in reversed(plain) if frame.strip()).splitlines()
        return [re.sub(r"[━╸╺\s]+", " ", line).rsplit(" ", 1)[0].strip() for line in lines if line.strip()]

    return last


def test_a_terminal_shows_how_far_all_and_those_that_run_are(drawn):
    def two_run(progress):
        progress.follow("a", 3, 7)
        progress.follow("b", 0, 0)
        progress.follow("a", 5, 7)

    assert drawn(two_run) == ["scenarios: 0 failed, 2 running 0/4", "a 5/7", "b 0/?"]

    def one_fails(progress):
        two_run(progress)
        progress.done(CaseResult("a", CaseStatus.CRASHED, seconds=1.0))

    assert [re.sub(", [^,]* a minute.*left", "", line) for line in drawn(one_fails)] == [
        "scenarios: 1 failed, 1 running 1/4",
        "b 0/?",
    ]


def test_a_terminal_shows_kernels_until_scenarios_run(drawn):
    def compiling(progress):
        progress.prepare(Compiling(1, 9, 2.0))
        progress.prepare(Compiling(4, 9, 2.0))

    assert drawn(compiling) == ["scenarios 0/4", "compiling kernels 4/9"]

    def compiled(progress):
        compiling(progress)
        progress.follow("a", 0, 0)

    assert drawn(compiled)[-2:] == ["scenarios: 0 failed, 1 running 0/4", "a 0/?"]


def test_a_terminal_shows_what_is_compared(drawn):
    assert drawn(lambda progress: progress.compare("a")) == ["comparing a 0/4"]
