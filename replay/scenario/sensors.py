"""The sensors that links carry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from replay.language.fields import Name, Part
from replay.sensing.kinds import KINDS


class _Sensors(Part):
    """Sensors by name; a sensor that is not declared costs nothing."""

    def of(self, kind: str) -> dict[str, Any]:
        """Return the sensors of a kind by name, each as it is written."""
        found: dict[str, Any] = getattr(self, kind)
        return found

    if TYPE_CHECKING:

        def __getattr__(self, kind: str) -> dict[str, Any]: ...


if TYPE_CHECKING:
    Sensors = _Sensors
else:
    Sensors = create_model(
        "Sensors",
        __base__=_Sensors,
        __module__=__name__,
        __doc__=_Sensors.__doc__,
        **{
            kind.name: (
                dict[Name, kind.part],
                Field(default_factory=dict, description=f"{kind.name.capitalize()} sensors."),
            )
            for kind in KINDS.values()
        },
    )
