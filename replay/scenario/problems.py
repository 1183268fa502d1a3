"""pydantic's errors as problems with a place, in the words of the language."""

from __future__ import annotations

import difflib
import itertools
import types
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from replay import limits
from replay.errors import Problem
from replay.guarding.part import CONDITIONS, condition_key
from replay.language import decimal_comma
from replay.language.descriptions import described
from replay.language.fields import NAME_RULE, TITLE_RULE, Name, Title
from replay.language.node import KeyPath, Node
from replay.scenario.expectations import PARTS
from replay.scenario.shapes import MESH_FILE_RULE, Color, MeshFile
from replay.scenario.source import dotted, find, locate, problem_at

Finding = tuple[KeyPath, str]
"""The path of a value, and the rule it breaks."""

_LIKELY, _LONG = 500, 200
"""How many names a word is compared with, and how much of it: the time grows with their product."""


def did_you_mean(word: str, known: Iterable[str], *, what: str = "known are") -> str:
    """Return "did you mean 'x'?", or all that is known when nothing is close."""
    names = list(itertools.islice(known, _LIKELY))
    close = difflib.get_close_matches(word[:_LONG], names, n=1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]!r}?"
    shown = ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
    return f"{what} {shown}" if names else "there are none"


def translate(error: ValidationError, root: Node, model: type[BaseModel]) -> list[Problem]:
    """Return one problem for each thing that is wrong.

    Args:
        error: raised when `root` was validated as `model`.
        root: the text's tree.
        model: the model.
    """
    problems: dict[str, Problem] = {}
    for detail in error.errors(include_url=False, include_input=False)[: limits.PROBLEMS]:
        if detail["type"] == "too_short" and _long_enough(detail, root, model):
            continue  # pydantic counts only the valid entries, and has told of the others
        problem = _translate(detail, root, model)
        problems.setdefault(str(problem), problem)
    return list(problems.values())


def _long_enough(detail: Any, root: Node, model: type[BaseModel]) -> bool:
    node = find(root, _follow(detail["loc"], root, model).path)
    return node is not None and len(node.sequence or node.mapping) >= detail["ctx"]["min_length"]


def _translate(detail: Any, root: Node, model: type[BaseModel]) -> Problem:
    kind: str = detail["type"]
    context: dict[str, Any] = detail.get("ctx", {})
    found = _follow(detail["loc"], root, model)
    path, owner = found.path, found.owner
    last = detail["loc"][-1] if detail["loc"] else ""
    if found.on_key:
        rule = f"{dotted(path)}: a name {NAME_RULE}"
        above = find(root, path[:-1])
        place = above.keys[str(path[-1])] if above is not None and path else root.place
        return place.problem(rule)
    if kind == "missing":
        return _missing(found, last, root)
    if kind == "extra_forbidden":
        fields = {} if owner is None else owner.model_fields
        known = [field.alias or name for name, field in fields.items()]
        above = find(root, path[:-1])
        place = above.keys.get(str(path[-1]), root.place) if above is not None else root.place
        return place.problem(f"{dotted(path)}: unknown key; {did_you_mean(str(path[-1]), known)}")
    if kind in ("rule", "quantity"):
        return problem_at(root, (*path, *context.get("at", ())), context["rule"], kind=kind == "quantity")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _tag(kind, context, found, root)
    rule = _rule(kind, context, detail["msg"], find(root, path))
    if kind == "tuple_type" and found.entries:
        rule += f" of {found.entries}"
    return problem_at(root, path, rule, kind=kind.endswith("_type") or kind == "literal_error")


def _rule(kind: str, context: dict[str, Any], message: str, node: Node | None) -> str:
    match kind:
        case "string_type":
            scalar = node is not None and not isinstance(node.value, dict | list | None)
            return "must be text" + ("; write it in quotes" if scalar else "")
        case "bool_type":
            return "must be true or false"
        case "int_type":
            return "must be a whole number"
        case "dict_type" | "model_type" | "model_attributes_type" | "mapping_type":
            empty = node is not None and node.value is None
            return "must be a mapping (key: value)" + ("; write {} for an empty one" if empty else "")
        case "list_type" | "tuple_type":
            return "must be a list"
        case "literal_error":
            return f"must be {context['expected']}"
        case "string_pattern_mismatch":
            return _PATTERN_RULES.get(context["pattern"], "must be one word, without spaces or , : /")
        case "string_too_short":
            return "must not be empty"
        case "string_too_long":
            return f"is longer than {context['max_length']} characters"
        case "too_short":
            return f"must have at least {context['min_length']} entr{'y' if context['min_length'] == 1 else 'ies'}"
        case "too_long":
            items = node.sequence if node is not None else []
            return f"needs {context['max_length']} entries, not {context['actual_length']}{decimal_comma.hint(items)}"
        case "greater_than_equal":
            return f"must be at least {context['ge']}"
        case "less_than_equal":
            return f"must be at most {context['le']}"
        case _:
            return f"is not valid: {message}"


def _pattern_of(annotation: Any) -> str:
    return str(next(item.pattern for item in get_args(annotation)[1:] if getattr(item, "pattern", None)))


_PATTERN_RULES = {
    _pattern_of(Name): NAME_RULE,
    _pattern_of(Title): TITLE_RULE,
    _pattern_of(Color): "must be a colour such as '#b0b4bc'",
    _pattern_of(MeshFile): MESH_FILE_RULE,
}


def _missing(found: _Location, last: str | int, root: Node) -> Problem:
    path = found.path
    if isinstance(last, int):
        node = find(root, path)
        count = len(node.sequence) if node is not None else 0
        return locate(root, path).problem(f"{dotted(path)} needs {found.length} entries, not {count}")
    about = None if found.owner is None else described(found.owner, last)
    hint = f"; {' '.join(about.split()).rstrip('.')}" if about else ""
    return locate(root, path).problem(f"{dotted((*path, last))} is missing{hint}")


def _tag(kind: str, context: dict[str, Any], found: _Location, root: Node) -> Problem:
    path = found.path
    if kind == "union_tag_invalid":
        known = [tag.strip().strip("'") for tag in context["expected_tags"].split(",")]
        return problem_at(root, (*path, "type"), f"is unknown; {did_you_mean(str(context['tag']), known)}")
    if context["discriminator"] == "'type'":
        node = find(root, path)
        if node is not None and not isinstance(node.value, dict):
            return problem_at(root, path, "must be a mapping (key: value)", kind=True)
        return locate(root, path).problem(f"{dotted((*path, 'type'))} is missing; known are {', '.join(found.tags)}")
    keys = CONDITIONS if context["discriminator"].startswith(condition_key.__name__) else PARTS
    return problem_at(root, path, f"needs one of the keys {', '.join(keys)}")


@dataclass(frozen=True)
class _Location:
    """Where an error is.

    Attributes:
        owner, length: the model, and the length of the list, that the last step belongs to.
        tags: the types that the value may have, where it is one of several.
        entries: how many entries the value has, where it is a list of so many.
    """

    path: KeyPath
    owner: type[BaseModel] | None = None
    length: int | None = None
    on_key: bool = False
    tags: tuple[str, ...] = ()
    entries: int | None = None


def _follow(loc: Sequence[str | int], root: Node, model: type[BaseModel]) -> _Location:
    """Return where an error is; pydantic's locations hold the tags of unions beside the keys of the text."""
    path: list[str | int] = []
    node: Node | None = root
    annotation: Any = model
    owner: type[BaseModel] | None = None
    length: int | None = None
    for step in loc:
        annotation = _plain(annotation)
        chosen = _choose(annotation, step)
        if chosen is not None:
            annotation = chosen
            continue
        if step == "[key]":
            return _Location(tuple(path), on_key=True)
        owner = annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None
        length = _entries(annotation)
        annotation = _below(annotation, step)
        below = None if node is None else node.child(step)
        if below is None:
            break
        node = below
        path.append(step)
    plain = _plain(annotation)
    tags = (_tags(member) for member in get_args(plain)) if get_origin(plain) in (Union, types.UnionType) else ()
    known = tuple(tag for several in tags for tag in several)
    return _Location(tuple(path), owner, length, tags=known, entries=_entries(plain))


def _entries(annotation: Any) -> int | None:
    """Return how many entries a list of fixed length has; None for other values."""
    fixed = get_origin(annotation) is tuple and Ellipsis not in get_args(annotation)
    return len(get_args(annotation)) if fixed else None


def _plain(annotation: Any) -> Any:
    """Strip Annotated and an optional None."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
        elif get_origin(annotation) in (Union, types.UnionType):
            members = [member for member in get_args(annotation) if member is not type(None)]
            if len(members) > 1:
                return annotation
            annotation = members[0]
        else:
            return annotation


def _choose(annotation: Any, step: str | int) -> Any:
    """Return the member of a union that a tag stands for, or None when this is no union."""
    if get_origin(annotation) not in (Union, types.UnionType):
        return None
    return next((member for member in get_args(annotation) if step in _tags(member)), None)


def _tags(member: Any) -> list[Any]:
    """Return what selects a member of a union: its tag, or its literal `type`."""
    tags = [getattr(item, "tag", None) for item in get_args(member)[1:]] if get_origin(member) is Annotated else []
    fields = getattr(_plain(member), "model_fields", {})
    if "type" in fields and get_origin(fields["type"].annotation) is Literal:
        tags.extend(get_args(fields["type"].annotation))
    return tags


def _below(annotation: Any, step: str | int) -> Any:
    """Return the annotation of what a mapping, list or model holds under a key."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        field = annotation.model_fields.get(str(step))
        return None if field is None else field.annotation
    arguments = get_args(annotation)
    if get_origin(annotation) is dict:
        return arguments[1]
    if get_origin(annotation) is tuple and isinstance(step, int) and Ellipsis not in arguments:
        return arguments[min(step, len(arguments) - 1)]
    return arguments[0] if arguments else None
