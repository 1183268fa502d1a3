"""The reference of the language as Markdown, from the descriptions in its JSON Schema.

`python -m replay.scenario.reference` writes it into `schemas/README.md`, below the mark.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from replay.scenario.model import Scenario
from replay.scenario.schema import schema_text

MARK: Final = "<!-- Below this line: written by `make schemas` from the descriptions in replay/scenario. -->\n"
_ROOT = "A scenario"


def reference() -> str:
    """Return the reference: a section for each part of a scenario, each quantity, each choice."""
    schema = json.loads(schema_text(Scenario))
    parts = {name: body for name, body in schema["$defs"].items() if "properties" in body}
    lines = ["## Reference", "", *_section(_ROOT, schema)]
    for name in _in_order(schema, parts):
        lines += _section(_title(name), parts[name])
    lines += ["### Quantities", "", "| quantity | bounds | units of a text |", "|---|---|---|"]
    for name, body in schema["$defs"].items():
        if "properties" not in body and (row := _quantity(body)):
            lines.append(f"| {_title(name)} | {row[0]} | {row[1]} |")
    return "\n".join(lines) + "\n"


def _in_order(schema: dict[str, Any], parts: dict[str, Any]) -> list[str]:
    """Return the names of parts as a reader meets them: breadth first from the scenario."""
    found: dict[str, None] = {}
    pending = [schema]
    while pending:
        for name in _references(pending.pop(0).get("properties", {})):
            if name in parts and name not in found:
                found[name] = None
                pending.append(parts[name])
    return list(found)


def _references(value: Any) -> Iterator[str]:
    if isinstance(value, list):
        for item in value:
            yield from _references(item)
    elif isinstance(value, dict):
        if "$ref" in value:
            yield value["$ref"].rpartition("/")[2]
        for key, item in value.items():
            if key != "$ref":
                yield from _references(item)


def _section(title: str, body: dict[str, Any]) -> Iterator[str]:
    yield f"### {title}"
    yield ""
    if description := _line(body.get("description", "")):
        yield from (description, "")
    yield from ("| key | value | |", "|---|---|---|")
    required = set(body.get("required", ()))
    for key, value in body["properties"].items():
        kind, text = _cell(_kind(value)), _cell(_line(value.get("description", "")))
        if "default" in value:
            text += f" Default: `{_cell(json.dumps(value['default'], ensure_ascii=False))}`."
        yield f"| `{key}`{' (required)' if key in required else ''} | {kind} | {text} |"
    yield ""


def _kind(value: dict[str, Any]) -> str:
    """Return what may stand at a key, in a few words."""
    if "$ref" in value:
        return _title(value["$ref"].rpartition("/")[2])
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return " or ".join(f"`{one}`" for one in value["enum"])
    for key in ("anyOf", "oneOf"):
        if key in value:
            return " or ".join(dict.fromkeys(_kind(one) for one in value[key] if one.get("type") != "null"))
    if value.get("type") == "array":
        if "prefixItems" in value:
            kinds = dict.fromkeys(_kind(one) for one in value["prefixItems"])
            return f"{len(value['prefixItems'])} × {' or '.join(kinds)}"
        return f"list of {_kind(value.get('items', {}))}"
    if value.get("type") == "object":
        inside = value.get("additionalProperties") or next(iter(value.get("patternProperties", {}).values()), None)
        return f"by name: {_kind(inside)}" if isinstance(inside, dict) else "mapping"
    kind = str(value.get("type", "anything"))
    return {"string": "text", "boolean": "true or false"}.get(kind, kind)


def _quantity(body: dict[str, Any]) -> tuple[str, str] | None:
    """Return bounds and units of a quantity's definition; None of something else."""
    kinds = body.get("anyOf", [body])
    number = next((one for one in kinds if one.get("type") == "number"), None)
    if number is None:
        return None
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    bounds = ", ".join(f"{sign} {number[key]:g}" for key, sign in signs.items() if key in number)
    pattern = next((one["pattern"] for one in kinds if "pattern" in one), "")
    units = re.search(r"\(([^()]*)\)\\s\*\$$", pattern)
    words = [f"`{word}`" for one in kinds for word in one.get("enum", ())]
    told = units[1].replace("\\", "").replace("|", " ") if units else ""
    return bounds or "any", ", ".join(filter(None, [told, *words])) or "none: a number"


def _title(name: str) -> str:
    """Return the name of a class as a heading: "CapacitiveSensorPart" is "Capacitive sensor"."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name.removesuffix("Part").replace("_", " "))
    return words[:1].upper() + words[1:].lower()


def _line(text: str) -> str:
    return " ".join(text.split())


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def write(file: Path) -> None:
    """Write the reference below the mark of a file; what stands above it stays."""
    above = file.read_text(encoding="utf-8").partition(MARK)[0]
    file.write_text(f"{above}{MARK}\n{reference()}", encoding="utf-8")


if __name__ == "__main__":
    write(Path(__file__).resolve().parents[2] / "schemas" / "README.md")
