"""`replay schema`: the JSON Schemas of the language, for editors."""

from __future__ import annotations

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.terminal import put

KINDS = ("scenario", "fragment", "model", "rules")


@click.command()
@click.argument("kind", type=click.Choice(KINDS), default=KINDS[0])
def schema(kind: str) -> ExitCode:
    """Print the JSON Schema of a KIND of file: scenario (the default), included fragment, model or rules of comparison.

    Editors complete and check YAML by it: replay schema > scenario.schema.json, and in the scenario's first line
    # yaml-language-server: $schema=scenario.schema.json
    """
    if kind == "rules":
        from replay.comparison.rules_file import schema_text as text_of_rules

        put(text_of_rules().splitlines())
    else:
        from replay.scenario.schema import FILES, schema_text

        put(schema_text(FILES[f"{kind}.schema.json"]).splitlines())
    return ExitCode.FINE
