"""The names behind the arrays, as a message for viewers that do not show metadata; our reader takes the metadata."""

from __future__ import annotations

from replay.recording import messages
from replay.scenario.layout import Layout

TOPIC = "/layout"


def layout_message(layout: Layout) -> bytes:
    """Return the serialised replay.Layout of a recording."""
    message = messages.message_class(messages.LAYOUT)()
    names = {**vars(layout), "sensors": list(layout.topics())}
    for field in messages.LAYOUT_NAMES:
        getattr(message, field).extend(names[field])
    data: bytes = message.SerializeToString(deterministic=True)
    return data
