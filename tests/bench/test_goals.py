"""A promise is changed by intention, and not to let a run pass."""

from replay.bench.goals import PROMISES

PROMISED = {
    "gjk.fcl": ">= 3 x",
    "gjk.coal": ">= 3 x",
    "gjk.wrong": "<= 0",
    "motion.fcl": ">= 10 x (stretch 30)",
    "motion.coal": ">= 10 x (stretch 30)",
    "cone.speed": ">= 10 x",
    "cone.error": "<= 1e-12",
    "plate.speed": ">= 100 x",
    "plate.error": "<= 1e-12",
    "plate.slivers": "<= 1e-08",
    "tree.6": ">= 20 x",
    "tree.4": ">= 100 x (stretch 500)",
    "tree.error": "<= 1.001",
    "field.worst": "<= 0.035",
    "field.median": "<= 0.01",
    "field.covered": ">= 0.95",
    "field.motions": "<= 0.035",
    "field.pace": ">= 1000 frames/s",
    "bem.worst": "<= 0.006",
    "pipeline.peer": ">= 100 x",
    "pipeline.real_time": ">= 5 x (stretch 20)",
    "recording.ratio": "<= 1.5 x",
    "recording.frame": "<= 100 us",
    "recording.all": "<= 100 us",
    "recording.short": "<= 100 us",
    "diff.equal": "<= 5 s",
    "diff.different": "<= 30 s",
    "diff.memory": "<= 1024 MiB",
    "start.help": "<= 0.4 s",
    "start.validate": "<= 1 s",
    "start.modules": "<= 0",
    "cold.kernels": ">= 2 x",
    "savings.same": "<= 0",
    "between.proven": ">= 0.9999",
    "between.wrong": "<= 0",
    "between.own": ">= 1 x",
    "between.fast": ">= 1 x (stretch 2)",
    "stability": "<= 0",
}


def test_every_figure_that_is_promised_is_what_it_was():
    assert {key: promise.target for key, promise in PROMISES.items()} == PROMISED
    assert all(promise.what and promise.against for promise in PROMISES.values())
