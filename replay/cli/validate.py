"""`replay validate`: check scenarios without running them."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, note_left_out, nothing, say, scenarios_argument, select_option
from replay.cli.terminal import put
from replay.errors import Problem, ScenarioError, count


@click.command()
@scenarios_argument
@click.option("--deep", is_flag=True, help="Load the meshes and build the scenes too.")
@select_option
@format_option
def validate(scenarios: tuple[Path, ...], deep: bool, patterns: tuple[str, ...], form: str) -> ExitCode:
    """Check SCENARIOS (files or folders): every problem is one line with file, line, column and what would work."""
    from replay.batch.select import load_all, select
    from replay.scenario.notes import notes, touching_note

    if deep:
        from replay.scenario.scene import build
        from replay.simulation import touching_first
    chosen = select(load_all(scenarios), patterns)
    note_left_out(scenarios)
    if not chosen:
        return nothing(patterns)
    lines, data = [], []
    problems: list[Problem] = []
    told: dict[str, None] = {}
    touched: dict[tuple[str, ...], None] = {}
    for scenario in chosen:
        remarks = notes(scenario)
        shown = [str(remark) for remark in remarks]
        counts = {"frames": scenario.frames, "links": len(scenario.links)}
        kept = [remark.message for remark in remarks]
        if deep:
            try:
                scene = build(scenario)
            except ScenarioError as error:
                problems.extend(error.problems)
                continue
            counts |= scene.counts
            shown.extend(remark for remark in scene.notes if remark not in kept)
            kept = list(scene.notes)
            met = touching_first(scene)
            touched |= dict.fromkeys([met] if met else [])
        kinds = ((n, what.removesuffix("s").replace("_", " ")) for what, n in counts.items())
        lines.append(", ".join([f"{scenario.name}: valid", *(count(n, kind) for n, kind in kinds)]))
        entry = {"scenario": scenario.name, **counts, "tags": list(scenario.tags), "notes": kept}
        data.append(entry | ({"touching": list(met)} if deep else {}))
        told |= dict.fromkeys(shown)  # the cases of a sweep share their text
    for remark in told:
        note(f"note: {remark}")
    for pairs in touched:
        head, *entries = touching_note(pairs)
        note(f"note: {head}")
        put(entries, err=True)
    if problems:
        raise ScenarioError(problems)
    say(form, lambda: lines, lambda: data)
    return ExitCode.FINE
