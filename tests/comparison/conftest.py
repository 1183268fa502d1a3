"""Run folders to compare."""

import pytest

from tests.comparison import made_up
from tests.comparison.changed import BASELINE, CANDIDATE


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """Two run folders: `same` is equal, `other` differs, `gone` and `new` are in one only."""
    root = tmp_path_factory.mktemp("runs")
    for run, name, recording in (
        ("a", "same", BASELINE),
        ("b", "same", BASELINE),
        ("a", "other", BASELINE),
        ("b", "other", CANDIDATE),
        ("a", "gone", BASELINE),
        ("b", "new", BASELINE),
    ):
        made_up.write(recording, root / run / name / f"{name}.mcap")
    return root
