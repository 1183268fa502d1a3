"""What a process keeps between its scenarios changes nothing: it is never written into, and recordings are the same."""

import hashlib

import pytest

from replay.numerics import kept
from replay.recording.record import record
from tests.batch.scenes import with_meshes

pytestmark = pytest.mark.compiled  # bodies of thousands of triangles


def digests():
    return {
        key: hashlib.sha256(b"".join(kept._content(found))).hexdigest() for key, (found, _) in kept._answers.items()
    }


@pytest.mark.parametrize("model", [None, "thesis2015"])
def test_a_second_run_records_the_same_bytes(model, tmp_path):
    kept.forget()
    scenario = with_meshes()
    first = record(scenario, tmp_path / "first", model=model).mcap.read_bytes()
    made = digests()
    assert len(made) > 10
    again = record(scenario, tmp_path / "again", model=model).mcap.read_bytes()
    assert again == first
    assert digests() == made, "nobody wrote into an answer, and nothing was made anew"
