"""What every part of the language shares: the base of its models, names, vectors, flags and poses."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    StrictBool,
    StringConstraints,
    TypeAdapter,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from replay.language.descriptions import described
from replay.language.node import KeyPath
from replay.language.units import Angle, Length, Number, Size
from replay.numerics import transforms
from replay.numerics.arrays import Floats


def _describe(schema: dict[str, Any], model: type[BaseModel]) -> None:
    """Put the description of each key into a model's JSON schema."""
    for key, field in model.model_fields.items():
        text = described(model, key)
        if text:
            schema["properties"][field.alias or key].setdefault("description", text)


class Part(BaseModel):
    """A mapping of the language: unknown keys are errors, and nothing changes after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True, json_schema_extra=_describe)


def with_keys(base: type[Part], **keys: tuple[Any, Any]) -> Any:
    """Return a part of the same name, without its leading "_", with more keys: each a type and pydantic's `Field`."""
    name = base.__name__.removeprefix("_")
    return create_model(name, __base__=base, __module__=base.__module__, __doc__=base.__doc__, **keys)  # type: ignore[call-overload]


def rejected(rule: str, at: KeyPath = ()) -> PydanticCustomError:
    """Return the error to raise when a value breaks a rule; `at` leads from the validated value to the culprit."""
    return PydanticCustomError("rule", "{rule}", {"rule": rule, "at": list(at)})


_NAME = r"^[A-Za-z0-9_][A-Za-z0-9_.\-]*$"
NAME_RULE = "must start with a letter, digit or _, and go on with letters, digits, _ . or - (at most 100 characters)"

Name = Annotated[str, StringConstraints(pattern=_NAME, max_length=100)]
"""Name of a link, shape, joint, sensor or plate; it becomes part of topics and of pair names."""

_TITLE = r"^[^./\\\x00-\x1f\x7f-\x9f][^/\\\x00-\x1f\x7f-\x9f]*$"
TITLE_RULE = "must have 1 to 100 characters, must not start with '.' and must not hold / \\ or control characters"

MAX_TITLE_BYTES = 200  # file systems take names of 255 bytes, and ".mcap.part" is added to it


_DEVICES = ("CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(1, 10)))
_OWN_FILES = ["run.json", "index.html", "junit.xml", "summary.md", "metrics.parquet", "history.jsonl", "accepted.jsonl"]
_INVISIBLE = re.compile("[\u061c\u200b\u200e\u200f\u2028-\u202e\u2060\u2066-\u2069\ufeff]")
"""Marks that turn the direction of writing, break the line or show nothing: two names would look the same."""


def stands_beside(name: str) -> bool:
    """Return whether a name is that of a file which stands beside scenarios' folders, in a run or baseline folder."""
    return name.casefold() in _OWN_FILES


def _fits_file_systems(title: str) -> str:
    size = len(title.encode())
    if size > MAX_TITLE_BYTES:
        raise rejected(f"takes {size} bytes as the name of a file; at most {MAX_TITLE_BYTES} fit everywhere")
    if title.partition(".")[0].rstrip().upper() in _DEVICES:
        raise rejected("is a device on Windows, where recordings may be looked at; add a word to it")
    if stands_beside(title):
        raise rejected("is the name of a file that stands beside the folders of scenarios; add a word to it")
    if title != title.strip() or title.endswith("."):
        raise rejected("must not begin or end with a space, nor end with '.'; some file systems drop them")
    if hidden := _INVISIBLE.search(title):
        raise rejected(f"must not hold the invisible character U+{ord(hidden.group()):04X}")
    return title


Title = Annotated[str, StringConstraints(pattern=_TITLE, max_length=100), AfterValidator(_fits_file_systems)]
"""Name of a scenario; it becomes the name of a folder and of files."""


def is_title(name: str) -> bool:
    """Return whether a scenario can have a name, which then is that of its folder and no way to another one."""
    try:
        TypeAdapter(Title).validate_python(name)
    except ValidationError:
        return False
    return True


Text = Annotated[str, StringConstraints(max_length=10_000)]
Glob = Annotated[str, StringConstraints(min_length=1, max_length=200)]
"""A name, or a pattern with * ? [abc], matched with case."""

Flag = StrictBool
Vector = tuple[Length, Length, Length]


def _not_zero(values: tuple[float, ...]) -> tuple[float, ...]:
    length = math.hypot(*values)
    if length < 1e-150 or not math.isfinite(length):
        raise rejected("has no direction; at least one number must not be 0")
    return values


def _unit(values: tuple[float, ...]) -> tuple[float, ...]:
    length = math.hypot(*_not_zero(values))
    return tuple(value / length + 0.0 for value in values)


Axis = Annotated[tuple[Number, Number, Number], AfterValidator(_unit)]
Quaternion = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit)]


class Placement(Part):
    """A rotation about and then a move of the origin; `rpy` and `quat_xyzw` exclude each other."""

    xyz: Vector = (0.0, 0.0, 0.0)
    """Position [m]."""
    rpy: tuple[Angle, Angle, Angle] | None = None
    """Roll, pitch, yaw [rad] as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    quat_xyzw: Quaternion | None = None
    """Rotation as a quaternion x, y, z, w; it is normalised."""

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.rpy is not None and self.quat_xyzw is not None:
            raise rejected("and rpy both give the rotation; keep one of the two", at=("quat_xyzw",))
        return self

    def transform(self) -> Floats:
        """Return this as a transform (4, 4) into the frame that it is given in."""
        if self.quat_xyzw is not None:
            T = transforms.from_quaternion(np.array(self.quat_xyzw))
        else:
            T = transforms.from_rpy(np.array(self.rpy or (0.0, 0.0, 0.0)))
        T[:3, 3] = self.xyz
        return T


class Pose(Placement):
    """Where something stands in the frame of what carries it; the default is the same place."""


Size2 = tuple[Size, Size]
Size3 = tuple[Size, Size, Size]

When = Literal["never", "always", "sometimes"]
"""In no frame, in every frame, in at least one."""


def needs_one(part: Part, *keys: str) -> None:
    """Refuse an expectation that says nothing."""
    if all(getattr(part, key) is None for key in keys):
        raise rejected(f"expects nothing; add one of {', '.join(keys)}")


def in_order(low: float | None, high: float | None, unit: str) -> None:
    """Refuse bounds between which there is nothing."""
    if low is not None and high is not None and low > high:
        raise rejected(f"must not be below min, {low:.6g} {unit}", at=("max",))
