"""What begins and what ends in a recording, found from the columns: contacts, bounds, detections, saturation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import Level
from replay.recording import messages
from replay.sensing.columns import Detection
from replay.simulation import FrameBlock, Layout

Flags = NDArray[np.bool_]

SEVERITY = {"contact": 4, "undecided": 3, "saturation": 3, "too close": 3, "bounds": 3, "detection": 2}
"""Foxglove's log level of the beginning of each kind of event; the end of any is information (2)."""
_INFORMATION = 2


@dataclass(frozen=True)
class Event:
    """One thing that begins or ends.

    Attributes:
        time: [ns] from the scenario's start.
        frame: index of the first frame in which it has begun or ended.
        kind: "bounds" (the bounding volumes of a pair meet, whether or not the shapes do), "contact", "undecided",
            "detection", "too close" or "saturation".
        begins: whether it begins; else it ends.
        subject: the pair or the sensor.
        source: the topic that says so.
    """

    time: int
    frame: int
    kind: str
    begins: bool
    subject: str
    source: str

    @property
    def text(self) -> str:
        """The event in words."""
        return f"{self.kind} {'begins' if self.begins else 'ends'}: {self.subject}"

    @property
    def severity(self) -> int:
        """Foxglove's log level."""
        return SEVERITY[self.kind] if self.begins else _INFORMATION

    def to_message(self) -> Any:
        """Return the event as a foxglove.Log: `name` is the subject, `file` the source and `line` the frame."""
        stamp = {"seconds": self.time // 1_000_000_000, "nanos": self.time % 1_000_000_000}
        return messages.message_class(messages.LOG)(
            timestamp=stamp,
            level=self.severity,
            message=self.text,
            name=self.subject,
            file=self.source,
            line=self.frame,
        )

    @staticmethod
    def from_message(time: int, message: Any) -> Event:
        """Return the event that `to_message` wrote; ValueError when the message is not one."""
        kind, separator, verb = str(message.message).removesuffix(f": {message.name}").rpartition(" ")
        if kind not in SEVERITY or not separator or verb not in ("begins", "ends"):
            raise ValueError(message.message)
        return Event(time, message.line, kind, verb == "begins", message.name, message.file)


class EventFinder:
    """Finds the events of blocks given in order; what is already so in the first frame begins there."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._last: dict[str, Flags] = {}

    def find(self, block: FrameBlock) -> list[Event]:
        """Return the events of the next block, by frame, and within a frame by kind and name."""
        events = []
        for kind, source, names, state in self._states(block):
            before = self._last.get(kind, np.zeros(len(names), dtype=np.bool_))
            changed = state != np.concatenate([before[None], state[:-1]])
            self._last[kind] = state[-1].copy()
            for frame, index in np.argwhere(changed).tolist():
                name = names[index]
                source_topic = source if kind in ("bounds", "contact", "undecided") else f"{source}/{name}"
                event = Event(
                    time=int(block.time[frame]),
                    frame=block.first + frame,
                    kind=kind,
                    begins=bool(state[frame, index]),
                    subject=name,
                    source=source_topic,
                )
                events.append(event)
        return sorted(events, key=lambda event: event.frame)

    def _states(self, block: FrameBlock) -> Iterator[tuple[str, str, tuple[str, ...], Flags]]:
        layout = self._layout
        if block.collision is not None:
            level = block.collision.level
            yield "bounds", "/collision", layout.pairs, level >= Level.BOUNDS
            yield "contact", "/collision", layout.pairs, level >= Level.CONTACT
            yield "undecided", "/collision", layout.pairs, block.collision.undecided
        if block.distance is not None:
            status = block.distance.status
            yield "detection", "/distance", layout.distance_sensors, status != Detection.NOTHING
            yield "too close", "/distance", layout.distance_sensors, status == Detection.TOO_CLOSE
        if block.capacitive is not None:
            yield "saturation", "/capacitive", layout.capacitive_sensors, block.capacitive.saturated
