"""One scenario run and judged."""

import json

import pytest

from replay.batch.case import CaseOrder, CaseResult, CaseStatus, run_case
from replay.recording.reader import read
from replay.scenario.load import load_sources
from tests.batch import scenes

HOLDS, BREAKS = "contact: never", "contact: always"


def run(folder, *expectations):
    expected = ", ".join(f"{{pair: [arm, wall], {what}}}" for what in expectations)
    text = scenes.text("a").split("expect:")[0] + f"expect: [{expected}]\n"
    scenario = load_sources("a.yaml", {"a.yaml": text.encode()})
    return run_case(CaseOrder(scenario, folder, rrd=False), lambda done, total: None)


@pytest.mark.parametrize(
    ("expectations", "status"),
    [
        ((), CaseStatus.PASSED),
        ((HOLDS,), CaseStatus.PASSED),
        ((HOLDS, HOLDS), CaseStatus.PASSED),
        ((HOLDS, BREAKS), CaseStatus.BROKEN),
        ((BREAKS, HOLDS), CaseStatus.BROKEN),
        ((BREAKS, BREAKS), CaseStatus.BROKEN),
    ],
)
def test_a_scenario_passes_when_all_that_is_expected_holds(tmp_path, expectations, status):
    result = run(tmp_path, *expectations)
    assert result.status is status
    assert [outcome.passed for outcome in result.outcomes] == [what == HOLDS for what in expectations]
    assert result.frames == 11 == len(read(result.recordings.mcap).time)
    again = CaseResult.from_json(json.loads(json.dumps(result.as_json())), result.recordings)
    assert (again.status, again.frames, again.reused) == (status, 11, True)
