"""`replay experiments`: the thesis's experiments with the capacitive sensor."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, say
from replay.cli.values import PathName

FOLDER = PathName()
NAMES = ("I", "II", "III", "IV", "V", "VI")


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(NAMES), metavar="[" + "|".join(NAMES) + "]...")
@click.option(
    "-o", "--output", type=FOLDER, default=Path("experiments"), show_default=True, help="Folder for the files."
)
@click.option(
    "--scenarios",
    type=FOLDER,
    default=Path("scenarios/experiments"),
    show_default=True,
    help="The experiments' folder.",
)
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@format_option
def experiments(names: tuple[str, ...], output: Path, scenarios: Path, overwrite: bool, form: str) -> ExitCode:
    """Reproduce the thesis's experiments and two more (all when none is named), with tables (CSV) and drawings (PNG).

    I: error and time of midpoint splitting. II: fit one plate size. III: predict the other sizes. IV: predict a
    pivoting plate; each by the thesis's model and by electrostatics (field). The measured sensor of II to IV is a
    boundary-element solution, see scenarios/experiments/data. V: two neighbouring sensors, one covered by a hand,
    driven alone and together. VI: a person who floats, has 100 pF to earth, is grounded.
    """
    from replay.bench.experiments.run import EXPERIMENTS, run, write

    tables, files = [], []
    for name in names or EXPERIMENTS:
        found, panels = run(name, scenarios)
        files += write(found, panels, output, overwrite=overwrite)
        tables += found
    shown = [table for table in tables if not table.name.endswith("_points")]
    say(
        form,
        lambda: "\n\n".join(table.text() for table in shown).splitlines(),
        lambda: {table.name: {"title": table.title, "rows": table.rows, "remarks": table.remarks} for table in tables},
    )
    note(f"wrote {', '.join(str(file) for file in files)}")
    return ExitCode.FINE
