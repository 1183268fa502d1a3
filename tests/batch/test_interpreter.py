"""A worker that is begun ahead is the first one of the pool, or leaves no trace."""

import psutil
import pytest

from replay.batch.interpreter import Ahead
from replay.batch.pool import Pool
from replay.batch.task import Ending, Task
from tests.batch.tasks import behave


def test_the_first_worker_is_the_one_that_was_begun_ahead():
    with Ahead((), rrd=False) as ahead:
        begun = ahead._begun.pid
        pids = [ended.value for ended in Pool(behave, workers=1, ahead=ahead).run([Task("a", ("pid", None))])]
        assert pids == [begun] and ahead.take() is None
    assert not psutil.pid_exists(begun)


def test_a_pool_that_needs_another_begins_it():
    with Ahead((), rrd=False) as ahead:
        begun = ahead._begun.pid
        tasks = [Task("dies", ("exit", 3), cost=2.0), Task("lives", ("pid", None))]
        ended = {one.task.name: one for one in Pool(behave, workers=1, ahead=ahead).run(tasks)}
    assert ended["dies"].ending is Ending.CRASHED
    assert ended["lives"].ending is Ending.DONE and ended["lives"].value != begun


def test_one_that_nobody_takes_is_gone_with_its_context():
    with pytest.raises(KeyboardInterrupt), Ahead((), rrd=True) as ahead:
        begun = ahead._begun.pid
        raise KeyboardInterrupt
    assert not psutil.pid_exists(begun)


def test_what_it_cannot_load_does_no_harm(monkeypatch):
    monkeypatch.setattr("replay.batch.interpreter._OF_ALL", ("no.such.module", "replay.errors"))
    with Ahead((), rrd=False) as ahead:
        (ended,) = Pool(behave, workers=1, ahead=ahead).run([Task("a", ("return", 7))])
    assert ended.value == 7
