"""A run in which one thing is changed, and what must be found then."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from replay.comparison.diff import compare
from replay.comparison.difference import DiffVerdict, SignalDifference
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.recording.reader import Recording
from tests.comparison import made_up

BASELINE = made_up.recording()
PAIR = "arm/beam|stand/base"


def rules(pattern: str, **tolerance: Any) -> Rules:
    """Return rules of one tolerance."""
    return Rules((Rule((pattern,), Tolerance(**tolerance), "test"),))


def changed(change: Callable[[Recording], None], **options: Any) -> SignalDifference:
    """Return the difference, whose verdict must be "different" and whose only finding is one signal."""
    found = compare(BASELINE, made_up.altered(BASELINE, change), **options)
    assert found.verdict is DiffVerdict.DIFFERENT
    assert not (found.missing or found.extra or found.scene or found.provenance or found.frames.missing)
    (signal,) = found.signals
    return signal
