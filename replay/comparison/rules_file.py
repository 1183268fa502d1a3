"""Rules as a YAML file: `rules_version: 1` and `rules`, each with its pattern, tolerances and reason.

`python -m replay.comparison.rules_file` writes the JSON Schema of the language, for editors.
"""

from __future__ import annotations

import datetime
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, PlainValidator, ValidationError, WithJsonSchema

from replay.comparison.rules import Rule, Rules, Tolerance
from replay.errors import InvalidValue, ScenarioError
from replay.language.fields import Flag, Part, Text, rejected
from replay.language.node import Node
from replay.language.units import TIME, Quantity
from replay.scenario.problems import translate
from replay.scenario.source import locate
from replay.scenario.yaml_file import read_yaml

SCHEMA_FILE: Final = "rules.schema.json"

_FRAMES = re.compile(r"\s*([0-9]{1,9})\s+frames?\s*")
_TIME = Quantity("Time", TIME, at_least=0.0)


@dataclass(frozen=True)
class Shift:
    """How far an event may move: in seconds, or in frames whatever the rate."""

    seconds: float = 0.0
    frames: int = 0


def _shift(value: object) -> Shift:
    if isinstance(value, str):
        found = _FRAMES.fullmatch(value)
        if found is not None:
            return Shift(frames=int(found[1]))
        if "frame" in value:
            raise rejected("must be a whole number of frames, such as '1 frame', or a time, such as '20 ms'")
    return Shift(seconds=float(_TIME.parse(value)))


def _bound(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= sys.float_info.max:
        raise rejected("must be a number that is not negative, in the signal's SI unit")
    return float(value)


def _patterns(value: object) -> tuple[str, ...]:
    patterns = [value] if isinstance(value, str) else value
    if not isinstance(patterns, list) or not patterns:
        raise rejected("must be a pattern such as '/collision/clearance/*', or a list of them")
    for k, pattern in enumerate(patterns):
        if not isinstance(pattern, str) or not pattern.startswith(("/", "*")):
            at = () if isinstance(value, str) else (k,)
            raise rejected("must be a pattern of full names, which begin with '/': '/distance/*/point.x'", at)
    return tuple(patterns)


def _globs(value: object) -> tuple[str, ...]:
    globs = [value] if isinstance(value, str) else value
    if not isinstance(globs, list) or not globs or not all(isinstance(glob, str) and glob for glob in globs):
        raise rejected("must be the name of a scenario or a pattern such as 'carm_*', or a list of them")
    return tuple(globs)


def _day(value: object) -> datetime.date:
    try:
        if isinstance(value, str) and re.fullmatch(r"\d{4}-\d{2}-\d{2}", value):
            return datetime.date.fromisoformat(value)
    except ValueError:
        pass
    raise rejected("must be a date such as 2027-03-31")


def _not_blank(value: str) -> str:
    if not value.strip():
        raise rejected("must say why the difference is acceptable")
    return value


_SECONDS_SCHEMA = [
    {"type": "number", "minimum": 0},
    {"type": "string", "pattern": r"^\s*[0-9.eE+-]+\s*(s|ms|us|ns|min)\s*$"},
]
_FRAMES_SCHEMA = {"type": "string", "pattern": r"^\s*[0-9]{1,9}\s+frames?\s*$"}
_TIME_SCHEMA = {"anyOf": _SECONDS_SCHEMA}
_SHIFT_SCHEMA = {"anyOf": [*_SECONDS_SCHEMA, _FRAMES_SCHEMA]}
_PATTERN_SCHEMA = {"type": "string", "pattern": r"^[/*]"}
_PATTERNS_SCHEMA = {"anyOf": [_PATTERN_SCHEMA, {"type": "array", "items": _PATTERN_SCHEMA, "minItems": 1}]}
_GLOB_SCHEMA = {"type": "string", "minLength": 1}
_GLOBS_SCHEMA = {"anyOf": [_GLOB_SCHEMA, {"type": "array", "items": _GLOB_SCHEMA, "minItems": 1}]}
_DAY_SCHEMA = {"type": "string", "pattern": r"^\d{4}-\d{2}-\d{2}$", "format": "date"}

Bound = Annotated[float, PlainValidator(_bound), WithJsonSchema({"type": "number", "minimum": 0})]


class RuleText(Part):
    """A tolerance for the signals that a pattern matches; the first rule from the top that matches counts."""

    signal: Annotated[tuple[str, ...], PlainValidator(_patterns), WithJsonSchema(_PATTERNS_SCHEMA)]
    """Full names: topic/field/name, such as /collision/clearance/arc/bow|table/top; * matches anything, / included."""
    scenario: Annotated[tuple[str, ...], PlainValidator(_globs), WithJsonSchema(_GLOBS_SCHEMA)] = ()
    """Scenarios that the rule is for, by name or pattern; all when left out."""
    reason: Annotated[Text, AfterValidator(_not_blank)]
    """Why the difference is acceptable."""
    abs: Bound = 0.0
    """Largest difference of numbers, in the signal's SI unit."""
    rel: Bound = 0.0
    """Largest difference of numbers relative to the larger one; the larger of abs and rel counts."""
    rms: Bound | None = None
    """Largest root mean square of the differences over all frames; without abs and rel it alone counts."""
    time: Annotated[Shift, PlainValidator(_shift), WithJsonSchema(_SHIFT_SCHEMA)] = Shift()
    """Largest shift of an event: seconds, '20 ms', or '1 frame'."""
    bracket: Annotated[float, PlainValidator(_TIME.parse), WithJsonSchema(_TIME_SCHEMA)] | None = None
    """Largest gap between the brackets of an event that is known more finely than by frames: '100 us'; as time when
    left out."""
    nan: Literal["equal", "fail"] = "equal"
    """equal: NaN in both runs is equal. fail: any NaN is a difference."""
    zero: Literal["equal", "signed"] = "equal"
    """equal: 0.0 and -0.0 are equal. signed: they differ."""
    ignore: Flag = False
    """Do not compare; the signal may also be missing or extra."""
    link: Text | None = None
    """Where a known difference is discussed."""
    expires: Annotated[datetime.date, PlainValidator(_day), WithJsonSchema(_DAY_SCHEMA)] | None = None
    """Last day on which a known difference is accepted: 2027-03-31."""


class RulesText(Part):
    """Tolerances for comparing two recordings; without a matching rule a signal must be equal."""

    rules_version: Literal[1]
    """Version of this language; the key is not `version`, which marks scenarios in a folder."""
    rules: tuple[RuleText, ...]
    """Rules; the first that matches a signal counts."""


def read_rules(path: str | Path, *, today: datetime.date | None = None) -> Rules:
    """Read a rules file.

    Args:
        path: of the YAML file.
        today: the day on which expiry dates are judged; needed only when a rule has one.

    Raises:
        ScenarioError: everything that is wrong, each with file, line and column.
        InvalidValue: a rule expires and `today` is not given.
    """
    root = read_yaml(Path(path))
    rules = _validated(root)
    if today is None and any(rule.expires is not None for rule in rules):
        raise InvalidValue("today", None, f"must be a date, because rules in {root.place.file} expire")
    return Rules.on(today or datetime.date.min, rules)


def _validated(root: Node) -> list[Rule]:
    if not isinstance(root.value, dict):
        raise ScenarioError([root.place.problem("a rules file is a mapping with rules_version and rules")])
    try:
        text = RulesText.model_validate(root.data())
    except ValidationError as error:
        raise ScenarioError(translate(error, root, RulesText)) from None
    return [_rule(rule, str(locate(root, ("rules", k, "signal")))) for k, rule in enumerate(text.rules)]


def _rule(text: RuleText, place: str) -> Rule:
    tolerance = Tolerance(
        abs=text.abs,
        rel=text.rel,
        rms=text.rms,
        time=text.time.seconds,
        frames=text.time.frames,
        bracket=text.bracket,
        nan=text.nan,
        zero=text.zero,
        ignore=text.ignore,
    )
    return Rule(text.signal, tolerance, text.reason, text.link, text.expires, place, text.scenario)


def schema_text() -> str:
    """Return the JSON Schema (draft 2020-12) of a rules file, as text."""
    schema = _tidy(RulesText.model_json_schema(mode="validation"))
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}, indent=1) + "\n"


def _tidy(schema: Any) -> Any:
    """Drop generated titles, and defaults that are spelt by leaving the key out."""
    if isinstance(schema, list):
        return [_tidy(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: value for key, value in schema.items() if not (key == "title" and isinstance(value, str))}
    if isinstance(kept.get("default", 0), dict | None):
        del kept["default"]
    return {key: _tidy(value) for key, value in kept.items()}


def main() -> None:
    """Write the schema of this checkout."""
    folder = Path(__file__).resolve().parents[2] / "schemas"
    folder.mkdir(exist_ok=True)
    (folder / SCHEMA_FILE).write_text(schema_text(), encoding="utf-8")


if __name__ == "__main__":
    main()
