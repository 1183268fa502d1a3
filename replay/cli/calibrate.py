"""`replay calibrate`: fit a capacitive sensor's constants to a measured curve."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, say
from replay.cli.values import PathName

FILE = PathName()


@click.command()
@click.argument("scenario", type=FILE)
@click.option("--curve", type=FILE, required=True, help="CSV file: joint position and measured value, with units.")
@click.option("--quantity", type=click.Choice(["delta_output", "capacitance"]), help="What was measured.")
@click.option("--sensor", help="Which one, where the scenario has several.")
@click.option("--joint", help="Which one the abscissa is the position of; the one that moves when left out.")
@click.option("--x", metavar="COLUMN", help="The abscissa; the first column when left out.")
@click.option("--y", metavar="COLUMN", help="What was measured; the only other column when left out.")
@click.option("--where", "filters", multiple=True, metavar="COLUMN=VALUE", help="Only these rows; repeatable.")
@click.option("--offset", is_flag=True, help="Fit the stray capacitance too.")
@click.option("--coupling", metavar="VALUE|fit", help="'10 pF'; the scenario's when left out.")
@click.option("--capacitance-at", nargs=2, metavar="POSITION VALUE", help="An absolute capacitance: '5 cm' '12.3 pF'.")
@click.option("-o", "--output", type=FILE, default=Path("sensor.yaml"), show_default=True, help="Sensor to include.")
@click.option("--plot", type=FILE, help="Drawing (PNG); beside OUTPUT when left out.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@format_option
def calibrate(scenario: Path, curve: Path, filters: tuple[str, ...], output: Path, form: str, **given: Any) -> ExitCode:
    """Fit the permittivity of a capacitive sensor in SCENARIO to a measured curve, and write the sensor as a file.

    The curve's abscissa is the position of the joint that moved the sensor or the target.
    """
    from replay.logs.curve_csv import read_curve
    from replay.scenario import calibration_report as report
    from replay.scenario.calibration import SensorPath, fit_curve
    from replay.scenario.load import load

    for wrong in (entry for entry in filters if "=" not in entry):
        raise click.BadParameter(f"{wrong!r} is not COLUMN=VALUE", param_hint="--where")
    where = {name.strip(): value for name, _, value in (entry.partition("=") for entry in filters)}
    path = SensorPath(load(scenario), sensor=given["sensor"], joint=given["joint"])
    fit = fit_curve(
        path,
        read_curve(curve, x=given["x"], y=given["y"], where=where),
        quantity=given["quantity"],
        coupling=given["coupling"],
        absolute=given["capacitance_at"],
        offset=given["offset"],
    )
    plot = given["plot"] or output.with_suffix(".png")
    report.write(fit, output, plot, overwrite=given["overwrite"])
    say(form, lambda: report.text(fit).splitlines(), lambda: report.as_json(fit))
    note(f"wrote {output} and {plot}")
    return ExitCode.FINE
