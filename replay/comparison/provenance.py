"""Where two recordings come from, value by value."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any

from replay.comparison.difference import Change
from replay.recording.provenance import Provenance
from replay.scenario.measured_log import MEASURED

FILES = "/files/"
"""Begins the name of an input file in changes and rules: `/files/meshes/head.stl`."""
_TEXTS = (".yaml", ".yml")


def provenance_changes(baseline: Provenance, candidate: Provenance) -> tuple[Change, ...]:
    """Return what the recordings say of themselves that differs: versions, code, model, libraries and scenario texts.

    The names behind the columns are not part of it: they are compared as signals. Bodies are part of the scene, but
    for the names of their files.
    """
    a, b = _bodies(baseline), _bodies(candidate)
    moved = _moved(a, b)
    return _changes(*({**_flat(p), **_of(bodies, moved)} for p, bodies in ((baseline, a), (candidate, b))))


def file_changes(baseline: Provenance, candidate: Provenance) -> tuple[Change, ...]:
    """Return the bodies' files, such as meshes, that differ; scenario texts may differ and mean the same.

    A file that only has another name, or stands elsewhere, is the same.
    A log of which a recording keeps an excerpt is the same if the excerpts are, or what they were cut out of. One that
    the recording is only compared with changes no reading.
    """
    a, b = _originals(baseline), _originals(candidate)
    bodies = _bodies(baseline), _bodies(candidate)
    moved = _moved(*bodies)
    changes = _changes(*({name: d for name, d in files.items() if name not in moved} for files in bodies))
    return tuple(c for c in changes if c.name not in a or a[c.name] != b.get(c.name))


def _moved(a: Mapping[str, str], b: Mapping[str, str]) -> frozenset[str]:
    """Return the files that only one run has under their names, and the other one under another name."""
    gone, new = ({name: d for name, d in one.items() if name not in other} for one, other in ((a, b), (b, a)))
    both = {*gone.values()} & {*new.values()}
    return frozenset(name for name, digest in (*gone.items(), *new.items()) if digest in both)


def _of(files: Mapping[str, str], names: frozenset[str]) -> dict[str, str]:
    return {name: digest for name, digest in files.items() if name in names}


def _bodies(provenance: Provenance) -> dict[str, str]:
    uses = {name: origin.get("use") for name, origin in provenance.originals.items()}
    bodies = {name: digest for name, digest in provenance.files.items() if not _is_text(name)}
    return {FILES + name: f"sha256 {digest}" for name, digest in bodies.items() if uses.get(name) != MEASURED}


def _originals(provenance: Provenance) -> dict[str, str]:
    own = {name: origin.get("sha256", "") for name, origin in provenance.originals.items()}
    return {FILES + name: own.get(name, digest) for name, digest in provenance.files.items()}


def _is_text(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in _TEXTS


def _changes(a: Mapping[str, str], b: Mapping[str, str]) -> tuple[Change, ...]:
    names = dict.fromkeys((*a, *b))
    return tuple(Change(name, a.get(name), b.get(name)) for name in names if a.get(name) != b.get(name))


def _flat(provenance: Provenance) -> dict[str, str]:
    values = {
        field.name: getattr(provenance, field.name)
        for field in dataclasses.fields(provenance)
        if field.name not in ("layout", "files")
    }
    texts = {FILES + name: f"sha256 {digest}" for name, digest in provenance.files.items() if _is_text(name)}
    return {**dict(_leaves(values, "")), **texts}


def _leaves(value: Any, name: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key in sorted(value):
            yield from _leaves(value[key], f"{name}.{key}" if name else str(key))
    else:
        yield name, value if isinstance(value, str) else json.dumps(value)
