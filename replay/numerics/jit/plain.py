"""Kernels as plain Python, for a debugger: they compute what compiled ones do, line by line where they stand.

Compiled code follows IEEE 754 and goes on with infinities and NaN, and kernels rely on it where lanes have no branches.
Python raises errors there instead. So in a plain kernel each division and each function of `math` is one that goes on.
"""

from __future__ import annotations
import __future__

import ast
import inspect
import math
import textwrap
from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

_DIVIDED, _OF_MATH = "_ieee_divided", "_ieee_math"
_NUMPY = {"acos": "arccos", "asin": "arcsin", "acosh": "arccosh", "atanh": "arctanh", "pow": "power"}
"""What NumPy calls a function of `math` otherwise."""


def divided(a: Any, b: Any) -> Any:
    """Return a / b; an infinity or NaN where b is 0."""
    try:
        return a / b
    except ZeroDivisionError:
        with np.errstate(all="ignore"):
            return float(np.float64(a) / np.float64(b))


def of_math(name: str, *numbers: Any) -> Any:
    """Return what a function of `math` gives; an infinity or NaN where it would raise an error."""
    try:
        return getattr(math, name)(*numbers)
    except (ValueError, OverflowError):
        with np.errstate(all="ignore"):
            return float(getattr(np, _NUMPY.get(name, name))(*map(np.float64, numbers)))


def plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel's function as described above; the function itself where its source cannot be had.

    That is also said of a closure, whose variables a function made anew would not see.
    """
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError):
        return function
    definition = tree.body[0]
    if not isinstance(function, FunctionType) or function.__closure__ or not isinstance(definition, ast.FunctionDef):
        return function
    definition.decorator_list = []
    tree = ast.fix_missing_locations(_GoesOn().visit(tree))
    ast.increment_lineno(tree, first - 1)
    flags = __future__.annotations.compiler_flag
    code = compile(tree, function.__code__.co_filename, "exec", flags=flags, dont_inherit=True)
    function.__globals__.update({_DIVIDED: divided, _OF_MATH: of_math})
    made: dict[str, Any] = {}
    exec(code, function.__globals__, made)
    found: FunctionType = made[definition.name]
    found.__qualname__, found.__defaults__ = function.__qualname__, function.__defaults__
    found.__kwdefaults__, found.__annotations__ = function.__kwdefaults__, function.__annotations__
    return found


class _GoesOn(ast.NodeTransformer):
    """Replaces divisions and functions of `math` by those that go on."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        return _call(_DIVIDED, node.left, node.right, at=node) if isinstance(node.op, ast.Div) else node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div):
            return node
        read = ast.parse(ast.unparse(node.target), mode="eval").body
        return ast.copy_location(ast.Assign([node.target], _call(_DIVIDED, read, node.value, at=node)), node)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        of = node.func
        if isinstance(of, ast.Attribute) and isinstance(of.value, ast.Name) and of.value.id == "math":
            return _call(_OF_MATH, ast.Constant(of.attr), *node.args, at=node)
        return node


def _call(name: str, *arguments: ast.expr, at: ast.AST) -> ast.expr:
    call = ast.Call(ast.Name(name, ast.Load()), list(arguments), [])
    return ast.copy_location(call, at)
