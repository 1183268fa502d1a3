"""Kernels compiled before anything is timed: those that the scenarios of a run call, and no others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from replay.batch.worker import Messages
from replay.numerics import remarks
from replay.scenario.methods import Model
from replay.scenario.model import Scenario
from replay.sensing.kinds import KINDS


@dataclass(frozen=True)
class Needs:
    """What scenarios compute, and by which methods; numbers that do not change what is compiled are left out.

    Attributes:
        sensors: the kinds of sensors.
    """

    model: Model
    collision: bool
    sensors: frozenset[str]
    meshes: bool


def needs_of(scenarios: Sequence[Scenario], model: Model | None) -> tuple[Needs, ...]:
    """Return what scenarios need, each combination once."""
    needs = (
        Needs(
            _methods(model or scenario.model),
            collision=scenario.collision.pairs == "all",
            sensors=frozenset(kind for kind in KINDS if scenario.sensors.of(kind)),
            meshes=bool(scenario.provenance.meshes),
        )
        for scenario in scenarios
    )
    return tuple(dict.fromkeys(needs))


def _methods(model: Model) -> Model:
    words = {kind: {key: value for key, value in getattr(model, kind) if isinstance(value, str)} for kind in KINDS}
    return Model(collision=model.collision, **{kind: KINDS[kind].method(**words[kind]) for kind in KINDS})


def kernels_for(needs: Needs, *, savings: bool = True) -> tuple[Any, ...]:
    """Return the kernels that scenarios with these needs call; rooms are imported for what is needed only."""
    from replay.numerics.jit import entries_of

    model = needs.model
    found: tuple[Any, ...] = ()
    if needs.meshes:
        from replay.geometry import closing, containment, convexity, facets, mesh, tree

        found += entries_of(tree, mesh, facets, convexity, closing, containment)
    if needs.collision:
        from replay.collision import engines

        version = model.collision
        found += engines.kernels(
            bounds=version.bounds,
            narrowphase=version.narrowphase,
            pieces=version.pieces,
            savings=savings,
            between=version.between,
        )
    for name, kind in KINDS.items():
        if name in needs.sensors:
            found += kind.kernels(getattr(model, name), savings=savings)
    return found


@dataclass(frozen=True)
class PrepareKernels:
    """What a worker calls before its first scenario: compiles kernels, or loads those that are compiled already.

    Attributes:
        needs: what its scenarios compute.
        rrd: they make rerun recordings too, so that library is loaded as well.
        savings: see `simulation.simulate`.
    """

    needs: tuple[Needs, ...]
    rrd: bool = False
    savings: bool = True

    def __call__(self, messages: Messages) -> None:
        """Make the kernels of every combination of methods ready; other workers that are asked to help do the same."""
        from replay.numerics.jit import compile_entries, progress

        progress.tell_by(messages.progress)
        remarks.tell_by(messages.tell)
        compile_entries(
            [kernel for needs in self.needs for kernel in kernels_for(needs, savings=self.savings)],
            share=messages.share,
        )
        if self.rrd:
            from replay.recording import rerun_inside

            rerun_inside.available()
