"""Decimals with a comma are told as such, wherever they are written."""

import pytest

from replay.errors import ScenarioError
from replay.scenario.load import load

TEXT = """version: 1
name: comma
rate: {rate}
duration: {duration}
links:
  arm:
    joint: {{type: revolute, axis: [0, 0, 1], velocity: 1, acceleration: 1}}
    shapes: {{s: {{type: cuboid, size: {size}}}}}
motion:
  moves: [{{to: {to}}}]
"""
USUAL = {"rate": "10", "duration": "1 s", "size": "[1, 1, 1]", "to": "{arm: 0.5}"}


def problems(tmp_path, **written):
    path = tmp_path / "comma.yaml"
    path.write_text(TEXT.format(**(USUAL | written)))
    with pytest.raises(ScenarioError) as caught:
        load(path)
    return [str(problem).removeprefix(f"{path}:") for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ({"to": "{arm: 1,05}"}, "10:22: arm = 1,05 has a decimal comma; write 1.05"),
        ({"to": "{arm: -1,5e-3}"}, "10:23: arm = -1,5e-3 has a decimal comma; write -1.5e-3"),
        ({"to": "{arm: 1,05 rad}"}, "10:22: arm = 1,05 rad has a decimal comma; write 1.05 rad"),
        ({"to": "{arm: '1,05 deg'}"}, "10:20: motion.moves[0].to.arm = '1,05 deg' has a decimal comma; write 1.05 deg"),
        ({"duration": "1,5"}, "4:11: duration = '1,5' has a decimal comma; write 1.5"),
        ({"rate": "59,94 Hz"}, "3:7: rate = '59,94 Hz' has a decimal comma; write 59.94 Hz"),
        ({"size": "[0,5, 1, 1]"}, "8:34: links.arm.shapes.s.size needs 3 entries, not 4;"
         " if 0,5 is one number, write 0.5"),
        ({"size": "[1,1,0,5]"}, "8:34: links.arm.shapes.s.size needs 3 entries, not 4;"
         " if 1,1 is one number, write 1.1"),
    ],
)  # fmt: skip
def test_a_decimal_comma_is_one_problem_that_says_so(tmp_path, written, told):
    (found,) = problems(tmp_path, **written)
    place, _, words = told.partition(": ")
    assert found.endswith(words)
    assert found.split(":")[0] == place.split(":")[0]


@pytest.mark.parametrize("to", ["{arm: 1, 05}", "{arm: 1,b2}", "{arm: 1,5: 3}"])
def test_other_keys_without_a_value_are_told_as_before(tmp_path, to):
    assert not any("decimal comma" in problem for problem in problems(tmp_path, to=to))


def test_lists_of_the_right_length_are_taken_as_they_are(tmp_path):
    path = tmp_path / "comma.yaml"
    path.write_text(TEXT.format(**(USUAL | {"size": "[1,2,3]", "to": "{arm: 1,}"})))
    assert load(path).links["arm"].shapes["s"].size == (1.0, 2.0, 3.0)
