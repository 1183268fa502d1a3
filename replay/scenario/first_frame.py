"""What the first frame shows and is rarely meant: bodies that touch already, sensors that see their own machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from replay.collision.columns import CollisionColumns, Level
from replay.errors import count
from replay.scenario.layout import Layout
from replay.scenario.model import Scenario
from replay.sensing.kinds import KINDS

_NAMED = 3


class FirstFrame:
    """Looks at the first frame of a scenario; all others are passed over."""

    def __init__(self, scenario: Scenario, layout: Layout) -> None:
        self._scenario = scenario
        self._layout = layout
        self._seen = False
        self._lines: tuple[str, ...] = ()

    def update(self, collision: CollisionColumns | None, readings: Mapping[str, Any]) -> None:
        """Take the results of the next frames."""
        if not self._seen:
            self._seen = True
            self._lines = (*self._touching(collision), *self._own_machine(readings))

    def lines(self) -> tuple[str, ...]:
        """Return what there is to say, a line each."""
        return self._lines

    def _touching(self, collision: CollisionColumns | None) -> Iterator[str]:
        if collision is None:
            return
        pairs = [self._layout.pairs[k] for k in np.flatnonzero(collision.level[0] == Level.CONTACT).tolist()]
        if pairs:
            named = ", ".join(pair.replace("|", " | ") for pair in pairs[:_NAMED])
            more = f" and {len(pairs) - _NAMED} more" if len(pairs) > _NAMED else ""
            verb = "is" if len(pairs) == 1 else "are"
            how = "`replay validate --deep` writes the lines that leave them out"
            yield f"{count(len(pairs), 'pair')} {verb} in contact in the first frame ({named}{more}); {how}"

    def _own_machine(self, readings: Mapping[str, Any]) -> Iterator[str]:
        for kind, columns in readings.items():
            field = next((field for field in KINDS[kind].columns.fields() if field.names == "shapes"), None)
            if field is None:
                continue
            sensors = self._scenario.sensors.of(kind)
            for k, name in enumerate(self._layout.sensors[kind]):
                number = int(getattr(columns, field.name)[0, k])
                if number < 0:
                    continue
                shape, own = self._layout.shapes[number], sensors[name].link
                link = shape.split("/")[0]
                if self._root(link) == self._root(own):
                    yield (
                        f"the {kind} sensor {name} sees {shape} of its own machine in the first frame; "
                        f"write ignore: [{link}] below it, if it should not"
                    )

    def _root(self, link: str) -> str:
        """Return the link that a link's tree stands on."""
        while (parent := self._scenario.links[link].parent) is not None:
            link = parent
        return link
