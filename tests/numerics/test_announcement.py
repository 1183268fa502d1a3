"""Compiling is announced once it has taken longer than the patience, all kernels together, and only once."""

import threading

from numba.core import event

from replay.numerics.announcement import TEXT, Announcement

LONG = 3600.0  # seconds, longer than any test


def compile_once(announcement, wait=lambda: None):
    for notify in (announcement.on_start, announcement.on_start, announcement.on_end):  # a kernel, and its callee
        notify(event.Event("numba:compile", event.EventStatus.START))
    wait()
    announcement.on_end(event.Event("numba:compile", event.EventStatus.END))


def test_it_is_said_once_while_kernels_are_compiled():
    said, happened = [], threading.Event()
    announcement = Announcement(lambda text: (said.append(text), happened.set()), patience=0.0)
    compile_once(announcement, wait=lambda: happened.wait(LONG))
    compile_once(announcement)
    assert said == [TEXT]


def test_nothing_is_said_of_moments_until_they_add_up(monkeypatch):
    said, happened = [], threading.Event()
    announcement = Announcement(lambda text: (said.append(text), happened.set()), patience=LONG)
    clock = iter(range(0, 10**6, 1000))
    monkeypatch.setattr("replay.numerics.announcement.time.monotonic", lambda: float(next(clock)))
    for _ in range(3):
        compile_once(announcement)  # 1000 s each, by this clock
        assert not said
    compile_once(announcement)
    compile_once(announcement, wait=lambda: happened.wait(LONG))
    assert said == [TEXT]
