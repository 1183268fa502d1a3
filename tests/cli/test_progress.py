"""What is seen on stderr while a run goes on."""

from replay.batch.case import CaseResult, CaseStatus
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
