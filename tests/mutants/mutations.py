"""Small faults that can be planted in a module: what a slip of the hand would leave there.

A mutation replaces a piece of a source text; comments, annotations, decorators, asserts, texts and what only type
checkers read are left alone, since no test could notice.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
ARITHMETIC: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
}
OPPOSITES = {"min": "max", "max": "min", "any": "all", "all": "any", "minimum": "maximum", "maximum": "minimum"}
_NO_CODE = (ast.expr_context, ast.operator, ast.unaryop, ast.boolop, ast.cmpop)
DECORATORS = {"kernel", "leaf_kernel", "inlined_kernel", "entry"}
"""What makes a function one that is compiled (`replay.numerics.jit`)."""


@dataclass(frozen=True)
class Mutation:
    """A fault of one place.

    Attributes:
        file: the module, from the root of the tree.
        kind: which operator made it.
        function: where it stands, "" for the module itself.
        line: number of the first line, from 1.
        old: the whole lines that it touches.
        new: what stands there then.
        kernel: whether the function is compiled.
        number: which one among those of the file that read alike.
    """

    file: str
    kind: str
    function: str
    line: int
    old: str
    new: str
    kernel: bool
    number: int = 0

    @property
    def id(self) -> str:
        """A name that stays when lines above it move."""
        text = "\0".join((self.file, self.function, self.old.strip(), self.new.strip(), str(self.number)))
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def room(self) -> str:
        """The room of the house that it is in."""
        return self.file.split("/")[1].removesuffix(".py")

    def applied_to(self, source: str) -> str:
        """Return the source text with the fault; ValueError when it has changed since."""
        lines = source.splitlines(keepends=True)
        begin, size = self.line - 1, self.old.count("\n")
        if "".join(lines[begin : begin + size]) != self.old:
            raise ValueError(f"{self.file}:{self.line} is not what it was")
        lines[begin : begin + size] = [self.new]
        return "".join(lines)


def mutations_of(file: str, source: str) -> list[Mutation]:
    """Return every fault that can be planted in a module, in the order of its lines; a few may not parse."""
    found: list[Mutation] = []
    seen: dict[tuple[str, str, str], int] = {}
    for mutation in sorted(_Finder(file, source).run(), key=lambda m: (m.line, m.new)):
        key = (mutation.function, mutation.old.strip(), mutation.new.strip())
        number = seen.get(key, 0)
        seen[key] = number + 1
        found.append(replace(mutation, number=number))
    return found


def is_python(source: str) -> bool:
    """Return whether a text parses."""
    try:
        ast.parse(source)
    except SyntaxError:
        return False
    return True


def has_kernels(path: Path) -> bool:
    """Return whether a module holds kernels, so that its constants may stand in compiled code."""
    return any(_is_kernel(node) for node in ast.walk(ast.parse(path.read_text())))


def _is_kernel(node: ast.AST) -> bool:
    if not isinstance(node, ast.FunctionDef):
        return False
    names = {ast.unparse(d.func if isinstance(d, ast.Call) else d).split(".")[-1] for d in node.decorator_list}
    return bool(names & DECORATORS)


class _Finder:
    """Walks a module's tree; positions of nodes count bytes, so the text is kept as bytes."""

    def __init__(self, file: str, source: str) -> None:
        self._file = file
        self._tree = ast.parse(source)
        self._lines = [line.encode() for line in source.splitlines(keepends=True)]
        self._returns = ""
        self._found: list[Mutation] = []
        self._where: list[str] = []
        self._kernel = False

    def run(self) -> list[Mutation]:
        self._body(self._tree)
        return self._found

    def _body(self, node: ast.AST) -> None:
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, _NO_CODE):
                self._node(child, node)

    def _node(self, node: ast.AST, parent: ast.AST) -> None:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            before = self._kernel, self._returns
            self._kernel = self._kernel or _is_kernel(node)
            returns = None if isinstance(node, ast.ClassDef) else node.returns
            self._returns = ast.unparse(returns) if returns is not None else ""
            self._where.append(node.name)
            defaults = [] if isinstance(node, ast.ClassDef) else [*node.args.defaults, *node.args.kw_defaults]
            for child in [*defaults, *node.body]:
                if child is not None:
                    self._node(child, node)
            self._where.pop()
            self._kernel, self._returns = before
            return
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Assert | ast.JoinedStr):
            return
        if (
            isinstance(node, ast.UnaryOp)
            and isinstance(parent, ast.Call)
            and ast.unparse(parent.func).endswith("reshape")
            and ast.unparse(node) == "-1"
        ):
            return  # any other negative number would be the same there
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            return
        if isinstance(node, ast.AnnAssign):
            if node.value is not None:
                self._node(node.value, node)
            return
        for begin, end, new, kind in self._of(node, parent):
            self._add(begin, end, new, kind)
        self._body(node)

    def _of(self, node: ast.AST, parent: ast.AST) -> Iterator[tuple[tuple[int, int], tuple[int, int], str, str]]:
        """Yield begin, end, new text and kind of the mutations of a node alone."""
        if isinstance(node, ast.Compare):
            left: ast.expr = node.left
            for operator, right in zip(node.ops, node.comparators, strict=True):
                old, others = COMPARISONS[type(operator)]
                for new in others:
                    yield from self._between(left, right, old, new, "comparison")
                left = right
        elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
            if not isinstance(node.left, ast.Constant) or not isinstance(node.left.value, str):
                yield from self._between(node.left, node.right, *ARITHMETIC[type(node.op)], "arithmetic")
        elif isinstance(node, ast.BoolOp):
            old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield from self._between(left, right, old, new, "and/or")
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield _begin(node), _begin(node.operand), "", "sign" if isinstance(node.op, ast.USub) else "not"
        elif isinstance(node, ast.Constant):
            yield from self._constant(node)
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in OPPOSITES:
                end = _end(node.func)
                yield (end[0], end[1] - len(name)), end, OPPOSITES[name], "min/max, any/all"
        elif isinstance(node, ast.If | ast.While | ast.IfExp):
            if not isinstance(node.test, ast.Compare | ast.UnaryOp | ast.Constant):
                yield _begin(node.test), _end(node.test), f"not ({self._text(node.test)})", "condition"
        elif isinstance(node, ast.Return):
            yield from self._return(node)
        yield from self._dropped(node, parent)

    def _constant(self, node: ast.Constant) -> Iterator[tuple[tuple[int, int], tuple[int, int], str, str]]:
        value = node.value
        if isinstance(value, bool):
            yield _begin(node), _end(node), str(not value), "truth"
        elif isinstance(value, int):
            text = self._text(node)
            yield _begin(node), _end(node), f"0x{value + 1:X}" if text.startswith("0x") else str(value + 1), "constant"
        elif isinstance(value, float):
            yield _begin(node), _end(node), "1.0" if value == 0.0 else f"{2.0 * value!r}", "constant"

    def _return(self, node: ast.Return) -> Iterator[tuple[tuple[int, int], tuple[int, int], str, str]]:
        if node.value is None or isinstance(node.value, ast.Constant) or self._text(node.value) == "NotImplemented":
            return
        kind = self._returns
        if kind == "bool" and not isinstance(node.value, ast.Compare | ast.BoolOp | ast.UnaryOp):
            yield _begin(node.value), _end(node.value), f"not ({self._text(node.value)})", "result"
        elif kind in ("int", "float") and isinstance(node.value, ast.Name | ast.Attribute | ast.Call):
            yield _begin(node.value), _end(node.value), f"{self._text(node.value)} + 1", "result"

    def _dropped(self, node: ast.AST, parent: ast.AST) -> Iterator[tuple[tuple[int, int], tuple[int, int], str, str]]:
        targets = node.targets if isinstance(node, ast.Assign) else []
        wanted = (
            (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call))
            or isinstance(node, ast.AugAssign | ast.Raise | ast.Continue | ast.Break)
            or any(isinstance(target, ast.Attribute | ast.Subscript) for target in targets)
        )
        if wanted and not isinstance(parent, ast.Module | ast.ExceptHandler):
            yield _begin(node), _end(node), "pass", "statement dropped"

    def _between(
        self, left: ast.expr, right: ast.expr, old: str, new: str, kind: str
    ) -> Iterator[tuple[tuple[int, int], tuple[int, int], str, str]]:
        """Yield the change of the operator that stands between two operands."""
        gap = self._bytes(_end(left), _begin(right)).decode()
        if "#" not in gap and gap.count(old) >= 1:
            yield _end(left), _begin(right), gap.replace(old, new, 1), kind

    def _text(self, node: ast.expr) -> str:
        return self._bytes(_begin(node), _end(node)).decode()

    def _bytes(self, begin: tuple[int, int], end: tuple[int, int]) -> bytes:
        lines = self._lines[begin[0] - 1 : end[0]]
        lines[-1] = lines[-1][: end[1]]
        lines[0] = lines[0][begin[1] :]
        return b"".join(lines)

    def _add(self, begin: tuple[int, int], end: tuple[int, int], new: str, kind: str) -> None:
        whole = self._lines[begin[0] - 1 : end[0]]
        old = b"".join(whole).decode()
        text = (whole[0][: begin[1]] + new.encode() + whole[-1][end[1] :]).decode()
        self._found.append(Mutation(self._file, kind, ".".join(self._where), begin[0], old, text, self._kernel))


def _begin(node: ast.AST) -> tuple[int, int]:
    return node.lineno, node.col_offset  # type: ignore[attr-defined]


def _end(node: ast.AST) -> tuple[int, int]:
    return node.end_lineno, node.end_col_offset  # type: ignore[attr-defined]
