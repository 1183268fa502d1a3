"""Contacts that begin and end between two frames, so that no frame shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.collision.columns import Crossings, Level
from replay.numerics.arrays import Integers


@dataclass(frozen=True, eq=False)
class Passages:
    """k contacts that no frame shows, by time.

    Attributes:
        pair: (k,) column of the pair.
        frame: (k,) frame of the scenario that is the first after it.
        begin, end: (k, 2) brackets [ns] of its two moments, see `Crossings`.
    """

    pair: Integers
    frame: Integers
    begin: Integers
    end: Integers


def passages(crossings: Crossings) -> Passages:
    """Return the contacts among crossings that begin and end before the same frame."""
    contact = np.flatnonzero(crossings.level == Level.CONTACT)
    contact = contact[np.lexsort((contact, crossings.pair[contact]))]
    first, second = contact[:-1], contact[1:]
    together = (crossings.pair[first] == crossings.pair[second]) & (crossings.frame[first] == crossings.frame[second])
    unseen = together & crossings.begins[first] & ~crossings.begins[second]
    begins, ends = first[unseen], second[unseen]
    order = np.argsort(begins)
    begins, ends = begins[order], ends[order]
    brackets = np.stack([crossings.earliest, crossings.latest], axis=1)
    return Passages(crossings.pair[begins], crossings.frame[begins], brackets[begins], brackets[ends])
