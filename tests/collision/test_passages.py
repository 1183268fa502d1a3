"""Contacts that no frame shows, found among crossings."""

import numpy as np

from replay.collision.columns import Crossings
from replay.collision.passages import passages


def crossings(*rows):
    pair, level, begins, latest, frame = np.array(sorted(rows, key=lambda row: (row[3], row[0]))).reshape(-1, 5).T
    return Crossings(pair, level.astype(np.uint8), begins > 0, latest - 1, latest, frame)


def test_a_contact_is_unseen_if_it_begins_and_ends_before_the_same_frame():
    found = passages(
        crossings(
            (3, 1, 1, 40, 5),  # unseen, with its bounds
            (3, 2, 1, 46, 5),
            (3, 2, 0, 49, 5),
            (3, 1, 0, 50, 5),
            (1, 2, 1, 47, 5),  # seen in a frame
            (1, 2, 0, 61, 7),
            (0, 2, 0, 62, 7),  # ends, and begins again
            (0, 2, 1, 63, 7),
            *((2, 2, k % 2, 40 + k, 5) for k in range(1, 5)),  # unseen, twice
        )
    )
    assert list(zip(found.pair, found.frame, found.begin[:, 1], found.end[:, 1], strict=True)) == [
        (2, 5, 41, 42),
        (2, 5, 43, 44),
        (3, 5, 46, 49),
    ]
    assert (found.begin[:, 0] == found.begin[:, 1] - 1).all() and (found.end[:, 0] == found.end[:, 1] - 1).all()


def test_nothing_is_found_among_nothing():
    assert len(passages(Crossings.none()).pair) == 0
