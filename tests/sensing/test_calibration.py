"""Fits of a sensor's constants: truth comes back, intervals cover it, outliers do not move it, doubt is refused."""

import numpy as np
import pytest

from replay.errors import CalibrationError, InvalidValue
from replay.sensing.calibration import calibrate, response

EPS, STRAY, COUPLING, SUPPLY = 3e-12, 1.2e-12, 8e-12, 2.5
INTEGRAL = 0.01 / np.linspace(0.01, 0.2, 12)
QUANTITIES = ("capacitance", "delta_output")


def curve(quantity, *, stray=STRAY, integral=INTEGRAL):
    return response(
        integral, quantity=quantity, permittivity=EPS, stray_capacitance=stray, coupling=COUPLING, supply=SUPPLY
    )


def estimate(found, name):
    return next(entry for entry in found.estimates if entry.name == name)


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("offset", [False, True])
def test_a_curve_of_the_model_gives_its_constants_back(quantity, offset):
    stray = STRAY if offset else 0.0
    measured = curve(quantity, stray=stray)
    found = calibrate(INTEGRAL, measured, quantity=quantity, coupling=COUPLING, supply=SUPPLY, offset=offset)
    assert found.permittivity == pytest.approx(EPS, rel=1e-9)
    assert found.stray_capacitance == pytest.approx(stray, rel=1e-9)
    assert found.coupling == COUPLING
    np.testing.assert_allclose(found.fitted, measured, rtol=1e-9)
    assert estimate(found, "permittivity").half_width < 1e-9 * EPS


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_stated_stray_capacitance_is_held(quantity):
    held = {"coupling": COUPLING, "stray_capacitance": STRAY}
    found = calibrate(INTEGRAL, curve(quantity), quantity=quantity, **held)
    assert found.permittivity == pytest.approx(EPS, rel=1e-9)
    assert found.stray_capacitance == pytest.approx(STRAY, rel=1e-14)
    assert not estimate(found, "stray_capacitance").fitted


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_intervals_cover_the_truth_as_often_as_they_say(quantity):
    rng = np.random.default_rng(5)
    measured = curve(quantity)
    hits = np.zeros(2)
    rounds = 150
    for _ in range(rounds):
        noise = 0.01 * np.ptp(measured) * rng.normal(size=len(measured))
        found = calibrate(INTEGRAL, measured + noise, quantity=quantity, coupling=COUPLING, offset=True)
        for k, (name, truth) in enumerate((("permittivity", EPS), ("stray_capacitance", STRAY))):
            entry = estimate(found, name)
            hits[k] += abs(entry.value - truth) <= entry.half_width
    assert (hits >= 0.88 * rounds).all()
    assert (hits <= 0.995 * rounds).all()


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_one_wrong_point_moves_the_fit_by_little(quantity):
    measured = curve(quantity) + 0.002 * np.ptp(curve(quantity)) * np.random.default_rng(3).normal(size=len(INTEGRAL))
    broken = measured.copy()
    broken[3] += 0.4 * np.ptp(measured)
    found = calibrate(INTEGRAL, broken, quantity=quantity, coupling=COUPLING, stray_capacitance=STRAY)
    linear = broken if quantity == "capacitance" else COUPLING * broken / (SUPPLY - broken)
    plain = np.linalg.lstsq(INTEGRAL[:, None], linear - STRAY, rcond=None)[0][0]
    assert abs(found.permittivity - EPS) < 0.3 * abs(plain - EPS)


def test_an_absolute_capacitance_fixes_the_coupling():
    measured = curve("delta_output")
    seen = 0.07
    absolute = (seen, EPS * seen + STRAY)
    found = calibrate(INTEGRAL, measured, quantity="delta_output", coupling=1.0, offset=True, absolute=absolute)
    assert found.coupling == pytest.approx(COUPLING, rel=1e-9)
    assert found.permittivity == pytest.approx(EPS, rel=1e-9)
    assert found.stray_capacitance == pytest.approx(STRAY, rel=1e-9)
    noisy = measured + 0.01 * np.random.default_rng(1).normal(size=len(measured))
    found = calibrate(INTEGRAL, noisy, quantity="delta_output", coupling=1.0, absolute=(seen, EPS * seen))
    # without an offset the absolute measurement alone says what eps is
    assert found.permittivity == pytest.approx(EPS, rel=1e-12)
    assert estimate(found, "permittivity").half_width < 1e-9 * EPS
    assert estimate(found, "coupling").half_width > 0.0


def test_a_delta_output_depends_on_the_ratio_of_permittivity_and_coupling_only():
    measured = curve("delta_output")
    one, two = (
        calibrate(INTEGRAL, measured, quantity="delta_output", coupling=coupling, offset=True)
        for coupling in (COUPLING, 7.0 * COUPLING)
    )
    np.testing.assert_allclose(one.fitted, two.fitted, rtol=1e-12)
    assert two.permittivity == pytest.approx(7.0 * one.permittivity, rel=1e-12)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_as_many_points_as_parameters_have_no_interval(quantity):
    found = calibrate(INTEGRAL[:2], curve(quantity)[:2], quantity=quantity, coupling=COUPLING, offset=True)
    assert found.permittivity == pytest.approx(EPS, rel=1e-9)
    assert np.isnan(estimate(found, "permittivity").half_width)
    assert estimate(found, "coupling").half_width == 0.0


REFUSED = {
    "fewer points than parameters": ({"n": 1, "offset": True}, "cannot determine 2 parameters"),
    "an offset with a constant curve": ({"constant": 0.0, "offset": True}, "cannot tell the offset"),
    "an offset with a nearly constant curve": ({"constant": 1e-6, "offset": True}, "cannot tell the offset"),
    "a curve that falls where the model rises": ({"slope": -1.0, "offset": True}, "falls where the model's rises"),
    "a negative offset": ({"shift": -1.0, "offset": True}, "which no stray capacitance is"),
    "a stray capacitance held beside a fitted coupling": (
        {"absolute": (0.1, 1e-12), "stray_capacitance": 1e-12},
        "stray capacitance cannot be held|does not show the coupling",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_what_the_data_cannot_tell_is_refused_in_one_line(quantity, name):
    options, message = REFUSED[name]
    options = dict(options)
    n = options.pop("n", len(INTEGRAL))
    integral = INTEGRAL[:n]
    if "constant" in options:
        integral = 1.0 + options.pop("constant") * np.linspace(0.0, 1.0, n)
    measured = curve(quantity, integral=integral)
    if "slope" in options:
        measured = measured.max() + 0.1 * measured.max() + options.pop("slope") * (measured - measured.min())
    if "shift" in options:
        measured = measured + options.pop("shift") * 0.5 * measured.max()
    with pytest.raises(CalibrationError, match=message) as caught:
        calibrate(integral, measured, quantity=quantity, coupling=COUPLING, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"integral": [np.inf, 1.0]}, InvalidValue),
        ({"integral": [-1.0, 1.0]}, InvalidValue),
        ({"integral": [1.0]}, InvalidValue),
        ({"measured": [np.nan, 1.0]}, InvalidValue),
        ({"measured": [2.5, 1.0]}, CalibrationError),
        ({"integral": [0.0, 0.0]}, CalibrationError),
        ({"quantity": "voltage"}, InvalidValue),
        ({"coupling": 0.0}, InvalidValue),
        ({"supply": np.nan}, InvalidValue),
        ({"stray_capacitance": -1e-12}, InvalidValue),
        ({"absolute": (np.inf, 1e-12)}, InvalidValue),
    ],
)
def test_arguments_are_checked(change, error):
    arguments = {
        "integral": [1.0, 2.0],
        "measured": [0.5, 0.6],
        "quantity": "delta_output",
        "coupling": COUPLING,
    } | change
    with pytest.raises(error):
        calibrate(arguments.pop("integral"), arguments.pop("measured"), **arguments)
