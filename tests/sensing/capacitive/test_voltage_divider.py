import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.sensing.capacitive import output_voltage


def test_equal_capacitances_halve_the_supply_and_saturation_gives_zero():
    np.testing.assert_array_equal(output_voltage([0.0, 10e-12, np.inf], coupling=10e-12), [2.5, 1.25, 0.0])
    assert output_voltage(30e-12, coupling=10e-12, supply=4.0) == 1.0


@pytest.mark.parametrize("capacitance", [-1e-12, np.nan, "x", None, {}, [1.0, [2.0]], 1j, [None]])
def test_a_capacitance_that_cannot_be_is_refused(capacitance):
    with pytest.raises(InvalidValue):
        output_voltage(capacitance, coupling=10e-12)


@pytest.mark.parametrize(
    "options",
    [
        {"coupling": 0.0},
        {"coupling": np.inf},
        {"coupling": "x"},
        {"coupling": None},
        {"coupling": [1.0, 2.0]},
        {"coupling": 1e-12, "supply": np.nan},
        {"coupling": 1e-12, "supply": "x"},
        {"coupling": 1e-12, "supply": [1.0, 2.0]},
    ],
)
def test_a_divider_that_cannot_be_is_refused(options):
    with pytest.raises(InvalidValue):
        output_voltage(1e-12, **options)
