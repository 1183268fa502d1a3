"""The JSON Schema of the language, for editors; `python -m replay.scenario.schema` writes it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from replay.language.fields import Part
from replay.language.units import QUANTITY_KEY
from replay.scenario.methods import BUILTIN_MODELS, Model
from replay.scenario.model import Fragment, Scenario

FILES: Final[dict[str, type[Part]]] = {
    "scenario.schema.json": Scenario,
    "fragment.schema.json": Fragment,
    "model.schema.json": Model,
}


def schema_text(model: type[Part]) -> str:
    """Return the JSON Schema (draft 2020-12) of a scenario, of an included fragment or of a model, as text."""
    schema = model.model_json_schema(mode="validation")
    definitions: dict[str, Any] = schema.pop("$defs")
    quantities: dict[str, Any] = {}
    definitions = {name: _hoisted(body, quantities) for name, body in definitions.items()}
    body = _hoisted(schema, quantities)
    if "model" in body["properties"]:
        name = body["properties"]["model"]
        body["properties"]["model"] = {
            "description": name.pop("description"),
            "anyOf": [{"$ref": name.pop("$ref")}, {"type": "string", "enum": sorted(BUILTIN_MODELS)}],
        }
    result = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **body,
        "$defs": dict(sorted((definitions | quantities).items())),
    }
    return json.dumps(result, indent=1, ensure_ascii=False) + "\n"


def _hoisted(schema: Any, quantities: dict[str, Any]) -> Any:
    """Replace each quantity by a reference to one definition of its type, and drop generated titles."""
    if isinstance(schema, list):
        return [_hoisted(item, quantities) for item in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: value for key, value in schema.items() if not (key == "title" and isinstance(value, str))}
    if isinstance(kept.get("default", 0), dict | None):
        del kept["default"]  # an empty part, or nothing: the key may be left out
    if "patternProperties" in kept:
        kept["additionalProperties"] = False
    name = kept.pop(QUANTITY_KEY, None)
    if name is None:
        return {key: _hoisted(value, quantities) for key, value in kept.items()}
    beside = {key: kept.pop(key) for key in ("description", "default") if key in kept}
    quantities[name] = kept
    return {**beside, "$ref": f"#/$defs/{name}"}


def main() -> None:
    """Write the schemas of this checkout."""
    folder = Path(__file__).resolve().parents[2] / "schemas"
    folder.mkdir(exist_ok=True)
    for name, model in FILES.items():
        (folder / name).write_text(schema_text(model), encoding="utf-8")
        print(folder / name)


if __name__ == "__main__":
    main()
