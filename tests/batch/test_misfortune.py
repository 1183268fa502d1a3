"""Kills and encounters: nothing is lost, nothing mixed, and no report says what is not so."""

import os
import random
import signal
import time

import pytest

from tests.batch.clusters import cluster
from tests.batch.misfortune import VERSIONS, Workplace

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")

KINDS = ("run overwrite", "run resume", "regress", "regress resume", "accept")
LONGEST = {"accept": 1.5}
"""Seconds within which a command is struck; many more in the longer ones, which most of them are."""
CARRIED_ON = 20
"""Commands that are struck, one after another, before everything has to come to its end."""


def strike_many(place, times, seed, *, dask=None):
    """Start commands, each where the last has left off, and kill them at any moment."""
    rng = random.Random(seed)
    pace = 1.0  # how long a command takes here and now, compared with an idle machine
    more = () if dask is None else ("--dask", dask.address)
    crew = "worker" if dask is None else [worker.pid for worker in dask.workers]
    kinds = KINDS if dask is None else KINDS[:4]
    for k in range(times):
        kind, version = rng.choice(kinds), rng.choice(list(VERSIONS))
        process = place.start(kind, version, *(more if kind != "accept" else ()))
        begin = time.monotonic()
        time.sleep(rng.random() * LONGEST.get(kind, 4.0) * pace)
        number = rng.choice([signal.SIGTERM, signal.SIGKILL])
        place.strike(process, number, rng.choice(["command", "command", crew]), rng)
        ended = place.end(process)
        if ended.code in (0, 1, 4):
            pace = 0.5 * pace + 0.5 * (time.monotonic() - begin) / LONGEST.get(kind, 4.0)
        place.check(ended)
        if k % CARRIED_ON == CARRIED_ON - 1:
            place.settle(rng.choice(list(VERSIONS)))
    place.settle("new")


ENCOUNTERS = [
    ("run overwrite", "run overwrite"),
    ("run overwrite", "run resume"),
    ("run overwrite", "regress"),
    ("regress", "regress resume"),
    ("regress", "accept"),
    ("accept", "accept"),
    ("run resume", "accept out"),
    ("accept out", "accept"),
    ("run overwrite", "diff"),
    ("regress", "diff"),
]


def let_meet(place, pairs, seed):
    """Start two commands at about the same time in the same folders."""
    rng = random.Random(seed)
    refused = 0
    for kinds in pairs:
        processes = []
        for kind, version in zip(rng.sample(kinds, 2), rng.sample(list(VERSIONS), 2), strict=True):
            processes.append(place.start(kind, version))
            time.sleep(rng.random() * 0.5)
        ended = [place.end(process) for process in processes]
        place.check(*ended)
        for one in ended:
            busy = "is in use by process" in one.said
            refused += busy
            assert one.code in (0, 1, 2, 4), one
            if one.code == 2 and one.kind not in ("diff", "accept out"):
                assert busy, one
    place.settle("old")
    return refused


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Workplace(tmp_path_factory.mktemp("place"))


def test_commands_that_are_killed_lose_and_mix_nothing(place):
    strike_many(place, 6, seed=1)


def test_commands_that_meet_in_one_folder_lose_and_mix_nothing(place):
    let_meet(place, [ENCOUNTERS[0], ENCOUNTERS[5]], seed=1)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(4))
def test_a_hundred_commands_that_are_killed(place, seed):
    strike_many(place, 100, seed=100 + seed)


@pytest.mark.soak
def test_a_hundred_commands_that_are_killed_on_a_cluster(place, tmp_path):
    with cluster(tmp_path, workers=1) as dask:
        strike_many(place, 100, seed=200, dask=dask)


@pytest.mark.soak
def test_a_hundred_pairs_of_commands_that_meet(place):
    assert let_meet(place, ENCOUNTERS * 10, seed=300) > 20
