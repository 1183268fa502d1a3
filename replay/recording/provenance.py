"""Where a recording comes from: versions, model, inputs; and the names behind its columns.

Nothing here depends on the machine's name, the clock or a path, so that the same inputs give the same bytes.
"""

from __future__ import annotations

import functools
import hashlib
import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata, resources
from importlib.resources.abc import Traversable
from typing import Annotated, Any

from pydantic import FailFast, Field
from typing_extensions import TypedDict

import replay
from replay import limits
from replay.errors import LimitError, RecordingError
from replay.json_text import read_json, typed
from replay.simulation import BLOCK_FRAMES, Layout, block_frames

FORMAT = 2
"""Version of the recording format that is written."""
READABLE_FORMATS = (1, 2)
"""Versions that are read: the one that is written and the one before."""
RECORD = "replay"
"""Name of the MCAP metadata record that holds the provenance."""
WITHOUT_RESULTS = ("bench", "cli")
"""Rooms that nothing is imported from on the way to a recording: after a change of theirs a run can be resumed."""
LIBRARIES = ("numba", "numpy", "protobuf", "python-fcl", "scipy", "trimesh", "vhacdx", "zstandard")


@dataclass(frozen=True)
class Provenance:
    """What a recording says about itself.

    Attributes:
        scenario: name of the scenario.
        root: name of the attachment that is the scenario itself; it refers to the others by their names.
        frames: frames that the scenario has; a salvaged recording holds fewer.
        layout: the names behind the columns.
        model: the resolved model, with the revision of each method.
        files: SHA-256 of each attached file, by its name among the attachments.
        code: SHA-256 of the package's sources, see `code_identity`.
        version: of the package.
        libraries: versions of the libraries that numbers may depend on.
        block_frames: frames a block.
        format: version of the recording format.
        originals: name and SHA-256 of the file that an attachment is an excerpt of, by the attachment's name; and its
            `use`, of one that no reading depends on: "measured".
    """

    scenario: str
    root: str
    frames: int
    layout: Layout
    model: Mapping[str, Any]
    files: Mapping[str, str]
    code: str
    version: str
    libraries: Mapping[str, str]
    block_frames: int = BLOCK_FRAMES
    format: int = FORMAT
    originals: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def to_metadata(self) -> dict[str, str]:
        """Return the values of the MCAP metadata record, each as JSON with sorted keys; `originals` only if any."""
        values = vars(self) | {"layout": self.layout.to_json()}
        if not self.originals:
            del values["originals"]
        return {key: json.dumps(value, sort_keys=True, ensure_ascii=False) for key, value in values.items()}

    @staticmethod
    def from_metadata(file: str, values: Mapping[str, str]) -> Provenance:
        """Return the provenance that a metadata record holds.

        Raises:
            RecordingError: the format version is not one that is read, or a value is missing or not what it should be.
        """
        if sum(map(len, values.values())) > limits.RECORD_JSON:
            raise LimitError(file, f"has metadata of more than {limits.RECORD_JSON} bytes")
        try:
            version = read_json(values["format"])
            if version not in READABLE_FORMATS:
                readable = " and ".join(map(str, READABLE_FORMATS))
                raise RecordingError(file, f"has recording format {version}; this version of replay reads {readable}")
            written = {"originals": "{}", **values}
            known = typed({name: read_json(written[name]) for name in _WRITTEN if name in written}, _Written)
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(file, f"damaged: its metadata cannot be used ({error})") from None
        if sum(map(len, known["layout"].values())) > limits.NAMES:
            raise LimitError(file, f"has more than {limits.NAMES} names of links, joints, pairs and sensors")
        try:
            layout = Layout.from_json(known["layout"])
        except KeyError as error:
            raise RecordingError(file, f"damaged: its metadata has no names of {error}") from None
        if len(layout.joints) != len(layout.joint_units):
            raise RecordingError(file, "damaged: its metadata has joints without a unit, or units without a joint")
        return Provenance(**{**known, "layout": layout})  # type: ignore[arg-type]


_Names = Annotated[list[str], FailFast()]
_Count = Annotated[int, Field(ge=0, lt=1 << 53)]
_Option = str | int | float | bool | None


class _Written(TypedDict):
    """A metadata record, value by value."""

    scenario: str
    root: str
    frames: _Count
    layout: dict[str, _Names]
    model: dict[str, _Option | dict[str, _Option]]
    files: dict[str, str]
    code: str
    version: str
    libraries: dict[str, str]
    block_frames: Annotated[int, Field(ge=1, lt=1 << 31)]
    format: int
    originals: dict[str, dict[str, str]]


_WRITTEN = tuple(_Written.__annotations__)


def sha256(data: bytes) -> str:
    """Return the SHA-256 of bytes as hexadecimal text."""
    return hashlib.sha256(data).hexdigest()


@functools.cache
def code_identity() -> str:
    """Return the identity of this package's sources: the same wherever it is installed."""
    return identity_of(resources.files("replay"))


def identity_of(package: Traversable) -> str:
    """Return a SHA-256 over names and contents of a package's sources, without the rooms that no result depends on."""
    digest = hashlib.sha256()
    for name, data in sorted(_sources(package, "")):
        digest.update(f"{name}\0{len(data)}\0".encode())
        digest.update(data)
    return digest.hexdigest()


@functools.cache
def library_versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that numbers may depend on, without importing them."""
    versions = {"python": platform.python_version()}
    for name in LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def describe(
    scenario: str,
    root: str,
    files: Mapping[str, bytes],
    *,
    frames: int,
    layout: Layout,
    model: Mapping[str, Any],
    originals: Mapping[str, Mapping[str, str]] | None = None,
) -> Provenance:
    """Return the provenance of a recording that this package, in this environment, is about to make."""
    return Provenance(
        scenario=scenario,
        root=root,
        frames=frames,
        layout=layout,
        model=model,
        files={name: sha256(data) for name, data in sorted(files.items())},
        code=code_identity(),
        version=replay.__version__,
        libraries=library_versions(),
        block_frames=block_frames(len(layout.pairs)),
        originals=originals or {},
    )


def _sources(folder: Traversable, prefix: str) -> list[tuple[str, bytes]]:
    found = []
    for entry in folder.iterdir():
        if entry.is_dir():
            if entry.name != "__pycache__" and prefix + entry.name not in WITHOUT_RESULTS:
                found += _sources(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".py"):
            found.append((prefix + entry.name, entry.read_bytes()))
    return found
