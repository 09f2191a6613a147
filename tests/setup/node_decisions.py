"""Finds the decisions of a node: branches on values that are not the health of an input.

A branch (``if``, ``while``, ``match``, a conditional expression, the condition of a comprehension) is a decision if
its condition

- compares a number with ``<``, ``<=``, ``>`` or ``>=`` ("threshold"),
- compares a value with a literal or a member of an enumeration ("value"), or matches one,
- tests the field of a message for truth ("field").

What a node may test remains: ``None``, flags and texts of kernels (``if problem:``), types, times (names that end in
``_s``: freshness, rates, timeouts), the layout of a message (``frame_id``, ``encoding``, covariances), parameters,
contract rows, publishers and subscribers, and whether a value has changed.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

_ORDER = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
_CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
_PERMITTED = re.compile(
    r"_s$|^frame_id$|^_?params$|^rows?$|^_?(wanted|allowed)$|^count_publishers$|^encoding$|covariance$"
)
_MESSAGE = frozenset({"message", "request", "latest"})


@dataclass(frozen=True, slots=True)
class Decision:
    """kind: threshold, value or field. where: the qualified name of the function."""

    where: str
    line: int
    kind: str
    condition: str


def decisions(source: str) -> list[Decision]:
    """The decisions of a module, in the order of its lines."""
    found: list[Decision] = []
    _scan(ast.parse(source), "", found)
    return sorted(found, key=lambda decision: decision.line)


def _scan(node: ast.AST, where: str, found: list[Decision]) -> None:
    for child in ast.iter_child_nodes(node):
        inner = where
        if isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            inner = f"{where}.{child.name}".lstrip(".")
        for condition in _conditions(child):
            found += [Decision(inner, part.lineno, kind, ast.unparse(part)) for part, kind in _parts(condition)]
        if isinstance(child, ast.Match) and (patterns := [p for case in child.cases for p in _values(case.pattern)]):
            found.append(Decision(inner, child.lineno, "value", f"{ast.unparse(child.subject)}: {patterns[0]}"))
        _scan(child, inner, found)


def _conditions(node: ast.AST) -> list[ast.expr]:
    if isinstance(node, ast.If | ast.While | ast.IfExp):
        return [node.test]
    if isinstance(node, ast.comprehension):
        return node.ifs
    if isinstance(node, ast.match_case) and node.guard is not None:
        return [node.guard]
    return []


def _parts(condition: ast.expr) -> Iterator[tuple[ast.expr, str]]:
    """The parts of a condition that decide."""
    match condition:
        case ast.BoolOp(values=parts):
            for part in parts:
                yield from _parts(part)
        case ast.UnaryOp(op=ast.Not(), operand=part):
            yield from _parts(part)
        case ast.Compare(left=left, ops=operators, comparators=others):
            sides = [left, *others]
            if any(_PERMITTED.search(name) for side in sides for name in _names(side)):
                return
            if any(isinstance(operator, _ORDER) for operator in operators):
                yield condition, "threshold"
            elif any(_fixed(side) for side in sides):
                yield condition, "value"
        case ast.Attribute() if _of_message(condition):
            yield condition, "field"


def _names(expression: ast.expr) -> Iterator[str]:
    for node in ast.walk(expression):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr


def _fixed(side: ast.expr) -> bool:
    """A literal other than None, a constant, a member of an enumeration, or a collection of these."""
    match side:
        case ast.Constant(value=value):
            return value is not None
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return _CONSTANT.fullmatch(name) is not None
        case ast.Tuple(elts=items) | ast.Set(elts=items) | ast.List(elts=items):
            return any(map(_fixed, items))
    return False


def _of_message(expression: ast.expr) -> bool:
    """A field of a message, however deep."""
    while isinstance(expression, ast.Attribute):
        if expression.attr == "latest":
            return True
        expression = expression.value
    return isinstance(expression, ast.Name) and expression.id in _MESSAGE


def _values(pattern: ast.pattern) -> Iterator[str]:
    """The values that a pattern compares with; a class only tests the type."""
    for node in ast.walk(pattern):
        if isinstance(node, ast.MatchValue):
            yield ast.unparse(node.value)
