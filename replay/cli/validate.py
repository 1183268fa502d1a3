"""`replay validate`: check scenarios without running them."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, nothing, say, scenarios_argument, select_option


@click.command()
@scenarios_argument
@click.option("--deep", is_flag=True, help="Load the meshes and build the scenes too.")
@select_option
@format_option
def validate(scenarios: tuple[Path, ...], deep: bool, patterns: tuple[str, ...], form: str) -> ExitCode:
    """Check SCENARIOS (files or folders): every problem is one line with file, line, column and what would work."""
    from replay.batch.select import load_all, select

    chosen = select(load_all(scenarios), patterns)
    if not chosen:
        return nothing(patterns)
    lines = [f"{s.name}: valid, {s.frames} frames, {len(s.links)} links" for s in chosen]
    data = [{"scenario": s.name, "frames": s.frames, "links": len(s.links), "tags": list(s.tags)} for s in chosen]
    if deep:
        from replay.scenario.scene import build

        for number, scenario in enumerate(chosen):
            scene = build(scenario)
            counts = {
                "shapes": len(scene.shapes),
                "triangles": sum(len(shape.solid.triangles) for shape in scene.shapes),
                "pairs": len(scene.pairs),
                "distance_sensors": len(scene.distance_sensors),
                "capacitive_sensors": len(scene.capacitive_sensors),
            }
            data[number] |= {**counts, "notes": list(scene.notes)}
            lines[number] += "".join(f", {count} {what.replace('_', ' ')}" for what, count in counts.items())
            for remark in scene.notes:
                note(remark)
    say(form, lambda: "\n".join(lines), lambda: data)
    return ExitCode.FINE
