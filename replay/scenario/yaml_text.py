"""YAML 1.2 text to a tree of nodes that know their place: line and column of every key and value.

The events come from ruamel.yaml's scanner; what a plain scalar means is decided by `yaml_scalar`.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from typing import Any, Final

from replay import limits
from replay.errors import Problem
from replay.language import decimal_comma
from replay.language.node import Node, Place, Scalar
from replay.scenario.yaml_scalar import meaning

__all__ = ["MAX_DEPTH", "MAX_NODES", "Node", "parse"]

MAX_DEPTH: Final = limits.YAML_DEPTH
MAX_NODES: Final = limits.YAML_NODES
MAX_MESSAGE: Final = 400
"""Characters of what is said of one place."""

_KEPT_BYTES: Final = 16 << 10  # of one file; what is longer is seldom shared, and its tree is large
_KEPT_FILES: Final = 32

_TAG = "tag:yaml.org,2002:"


class _Rejected(Exception):
    """The text cannot be read any further."""


def parse(data: bytes, file: str, problems: list[Problem]) -> Node | None:
    """Read one YAML document.

    The scenarios of a night share what they include: such files are read once, and their trees are copied.

    Args:
        data: the file's bytes, UTF-8.
        file: the name that places carry.
        problems: what is wrong is appended here: everything that still lets the rest be read, or the one that does not.

    Returns:
        The root node, or None when the text is not YAML or empty.
    """
    root, found = _kept(data, file) if len(data) <= _KEPT_BYTES else _read(data, file)
    problems.extend(found)
    return root if root is None else root.copy({})


def _read(data: bytes, file: str) -> tuple[Node | None, list[Problem]]:
    problems: list[Problem] = []
    return _parse(data, file, problems), problems


_kept = functools.lru_cache(maxsize=_KEPT_FILES)(_read)


def _parse(data: bytes, file: str, problems: list[Problem]) -> Node | None:
    if len(data) > limits.YAML_BYTES:
        problems.append(Problem(f"the file has {len(data)} bytes; at most {limits.YAML_BYTES} are read", file=file))
        return None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        known = data.startswith((b"\xff\xfe", b"\xfe\xff"))
        found = "UTF-16 text" if known else f"byte 0x{data[error.start]:02x} is not UTF-8"
        found += "; save the file as UTF-8"
        problems.append(Problem(found, file=file, line=line, column=column))
        return None
    try:
        return _Builder(file, problems).build(text)
    except _Rejected:
        return None


def _events(text: str, file: str, problems: list[Problem]) -> Iterator[Any]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError
    from ruamel.yaml.reader import ReaderError

    line = column = 1
    reader = YAML(typ="safe", pure=True)
    reader.Scanner = _scanner()
    try:
        for event in reader.parse(text):
            line, column = event.end_mark.line + 1, event.end_mark.column + 1
            yield event
    except ReaderError as error:
        found = f"character U+{int(error.character):04X} is not allowed in YAML; remove it"
        before = text[: text.find(chr(error.character))]
        line = before.count("\n") + 1
        problems.append(Problem(found, file=file, line=line, column=len(before) - before.rfind("\n")))
        raise _Rejected from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = re.sub(r"\('(.*)',\)", r"'\1'", " ".join(str(error.problem or error.context).split()))
        if "\\t" in message:
            message = "a tab cannot indent YAML; use spaces"
        elif error.context and error.context_mark is not None:
            begun = f"{error.context_mark.line + 1}:{error.context_mark.column + 1}"
            message = f"{message} ({error.context} that starts at {begun})"
        place = {} if mark is None else {"line": mark.line + 1, "column": mark.column + 1}
        problems.append(Problem(f"not YAML: {message}", file=file, **place))
        raise _Rejected from None
    except Exception as error:  # the scanner lets a bad escape or directive out as whatever Python raised
        problems.append(Problem(f"not YAML after this: {error}", file=file, line=line, column=column))
        raise _Rejected from None


@functools.cache
def _scanner() -> Any:
    """Return ruamel.yaml's scanner with a bound on tags, whose time grows with the square of their length."""
    from ruamel.yaml.scanner import Scanner, ScannerError

    class Bounded(Scanner):
        def scan_tag(self) -> Any:
            if re.match(rf"\S{{{limits.YAML_TAG + 1}}}", self.reader.prefix(limits.YAML_TAG + 1)):
                rule = f"a tag of more than {limits.YAML_TAG} characters"
                raise ScannerError(None, None, rule, self.reader.get_mark())
            return super().scan_tag()

    return Bounded


class _Builder:
    def __init__(self, file: str, problems: list[Problem]) -> None:
        self.file = file
        self.problems = problems
        self.anchors: dict[str, Node | None] = {}
        self.nodes = 0
        self.whole = True

    def build(self, text: str) -> Node | None:
        self.events = _events(text, self.file, self.problems)
        root: Node | None = None
        documents = 0
        for event in self.events:
            match type(event).__name__:
                case "StreamStartEvent" | "StreamEndEvent" | "DocumentEndEvent":
                    continue
                case "DocumentStartEvent":
                    documents += 1
                    if documents > 1:
                        self.reject(event, "a second document starts here; a file holds one")
                    if event.version is not None and tuple(event.version) != (1, 2):
                        written = ".".join(str(part) for part in event.version)
                        self.reject(event, f"%YAML {written}: only YAML 1.2 is read; remove this line")
                case _:
                    root = self.node(event, 1)
        if root is None or (root.value is None and not root.text):
            self.problems.append(Problem("the file is empty", file=self.file))
            return None
        root.whole = self.whole
        return root

    def place(self, event: Any) -> Place:
        return Place(self.file, event.start_mark.line + 1, event.start_mark.column + 1)

    def report(self, event: Any, message: str) -> None:
        if len(message) > MAX_MESSAGE:
            message = f"{message[: MAX_MESSAGE // 2]}...{message[-MAX_MESSAGE // 4 :]}"
        self.problems.append(self.place(event).problem(message))
        if len(self.problems) >= limits.PROBLEMS:
            self.problems.append(Problem(f"more is wrong than the {limits.PROBLEMS} that are told", file=self.file))
            raise _Rejected

    def reject(self, event: Any, message: str) -> None:
        self.report(event, message)
        raise _Rejected

    def count(self, event: Any, nodes: int) -> None:
        self.nodes += nodes
        if self.nodes > MAX_NODES:
            self.reject(event, f"more than {MAX_NODES} values with every alias written out")

    def node(self, event: Any, depth: int) -> Node:
        kind = type(event).__name__
        if kind == "AliasEvent":
            return self.alias(event)
        if depth > MAX_DEPTH:
            self.reject(event, f"collections nested more than {MAX_DEPTH} deep")
        self.count(event, 1)
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if kind == "ScalarEvent":
            node = self.scalar(event)
        elif kind == "MappingStartEvent":
            self.check_collection_tag(event, "map")
            node = self.mapping(event, depth)
        else:
            self.check_collection_tag(event, "seq")
            node = self.sequence(event, depth)
        if event.anchor is not None:
            self.anchors[event.anchor] = node
        return node

    def alias(self, event: Any) -> Node:
        if event.anchor not in self.anchors:
            self.reject(event, f"alias *{event.anchor} has no anchor &{event.anchor} above it")
        node = self.anchors[event.anchor]
        if node is None:
            self.reject(event, f"alias *{event.anchor} is inside its own anchor")
        assert node is not None
        self.count(event, node.size)
        return node

    def mapping(self, start: Any, depth: int) -> Node:
        node = Node(self.place(start), {})
        before, end = "", -1  # of the value before: its text, and where it ends
        for event in self.events:
            if type(event).__name__ == "MappingEndEvent":
                break
            key = self.node(event, depth + 1)
            below = next(self.events)
            value = self.node(below, depth + 1)
            empty = value.value is None and not value.text
            if empty and end + 1 == event.start_mark.index and decimal_comma.parted(before, key.text):
                whose = next(reversed(node.keys), "a value")
                self.report(event, f"{whose} = {before},{key.text} has a decimal comma; write {before}.{key.text}")
                self.whole = False
                continue
            before, end = value.text, below.end_mark.index
            if value.value is None and not value.text:
                value.place = self.place(event)  # nothing is written; the scanner's mark is on a line below
            node.size += key.size + value.size
            name = key.value
            if not isinstance(name, str):
                if isinstance(key.value, dict | list):
                    self.report(event, f"{key.shown()} where a key belongs; keys are text")
                else:
                    self.report(event, f"key {key.shown()} is not text; keys are text, write it in quotes")
            elif name == "<<" and key.text == "<<":
                self.report(
                    event, "merge keys (<<) are not YAML 1.2; write the keys out, or use an alias for the whole"
                )
            elif name in node.keys:
                self.report(event, f"{name}: the key is written twice; the first is at {node.keys[name]}")
            else:
                node.mapping[name] = value
                node.keys[name] = self.place(event)
                continue
            self.whole = False
        return node

    def sequence(self, start: Any, depth: int) -> Node:
        node = Node(self.place(start), [])
        for event in self.events:
            if type(event).__name__ == "SequenceEndEvent":
                break
            item = self.node(event, depth + 1)
            node.size += item.size
            node.sequence.append(item)
        return node

    def check_collection_tag(self, event: Any, expected: str) -> None:
        if event.tag is not None and str(event.tag) not in ("!", _TAG + expected):
            self.report(event, f"tag {event.tag} is not part of the language; remove it")

    def scalar(self, event: Any) -> Node:
        text: str = event.value
        node = Node(self.place(event), text, text=text)
        if not text.isascii() and any(0xD800 <= ord(character) <= 0xDFFF for character in text):
            self.report(event, "half of a surrogate pair is not a character; write the character itself")
            node.value = ""
            return node
        tag = None if event.tag is None else str(event.tag)
        if tag is None:
            if event.implicit[0]:
                node.value = self.resolve(event, text)
        elif tag.removeprefix(_TAG) in ("int", "float", "bool", "null"):
            node.value = self.resolve(event, text)
            wanted = tag.removeprefix(_TAG)
            if wanted == "float" and type(node.value) is int:
                node.value = float(node.value)
            if wanted != {int: "int", float: "float", bool: "bool", type(None): "null"}.get(type(node.value), "str"):
                self.report(event, f"{text!r} is not a YAML {wanted}, as its tag says")
        elif tag not in ("!", _TAG + "str"):
            self.report(event, f"tag {tag} is not part of the language; remove it")
        return node

    def resolve(self, event: Any, text: str) -> Scalar:
        """Return what a plain scalar means."""
        value, wrong = meaning(text)
        if wrong:
            self.report(event, wrong)
        return value
