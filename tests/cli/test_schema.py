"""`replay schema` prints what stands in the checkout for editors."""

from pathlib import Path

import pytest

import replay
from replay.cli.main import run
from replay.cli.schema import KINDS

SCHEMAS = Path(replay.__file__).parents[1] / "schemas"


@pytest.mark.parametrize("kind", KINDS)
def test_the_schema_is_the_one_that_is_kept(kind, capsys):
    assert run(["schema", kind]) == 0
    assert capsys.readouterr().out == (SCHEMAS / f"{kind}.schema.json").read_text(encoding="utf-8")


def test_that_of_scenarios_is_the_default_and_no_other_kind_is_known(capsys):
    assert run(["schema"]) == 0
    assert capsys.readouterr().out == (SCHEMAS / "scenario.schema.json").read_text(encoding="utf-8")
    assert run(["schema", "mesh"]) == 2
    assert "'scenario', 'fragment', 'model', 'rules'" in capsys.readouterr().err
