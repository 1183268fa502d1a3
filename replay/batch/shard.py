"""One of several parts of a run, for machines that share a night's work."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from replay.batch.cost import expected_cost
from replay.errors import InvalidValue
from replay.scenario.model import Scenario


@dataclass(frozen=True)
class Shard:
    """Part `index` of `count`, counted from 1."""

    index: int
    count: int

    @staticmethod
    def parse(text: str) -> Shard:
        """Return the shard that "2/4" stands for.

        Raises:
            InvalidValue: it stands for none.
        """
        found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
        if not found or not 1 <= int(found[1]) <= int(found[2]):
            raise InvalidValue("shard", text, "must be i/n with 1 <= i <= n, such as 2/4")
        return Shard(int(found[1]), int(found[2]))

    def of(self, scenarios: Sequence[Scenario]) -> list[Scenario]:
        """Return this shard's scenarios in the order given: all shards together are all scenarios, each once.

        The expected costs are dealt out like cards, the largest first, so that shards take about equally long.
        """
        dealt = sorted(scenarios, key=lambda scenario: (-expected_cost(scenario), scenario.name))
        mine = {scenario.name for scenario in dealt[self.index - 1 :: self.count]}
        return [scenario for scenario in scenarios if scenario.name in mine]
