"""Why two recordings may differ: what has changed of their inputs, their model, the libraries and the code."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from replay.comparison import quantities
from replay.errors import ReplayError, count
from replay.geometry.mesh_file import read_faces
from replay.geometry.solid import signed_volume
from replay.logs.mcap_reader import McapLog
from replay.numerics.arrays import Floats
from replay.recording.provenance import Provenance
from replay.recording.reader import read_provenance
from replay.recording.slim import attached_files
from replay.scenario.load import load_sources
from replay.scenario.model import Scenario
from replay.scenario.shapes import MeshPart

_TEXTS = (".yaml", ".yml")
_SHOWN = 3
"""Changes that the name of several is made of."""
_CHANGES = 50
"""Changes of inputs that are told; a description that was imported anew has thousands."""
_TEXT_LINES = 200
"""Lines of a difference of texts that are kept."""


@dataclass(frozen=True)
class Causes:
    """What has changed between two recordings beside their results, a line each.

    Attributes:
        inputs: values of the scenario, meshes, logs: "person/body radius 20 -> 21 cm".
        model: "model.distance thesis@2 -> exact@3".
        libraries: "library numpy 2.3.0 -> 2.4.0".
        code: the package itself.
        text: the difference of the scenarios' texts, as `diff -u` writes it; "" when they are the same.
        unknown: why nobody can tell what has changed; "" as a rule.
    """

    inputs: tuple[str, ...] = ()
    model: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    text: str = ""
    unknown: str = ""

    @property
    def changes(self) -> tuple[str, ...]:
        """What explains a difference: inputs and model, else the libraries; nothing where only the code may have."""
        return (*self.inputs, *self.model) or self.libraries

    @property
    def name(self) -> str:
        """The changes in one line, or what there is to say of a difference that nothing explains."""
        if self.unknown:
            return f"unexplained: {self.unknown}"
        if not self.changes:
            return f"unexplained: nothing but the code changed ({', '.join(self.code)})" if self.code else _NOTHING
        more = len(self.changes) - _SHOWN
        return "; ".join(self.changes[:_SHOWN]) + (f"; and {count(more, 'more change')}" if more > 0 else "")


_NOTHING = "unexplained: inputs, model, libraries and code are the same"


def causes(baseline: Path, candidate: Path) -> Causes:
    """Return what has changed between two recordings beside their results.

    Raises:
        RecordingError: one cannot be read, or lacks a file that it needs.
    """
    a, b = _provenance(baseline), _provenance(candidate)
    inputs, text = ((), "") if a.files == b.files and a.root == b.root else _inputs(baseline, candidate, a, b)
    return Causes(
        inputs,
        tuple(_model(a.model, b.model)),
        tuple(_named("library ", a.libraries, b.libraries)),
        tuple(_code(a, b)),
        text,
    )


def _provenance(recording: Path) -> Provenance:
    with McapLog(recording) as log:
        return read_provenance(log)


def _named(prefix: str, a: Mapping[str, object], b: Mapping[str, object]) -> Iterator[str]:
    for name in sorted({*a, *b}):
        if a.get(name) != b.get(name):
            yield f"{prefix}{name} {a.get(name, '-')} -> {b.get(name, '-')}"


def _model(a: Mapping[str, object], b: Mapping[str, object]) -> Iterator[str]:
    """Yield what differs of two models; options that only one of two methods has go without saying."""
    others = {name for name in {*a, *b} if a.get(name) != b.get(name)}
    for line in _named("model.", a, b):
        name = line.split()[0].removeprefix("model.")
        method = name.rpartition(".")[0]
        if not (method in others and (name not in a or name not in b)):
            yield line


def _code(a: Provenance, b: Provenance) -> Iterator[str]:
    if a.version != b.version:
        yield f"replay {a.version} -> {b.version}"
    if a.code != b.code:
        yield f"code {a.code[:8]} -> {b.code[:8]}"
    if a.format != b.format:
        yield f"recording format {a.format} -> {b.format}"


def _inputs(baseline: Path, candidate: Path, a: Provenance, b: Provenance) -> tuple[tuple[str, ...], str]:
    files_a, files_b = attached_files(baseline)[2], attached_files(candidate)[2]
    text = _text_difference(files_a, files_b)
    try:
        old, new = (load_sources(p.root, files, case=p.scenario) for p, files in ((a, files_a), (b, files_b)))
    except ReplayError as error:  # a baseline in a language that this version no longer takes
        reason = str(error).splitlines()[0]
        return (f"the scenario's files, which cannot be compared by meaning ({reason})",), text
    from replay.comparison.inputs import input_changes

    changed = [*input_changes(old, new), *_meshes(old, new)]
    bodies = {name for scenario in (old, new) for name in scenario.provenance.meshes.values()}
    for name in sorted(set(files_a) | set(files_b)):
        if name not in bodies and not _is_text(name) and _original(a, name) != _original(b, name):
            sizes = (f"{len(files[name])} bytes" if name in files else "none" for files in (files_a, files_b))
            changed.append(f"file {name} {' -> '.join(sizes)}")
    more = [f"and {count(len(changed) - _CHANGES, 'more change')}"] if len(changed) > _CHANGES else []
    return (*changed[:_CHANGES], *more), text


def _original(provenance: Provenance, name: str) -> str:
    return provenance.originals.get(name, {}).get("sha256") or provenance.files.get(name, "")


def _meshes(old: Scenario, new: Scenario) -> Iterator[str]:
    """Yield how the meshes of shapes that both scenarios have differ, of one file the first shape's."""
    told: set[tuple[str, str]] = set()
    for key, name in new.provenance.meshes.items():
        before = old.provenance.meshes.get(key)
        if before is None:
            continue
        data = old.sources[before], new.sources[name]
        if data[0] == data[1] or (before, name) in told:
            continue
        told.add((before, name))
        shapes = [scenario.links[key[0]].shapes[key[1]] for scenario in (old, new)]
        scales = [shape.scales if isinstance(shape, MeshPart) else (1.0, 1.0, 1.0) for shape in shapes]
        yield f"{'/'.join(key)} mesh {_mesh_change((before, name), data, (scales[0], scales[1]))}"


_Three = tuple[float, float, float]


@functools.lru_cache(maxsize=64)
def _mesh_change(names: tuple[str, str], data: tuple[bytes, bytes], scales: tuple[_Three, _Three]) -> str:
    """Return "bow.stl (triangles 1200 -> 1300, volume 1.2 -> 1.3 l)": what differs of triangles, bounds and volume."""
    shown = " -> ".join(dict.fromkeys(PurePosixPath(name).name for name in names))
    try:
        a, b = (_triangles(*one) for one in zip(names, data, scales, strict=True))
    except ReplayError as error:
        return f"{shown} ({str(error).splitlines()[0]})"
    parts = [f"triangles {len(a)} -> {len(b)}"] if len(a) != len(b) else []
    slack = 1e-9 * max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    for what, old, new in (("from", a.min((0, 1)), b.min((0, 1))), ("to", a.max((0, 1)), b.max((0, 1)))):
        for axis in np.flatnonzero(np.abs(old - new) > slack):
            change = quantities.change(float(old[axis]), float(new[axis]), "m")
            parts.append(f"{'xyz'[axis]} {what} {change}")
    volumes = [signed_volume(triangles) for triangles in (a, b)]
    if abs(volumes[0] - volumes[1]) > 1e-6 * max(map(abs, volumes)):
        parts.append(f"volume {quantities.change(1e3 * volumes[0], 1e3 * volumes[1], 'l')}")
    return f"{shown} ({', '.join(parts) or 'the same triangles but for their order or last digits'})"


def _triangles(name: str, data: bytes, scale: _Three) -> Floats:
    vertices, faces = read_faces(name, data)
    triangles: Floats = vertices[faces] * np.array(scale)
    return triangles


def _text_difference(a: Mapping[str, bytes], b: Mapping[str, bytes]) -> str:
    lines: list[str] = []
    for name in sorted(set(a) | set(b)):
        if _is_text(name) and a.get(name) != b.get(name):
            old, new = (files.get(name, b"").decode(errors="replace").splitlines() for files in (a, b))
            lines += difflib.unified_diff(old, new, f"baseline/{name}", f"candidate/{name}", lineterm="", n=2)
    cut = [f"... and {len(lines) - _TEXT_LINES} more lines"] if len(lines) > _TEXT_LINES else []
    return "\n".join([*lines[:_TEXT_LINES], *cut])


def _is_text(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in _TEXTS
