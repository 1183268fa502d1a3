"""Baselines that a night makes of scenarios that have none."""

from __future__ import annotations

import dataclasses
import datetime
from collections.abc import Mapping
from pathlib import Path

from replay.batch.baseline import Baseline, Entry
from replay.batch.judged import Judged, RegressVerdict
from replay.errors import NoSpaceError, ReplayError


def create_baselines(judged: Mapping[str, Judged], accepted: Baseline) -> dict[str, Judged]:
    """Store the baselines that are to be created; return what became of them.

    One that cannot be stored keeps none of the others from it.
    """
    left = {name: item for name, item in judged.items() if item.verdict is RegressVerdict.CREATED}
    done: dict[str, Judged] = {}
    while left:
        try:
            entries = {name: Entry(recording_of(item), "new") for name, item in left.items()}
            reason = "created by regress --missing-baseline create"
            accepted.store(entries, reason=reason, now=datetime.datetime.now(datetime.UTC))
            return done | {
                name: dataclasses.replace(item, message="its baseline is new") for name, item in left.items()
            }
        except NoSpaceError:
            raise
        except ReplayError as error:
            file = getattr(error, "file", None)
            odd = [name for name, item in left.items() if file == str(recording_of(item))] or list(left)
            for name in odd:
                done[name] = dataclasses.replace(left.pop(name), verdict=RegressVerdict.MISSING, message=str(error))
    return done


def recording_of(item: Judged) -> Path:
    """Return the recording of a scenario that has one."""
    assert item.result is not None
    assert item.result.recordings is not None
    return item.result.recordings.mcap
