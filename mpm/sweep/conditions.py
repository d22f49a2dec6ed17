"""Conditions of a sweep: short expressions in the names of its axes that keep or drop combinations.

    where = ["width <= 2 * bed_height", "dose < 1e-3 or speed > '1 cm/s'"]

Names stand for the axis's value in SI units, quoted strings are quantities ('4 mm' is 0.004) or, against an axis of
words, words. Allowed are comparisons, `and`, `or`, `not`, `in`, arithmetic, numbers, lists and parentheses;
nothing can be called or looked up, so that a sweep file from elsewhere cannot run code.
"""

import ast
import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from mpm.errors import InputError
from mpm.sweep.values import to_number

OPERATIONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda item, items: item in items,
    ast.NotIn: lambda item, items: item not in items,
}


class Condition:
    """One expression, checked when it is read; `Condition(text, names).holds({"width": 0.004})`.

    Raises InputError for anything but the operations above and for names that are no axis.
    """

    def __init__(self, text: str, names: Iterable[str]) -> None:
        self.text = text
        self.names = tuple(names)
        try:
            self.tree = ast.parse(text, mode="eval").body
        except SyntaxError as error:
            raise InputError(f"{text!r} is not an expression ({error.msg})") from None
        self._check(self.tree)

    def _check(self, node: ast.AST) -> None:
        match node:
            case ast.Name(id=name) if name not in self.names:
                raise InputError.at(
                    None,
                    "",
                    f"{self.text!r} with the unknown name {name}",
                    ", ".join(self.names),
                    known=self.names,
                    given=name,
                )
            case ast.Name() | ast.Constant(value=bool() | int() | float() | str()):
                pass
            case ast.BoolOp(values=parts) | ast.List(elts=parts) | ast.Tuple(elts=parts):
                for part in parts:
                    self._check(part)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATIONS:
                self._check(left)
                self._check(right)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATIONS:
                self._check(operand)
            case ast.Compare(left=left, ops=ops, comparators=rest) if all(
                type(op) in OPERATIONS for op in ops
            ):
                for part in (left, *rest):
                    self._check(part)
            case _:
                raise InputError.at(
                    None,
                    "",
                    f"{self.text!r} with {ast.unparse(node)!r}",
                    "comparisons, and, or, not, in, arithmetic, axis names, numbers and quoted quantities",
                )

    def holds(self, values: Mapping[str, float | str | bool]) -> bool:
        """Whether the combination `values` (axis name -> SI number or word) is kept."""
        try:
            return bool(self._value(self.tree, values))
        except (TypeError, ZeroDivisionError) as error:
            raise InputError(f"{self.text!r} cannot be evaluated ({error})") from None

    def _value(self, node: ast.AST, values: Mapping[str, float | str | bool]) -> Any:
        match node:
            case ast.Name(id=name):
                return values[name]
            case ast.Constant(value=str() as text):
                number, _ = to_number(text)
                return number
            case ast.Constant(value=value):
                return value
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                return [self._value(part, values) for part in parts]
            case ast.BoolOp(op=ast.And(), values=parts):
                return all(self._value(part, values) for part in parts)
            case ast.BoolOp(values=parts):
                return any(self._value(part, values) for part in parts)
            case ast.UnaryOp(op=op, operand=operand):
                return OPERATIONS[type(op)](self._value(operand, values))
            case ast.BinOp(left=left, op=op, right=right):
                return OPERATIONS[type(op)](self._value(left, values), self._value(right, values))
            case ast.Compare(left=left, ops=ops, comparators=rest):
                sides = [self._value(part, values) for part in (left, *rest)]
                return all(
                    OPERATIONS[type(op)](one, other)
                    for op, one, other in zip(ops, sides, sides[1:], strict=False)
                )
        raise AssertionError(f"unchecked node {node!r}")
