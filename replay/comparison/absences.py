"""Signals that only one of two runs has, told as the sensors, pairs, joints and links that they belong to."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from replay.comparison.difference import Absence
from replay.comparison.rules import Rules
from replay.comparison.signals import Group, Signal
from replay.numerics.arrays import Integers

Key = tuple[str, str]
Groups = Mapping[Key, Group]


def absences(own: Groups, other: Groups, rules: Rules) -> tuple[Absence, ...]:
    """Return what one run has and the other lacks; decides unless rules ignore all of its signals."""
    others = {signal for group in other.values() for signal in group.signals}
    topics = {signal.topic for signal in others}
    items: dict[tuple[str, str], list[Signal]] = {}
    for group in own.values():
        for signal in group.signals:
            if signal not in others:
                whole = signal.topic not in topics
                items.setdefault((signal.topic, "" if whole else signal.name), []).append(signal)
    return tuple(
        Absence(
            topic=topic,
            name=name,
            signals=tuple(signals),
            whole_topic=topic not in topics,
            same_as=None,
            decides=not all(rules.tolerance(signal.full_name).ignore for signal in signals),
        )
        for (topic, name), signals in sorted(items.items())
    )


def with_new_names(
    missing: tuple[Absence, ...],
    extra: tuple[Absence, ...],
    groups_a: Groups,
    groups_b: Groups,
    rows: tuple[Integers | None, Integers | None],
) -> tuple[tuple[Absence, ...], tuple[Absence, ...]]:
    """Say of what is missing under which other name it is there, where exactly one extra has the same readings.

    Args:
        missing, extra: only in the baseline; only in the candidate.
        groups_a, groups_b: all signals of both.
        rows: the frames that both have, as indices in each; None for all.
    """
    if not missing or not extra:
        return missing, extra
    prints_a = _fingerprints(missing, groups_a, rows[0])
    prints_b = _fingerprints(extra, groups_b, rows[1])
    partners: dict[int, int] = {}
    for k, print_ in enumerate(prints_a):
        if prints_a.count(print_) == 1 and prints_b.count(print_) == 1:
            partners[k] = prints_b.index(print_)
    back = {j: k for k, j in partners.items()}
    return (
        tuple(_same_as(item, extra[partners[k]] if k in partners else None) for k, item in enumerate(missing)),
        tuple(_same_as(item, missing[back[j]] if j in back else None) for j, item in enumerate(extra)),
    )


def _same_as(item: Absence, other: Absence | None) -> Absence:
    return item if other is None else dataclasses.replace(item, same_as=(other.topic, other.name))


def _fingerprints(items: Iterable[Absence], groups: Groups, rows: Integers | None) -> list[tuple[tuple[str, ...], str]]:
    """Return of each item its fields and a digest of its values, without the name that may have changed."""
    places = {signal: (group, k) for group in groups.values() for k, signal in enumerate(group.signals)}
    prints = []
    for item in items:
        digest = hashlib.sha256()
        fields = []
        for signal in sorted(item.signals):
            group, column = places[signal]
            values = group.values[:, column] if rows is None else group.values[rows, column]
            if group.categories:
                values = _numbers_of(group.categories)[values + 1]
            digest.update(np.ascontiguousarray(values).tobytes())
            named = signal.name if item.whole_topic else ""
            fields.append(f"{signal.topic.split('/')[1]}/{signal.field}/{named}")
        prints.append((tuple(fields), digest.hexdigest()))
    return prints


def _numbers_of(texts: Sequence[str]) -> NDArray[np.uint64]:
    """Return a number for each text that both runs give it, whatever texts stand beside it in each."""
    digests = [hashlib.sha256(text.encode()).digest() for text in texts]
    return np.array([int.from_bytes(digest[:8], "little") for digest in digests], dtype=np.uint64)
