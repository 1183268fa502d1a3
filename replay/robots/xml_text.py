"""XML of anybody as a tree of elements that know their line: no document types, no entities, nothing is fetched.

Python's expat parser is used without namespaces, since descriptions of robots use prefixes that nobody declares.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from replay import limits
from replay.errors import RobotError


@dataclass(frozen=True, eq=False)
class XmlElement:
    """An element with its attributes, the elements in it, and where it begins."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[XmlElement] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[XmlElement]:
        """Yield the elements in it of a tag."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> XmlElement | None:
        """Return the first element in it of a tag, or None."""
        return next(self.all(tag), None)

    def wrong(self, reason: str) -> RobotError:
        """Return the error to raise when something about it cannot be used."""
        return RobotError(self.file, reason, line=self.line)

    def text(self, name: str) -> str:
        """Return an attribute that must be there; RobotError if it is not, or empty."""
        value = self.attributes.get(name, "").strip()
        if not value:
            raise self.wrong(f"<{self.tag}> has no {name}")
        return value


def parse(path: Path | str, data: bytes, *, root: str) -> XmlElement:
    """Return the root element of an XML file.

    Args:
        path: the file, for errors.
        data: its bytes.
        root: the tag that the root element must have.

    Raises:
        RobotError: it is no such file, is not well-formed, has a document type or is larger than what is read.
    """
    file = str(path)
    if len(data) > limits.ROBOT_XML:
        raise RobotError(file, f"has {len(data)} bytes; at most {limits.ROBOT_XML} are read")
    found = _XmlBuilder(file).build(data)
    if Path(file).suffix == ".xacro" or _is_xacro(found):
        name = Path(file).name
        stem = re.sub(r"(\.urdf|\.srdf)?(\.xacro)?$", "", name)
        target = stem + ("" if name.endswith(".xacro") else "_expanded") + (".srdf" if ".srdf" in name else ".urdf")
        raise RobotError(file, f"is a xacro program, which replay does not run; expand it: xacro {file} > {target}")
    if found.tag != root:
        raise RobotError(file, f"begins with <{found.tag[:100]}>, not with <{root}>", line=found.line)
    return found


XACRO = "xacro:"
_STATEMENTS = tuple(f"{XACRO}{name}" for name in ("macro", "include", "property", "arg", "if", "unless", "element"))


def _is_xacro(root: XmlElement) -> bool:
    """Return whether a file defines or chooses what it holds, or computes something of what is read of a robot.

    A call of a macro is none of these: expanding a file leaves those that nobody defines.
    """
    waiting = [child for child in root.children if child.tag in ("link", "joint", "material") or ":" in child.tag]
    while waiting:
        element = waiting.pop()
        values = element.attributes.values()
        if element.tag in _STATEMENTS or any("${" in value or "$(" in value for value in values):
            return True
        waiting.extend(element.children)
    return False


class _XmlBuilder:
    def __init__(self, file: str, *, most: int = limits.ROBOT_ELEMENTS, kept: bool = True) -> None:
        self.file = file
        self.most = most
        self.kept = kept
        self.root: XmlElement | None = None
        self.above: list[XmlElement] = []
        self.count = 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.doctype

    def build(self, data: bytes) -> XmlElement:
        try:
            self.parser.Parse(data.removeprefix(b"\xef\xbb\xbf").lstrip(), True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code) if error.code else "what it holds is not XML"
            raise RobotError(self.file, f"is not XML: {reason}", line=error.lineno) from None
        except (ValueError, LookupError) as error:
            raise RobotError(self.file, f"is not XML: {error}") from None
        assert self.root is not None
        return self.root

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self.count += 1
        if self.count > self.most:
            raise RobotError(self.file, f"has more than the {self.most} elements that are read", line=line)
        if len(self.above) >= limits.ROBOT_DEPTH:
            raise RobotError(self.file, f"has elements more than {limits.ROBOT_DEPTH} deep", line=line)
        element = XmlElement(tag, attributes, self.file, line)
        if not self.above:
            self.root = element
        elif self.kept:
            self.above[-1].children.append(element)
        self.above.append(element)

    def end(self, _tag: str) -> None:
        self.above.pop()

    def doctype(self, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        raise RobotError(self.file, "has a DOCTYPE, with which entities come; remove it", line=line)


def check(path: Path | str, data: bytes) -> None:
    """Refuse XML that another library is to parse if it has a document type, or more in it than is read.

    Raises:
        RobotError: as of `parse`.
    """
    file = str(path)
    if len(data) > limits.TEXT_MESH:
        raise RobotError(file, f"has {len(data)} bytes; at most {limits.TEXT_MESH} are read")
    _XmlBuilder(file, most=limits.TRIANGLES, kept=False).build(data)
