"""What is told while kernels are compiled: it moves, it ends with one line, and moments are not mentioned."""

import sys
import threading

import numba
from numba.core import event

from replay.numerics.compiling import Compiling
from replay.numerics.jit.progress import OnStderr, Progress

LONG = 3600.0  # seconds, longer than any test


class Told(list):
    """What was told, and a way to wait for it."""

    def __init__(self):
        super().__init__()
        self.happened = threading.Event()

    def __call__(self, state):
        self.append(state)
        self.happened.set()


class Dispatcher:
    def __init__(self, function):
        self.py_func = function


def count_one(progress, function):
    data = {"dispatcher": Dispatcher(function)}
    progress.notify(event.Event("numba:compile", event.EventStatus.START, data=data))
    progress.notify(event.Event("numba:compile", event.EventStatus.END, data=data))


def test_it_moves_and_ends_with_one_line():
    told = Told()
    progress = Progress(told, patience=0.0)
    progress.begin(3, elsewhere=lambda: 1)
    assert told.happened.wait(LONG)
    count_one(progress, test_it_moves_and_ends_with_one_line)
    count_one(progress, numba.njit)  # numba's own functions do not count
    progress.end()
    assert (told[0].done, told[0].total, told[0].ended) == (1, 3, False)
    assert (told[-1].done, told[-1].ended) == (2, True)
    assert sum(state.ended for state in told) == 1


def test_moments_are_not_mentioned():
    told = Told()
    progress = Progress(told, patience=LONG)
    for _ in range(3):
        progress.begin(1)
        progress.end()
    assert not told


def test_batches_within_a_batch_are_one():
    told = Told()
    progress = Progress(told, patience=0.0)
    progress.begin(5)
    progress.begin(2)
    progress.end()
    assert told.happened.wait(LONG)
    progress.end()
    assert {state.total for state in told} == {5}
    assert [state.ended for state in told].count(True) == 1


def test_lines_on_stderr_come_now_and_then_and_the_last_always(capsys):
    show = OnStderr()
    for done in range(4):
        show(Compiling(done, 4, 0.5 * done))
    show(Compiling(4, 4, 2.0, ended=True))
    assert capsys.readouterr().err.splitlines() == [
        "replay: compiling kernels: 0 of 4, 0 s",
        "replay: compiled 4 kernels in 2.0 s; they are kept",
    ]


def test_a_terminal_has_one_line_that_is_written_over(capsys, monkeypatch):
    show = OnStderr()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    show(Compiling(1, 4, 1.0))
    show(Compiling(1, 1, 2.0, ended=True))
    text = capsys.readouterr().err
    assert text.count("\r") == 2
    assert text.endswith("replay: compiled 1 kernel in 2.0 s; they are kept\n")
    assert text.count("\n") == 1


def test_compiling_is_told_and_loading_is_not(package):
    code = "import replay.numerics.jit.progress as p; p.counted()._patience = 0.0; outer(1.0)"
    process = package.start(code)
    said = process.communicate()[1]
    assert "compiled 2 kernels in" in said, said
    assert package.start(code).communicate()[1] == ""
