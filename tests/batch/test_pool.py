"""Tasks that crash, hang, eat memory or leave children do not disturb the others."""

import contextlib
import queue
import subprocess
import sys
import time

import psutil
import pytest

from replay.batch.interpreter import begin
from replay.batch.pool import Pool, _Worker
from replay.batch.task import Ending, Task
from replay.batch.worker import Ready, Start
from replay.errors import InvalidValue
from tests.batch.tasks import PrepareTogether, behave, eat_and_forget_nothing, slow_start


def run(tasks, **options):
    options = {"workers": 2, **options}
    return {ended.task.name: ended for ended in Pool(behave, **options).run(tasks)}


def children():
    return {process.pid for process in psutil.Process().children(recursive=True)}


def test_each_task_ends_as_it_must_and_the_others_go_on(tmp_path):
    before = children()
    left = tmp_path / "left"
    bad = {
        "raise": ("raise", "no"),
        "exit": ("exit", 3),
        "segfault": ("segfault", None),
        "eat": ("eat", None),
        "leave": ("leave a child", left),
    }
    tasks = [Task(name, payload, cost=2.0, log=tmp_path / f"{name}.txt") for name, payload in bad.items()]
    tasks += [Task(f"good{k}", ("return", k)) for k in range(5)]
    ended = run(tasks, timeout=300.0, memory=300 << 20)
    assert {name: e.ending for name, e in ended.items()} == {
        "raise": Ending.CRASHED,
        "exit": Ending.CRASHED,
        "segfault": Ending.CRASHED,
        "eat": Ending.MEMORY,
        "leave": Ending.CRASHED,
        **{f"good{k}": Ending.DONE for k in range(5)},
    }
    assert [ended[f"good{k}"].value for k in range(5)] == list(range(5))
    assert ended["raise"].reason == "ValueError: no"
    assert "exit code 3" in ended["exit"].reason
    assert "SIGSEGV" in ended["segfault"].reason
    assert "above the limit 300 MiB" in ended["eat"].reason
    assert ended["eat"].memory > 300 << 20
    assert "doing segfault" in (tmp_path / "segfault.txt").read_text()
    assert "Fatal Python error" in (tmp_path / "segfault.txt").read_text()
    assert "ValueError: no" in (tmp_path / "raise.txt").read_text()
    assert children() == before
    assert ends(int(left.read_text()))


def test_a_task_that_hangs_is_stopped_with_its_children_and_the_next_begins(tmp_path):
    before = children()
    child = tmp_path / "child"
    ended = run([Task("hang", ("hang with a child", child), cost=2.0), Task("good", ("return", 1))], timeout=3.0)
    assert ended["hang"].ending is Ending.TIMEOUT
    assert "time limit of 3 s" in ended["hang"].reason
    assert ended["good"].value == 1
    assert children() == before
    assert ends(int(child.read_text()))


def ends(pid):
    """Whether a process that was killed, which the system does in its own time, is dead within 10 s."""
    until = time.monotonic() + 10.0
    while not is_dead(pid) and time.monotonic() < until:
        time.sleep(0.01)
    return is_dead(pid)


def is_dead(pid):
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    return True


def test_time_limits_count_from_the_moment_a_worker_is_ready():
    said = []
    ended = run([Task("a", ("return", 1))], workers=1, timeout=0.5, prepare=slow_start, tell=said.append)
    assert ended["a"].ending is Ending.DONE
    assert ended["a"].seconds < 0.5
    assert said == ["preparing"]


def test_a_preparation_that_can_be_shared_is_shared_and_the_helpers_are_let_go(tmp_path):
    alive, states = [], []
    before = children()
    pool = Pool(
        behave, workers=1, helpers=2, prepare=PrepareTogether(tmp_path), preparing=states.append, follow=lambda *_: None
    )
    for ended in pool.run([Task(f"t{k}", ("pid", None)) for k in range(3)]):
        alive.append((ended.value, children() - before))
    assert len(list(tmp_path.iterdir())) == 2
    assert "waiting" in states
    assert len({worker for worker, _ in alive}) == 1  # one was asked for; the other helped, and is gone
    assert alive[-1][1] == {alive[-1][0]}
    assert children() == before


def test_workers_live_long_and_the_longest_task_begins_first():
    ended = run([Task(f"t{k}", ("pid", None), cost=k) for k in range(4)], workers=1)
    assert len({e.value for e in ended.values()}) == 1
    assert list(ended) == ["t3", "t2", "t1", "t0"]


def test_closing_the_iterator_ends_every_process():
    before = children()
    tasks = [Task("quick", ("return", 0), cost=2.0), *(Task(f"hang{k}", ("hang", None)) for k in range(3))]
    endings = Pool(behave, workers=2).run(tasks)
    assert next(endings).task.name == "quick"
    begin = time.monotonic()
    endings.close()
    assert time.monotonic() - begin < 5.0
    assert children() == before


def test_workers_do_not_outlive_a_pool_that_is_killed():
    code = (
        "from replay.batch.pool import Pool; from replay.batch.task import Task; from tests.batch.tasks import behave;"
        "list(Pool(behave, workers=1, follow=lambda *_: print('on', flush=True)).run([Task('a', ('hang', None))]))"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "on\n"
        family = psutil.Process(process.pid).children(recursive=True)
        process.kill()
    _, alive = psutil.wait_procs(family, timeout=10.0)
    assert family
    assert not alive


def test_memory_is_limited_also_where_a_task_is_over_before_anyone_looks():
    tasks = [Task("quick", ("eat for a moment", None), cost=3.0), Task("small", ("return", 1), cost=2.0)]
    tasks.append(Task("again", ("eat for a moment", None)))
    ended = run(tasks, workers=1, memory=300 << 20)
    assert {name: e.ending for name, e in ended.items()} == {
        "quick": Ending.MEMORY,
        "small": Ending.DONE,
        "again": Ending.MEMORY,
    }
    assert "above the limit 300 MiB" in ended["again"].reason
    assert ended["quick"].memory > 300 << 20
    assert 0 < ended["small"].memory < 300 << 20


def test_a_free_worker_may_keep_half_of_what_a_task_may_have():
    inbox = queue.SimpleQueue()
    worker = _Worker(Start(behave, None), inbox, begin(behave.__module__, ()))
    try:
        found, message = inbox.get(timeout=60.0)
        assert found is worker and message == Ready()
        worker.ready = True
        used = worker._resident()
        for share, broken in ((0.4, False), (0.6, True), (0.9, True), (1.1, True)):
            limit = worker.broken_limit(None, int(used / share))
            assert (limit is not None and limit[0] is Ending.MEMORY) == broken
        worker.task = Task("a", ("return", 1))
        for share, broken in ((0.6, False), (0.9, False), (1.1, True)):
            assert (worker.broken_limit(None, int(used / share)) is not None) == broken
        assert worker.broken_limit(None, None) is None
    finally:
        worker.stop()


def test_memory_that_could_not_be_watched_is_told():
    said = []
    tasks = [Task("small", ("return", 1), cost=2.0), Task("more", ("eat for a moment", None))]
    options = {"prepare": eat_and_forget_nothing, "tell": said.append, "workers": 1}
    ended = run(tasks, memory=300 << 20, **options)
    assert ended["small"].ending is Ending.DONE
    assert said[0] == "small: it was over before its memory could be watched"
    assert [e.ending for e in run(tasks, memory=900 << 20, **options).values()] == [Ending.DONE] * 2
    assert len(said) <= 2  # with that limit there is nothing to say


def test_an_answer_that_nobody_can_read_is_a_crash_and_not_a_hang():
    assert run([Task("odd", ("return", Unreadable()))], workers=1)["odd"].ending is Ending.CRASHED


class Unreadable:
    def __reduce__(self):
        return _fail_here, ()


def _fail_here():
    if "pytest" in sys.modules:
        raise AttributeError("no such thing")
    return Unreadable()


def test_limits_must_be_positive():
    with pytest.raises(InvalidValue, match="timeout = 0"):
        Pool(behave, workers=1, timeout=0)
