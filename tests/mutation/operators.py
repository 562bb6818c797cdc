"""What a mutation changes: comparisons, signs, limits, conditions, statements, rules, members, actions.

Text of messages, annotations and docstrings stays as it is.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from enum import EnumMeta
from typing import Any

COMPARISONS: dict[type[ast.cmpop], tuple[str, ...]] = {
    ast.Lt: ("<=", ">"),
    ast.LtE: ("<", ">="),
    ast.Gt: (">=", "<"),
    ast.GtE: (">", "<="),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
}
"""The boundary and the direction."""

ARITHMETIC: dict[type[ast.operator], str] = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.FloorDiv: "*",
    ast.Mod: "*",
    ast.Pow: "*",
    ast.BitAnd: "|",
    ast.BitOr: "&",
    ast.LShift: ">>",
    ast.RShift: "<<",
}

REMOVABLE = (ast.Expr, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Raise, ast.Continue, ast.Break)
"""Statements that may go from a function."""

SWAPPED_CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}

LIMIT_STEP = 0.05
"""Share by which a number that is no integer is changed, up and down."""


@dataclass(frozen=True, slots=True)
class Change:
    """`node` becomes `text`, in the function or class `function`."""

    node: Any
    text: str
    kind: str
    function: str


def changes(tree: ast.Module, source: str, namespace: dict[str, Any]) -> Iterator[Change]:
    """All changes of a module with the given source and names."""
    return _Walk(source, namespace, _named_members(tree, namespace)).body(tree.body, "", False)


def _named_members(tree: ast.Module, namespace: dict[str, Any]) -> dict[str, list[str]]:
    """For each ``NAME = int(Enum.MEMBER)`` of the module: the names of the same enumeration, in order."""
    families: dict[str, list[str]] = {}
    for node in tree.body:
        match node:
            case ast.Assign(
                targets=[ast.Name(name)], value=ast.Call(ast.Name("int"), [ast.Attribute(value=enum)])
            ) if isinstance(_resolve(enum, namespace), EnumMeta):
                families.setdefault(ast.unparse(enum), []).append(name)
    return {name: family for family in families.values() for name in family}


def _resolve(node: ast.AST, namespace: dict[str, Any]) -> Any:
    """What a name or a dotted name stands for, or None."""
    match node:
        case ast.Name(name):
            return namespace.get(name)
        case ast.Attribute(value, name):
            return getattr(_resolve(value, namespace), name, None)
    return None


def _neighbours(members: list[str], member: str) -> list[str]:
    """The members before and after one of them, around the end."""
    if member not in members or len(members) < 2:
        return []
    at = members.index(member)
    return list(dict.fromkeys((members[(at + 1) % len(members)], members[at - 1])))


def _is_boolean(node: ast.expr) -> bool:
    match node:
        case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
            return True
    return False


class _Walk:
    """Goes through a module and yields the changes of each node."""

    def __init__(self, source: str, namespace: dict[str, Any], named_members: dict[str, list[str]]) -> None:
        self._source = source
        self._namespace = namespace
        self._named_members = named_members
        self._function = ""

    def _change(self, node: ast.AST, text: str, kind: str) -> Change:
        return Change(node, text, kind, self._function)

    def _text(self, node: ast.AST) -> str:
        return ast.get_source_segment(self._source, node) or ast.unparse(node)

    # --- statements -------------------------------------------------------------------------------------

    def body(self, statements: list[ast.stmt], function: str, inside: bool) -> Iterator[Change]:
        """The changes of a block; `inside` a function, statements may go."""
        for node in statements:
            self._function = function
            yield from self._statement(node, function, inside)

    def _statement(self, node: ast.stmt, function: str, inside: bool) -> Iterator[Change]:
        match node:
            case ast.FunctionDef(name=name, args=arguments, body=body):
                for default in (*arguments.defaults, *filter(None, arguments.kw_defaults)):
                    yield from self._expression(default)
                yield from self.body(body, f"{function}.{name}".lstrip("."), True)
                return
            case ast.ClassDef(name=name, body=body):
                yield from self.body(body, f"{function}.{name}".lstrip("."), False)
                return
            case ast.Assign(targets=[ast.Name("__all__")]):
                return
            case ast.Import() | ast.ImportFrom() | ast.Pass() | ast.Expr(value=ast.Constant()):
                return
            case ast.Return(value=value) if value is not None:
                if _is_boolean(value):
                    yield self._change(value, "True", "return")
                    yield self._change(value, "False", "return")
                elif not isinstance(value, ast.Constant):
                    yield self._change(value, "None", "return")
            case ast.If(test=test) | ast.While(test=test):
                yield self._change(test, "False", "condition")
                if isinstance(node, ast.If):
                    yield self._change(test, "True", "condition")
            case ast.Match(cases=cases):
                for case in cases:
                    yield from self._case(case)
        ends_here = isinstance(node, ast.Return) and node.value is None
        if inside and (ends_here or isinstance(node, REMOVABLE)):
            yield self._change(node, "pass", "statement removed")
        yield from self._parts(node, function, inside)

    def _parts(self, node: ast.AST, function: str, inside: bool) -> Iterator[Change]:
        """Expressions and blocks below a statement."""
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "targets", "target", "pattern"):
                continue
            for part in value if isinstance(value, list) else [value]:
                if isinstance(part, ast.stmt):
                    yield from self.body([part], function, inside)
                elif isinstance(part, ast.expr):
                    yield from self._expression(part, node)
                elif isinstance(part, ast.match_case):
                    for pattern in ast.walk(part.pattern):
                        if isinstance(pattern, ast.MatchValue):
                            yield from self._expression(pattern.value)
                    yield from self._parts(part, function, inside)
                elif isinstance(part, ast.withitem | ast.ExceptHandler):
                    yield from self._parts(part, function, inside)

    def _case(self, case: ast.match_case) -> Iterator[Change]:
        first, last = case.body[0], case.body[-1]
        if not isinstance(first, ast.Pass):
            block = ast.Pass(lineno=first.lineno, col_offset=first.col_offset)
            block.end_lineno, block.end_col_offset = last.end_lineno, last.end_col_offset
            yield self._change(block, "pass", "case removed")
        if isinstance(case.pattern, ast.MatchOr):
            patterns = [self._text(pattern) for pattern in case.pattern.patterns]
            for at in range(len(patterns)):
                rest = " | ".join(patterns[:at] + patterns[at + 1 :])
                yield self._change(case.pattern, rest, "alternative removed")

    # --- expressions ------------------------------------------------------------------------------------

    def _expression(self, node: ast.expr, parent: ast.AST | None = None) -> Iterator[Change]:
        """Changes of an expression and of all below it."""
        if isinstance(node, ast.JoinedStr | ast.Lambda):
            return
        yield from self._changes_of(node, parent)
        for part in ast.iter_child_nodes(node):
            if isinstance(part, ast.comprehension):
                yield from self._comprehension(part)
            elif isinstance(part, ast.keyword) and part.arg != "strict":
                yield from self._expression(part.value, part)
            elif isinstance(part, ast.expr):
                yield from self._expression(part, node)

    def _changes_of(self, node: ast.expr, parent: ast.AST | None) -> Iterator[Change]:
        match node:
            case ast.Compare():
                yield from self._comparison(node)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
                yield from self._operator(left, right, _SYMBOLS[type(op)], (ARITHMETIC[type(op)],))
            case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert(), operand=operand):
                yield self._change(node, f"({self._text(operand)})", "sign")
            case ast.BoolOp():
                yield from self._logic(node)
            case ast.IfExp(test=test):
                yield self._change(test, "True", "condition")
                yield self._change(test, "False", "condition")
            case ast.Constant(value=value):
                yield from (self._change(node, text, "constant") for text in _other_values(value))
            case ast.Attribute() | ast.Name():
                yield from (self._change(node, other, "member") for other in self._other_members(node))
            case ast.Tuple() | ast.List() | ast.Set():
                yield from self._elements(node, parent)
            case ast.Dict(keys=keys):
                for at in range(len(keys)):
                    rest = deepcopy(node)
                    del rest.keys[at], rest.values[at]
                    yield self._change(node, ast.unparse(rest), "element removed")
            case ast.Call():
                yield from self._call(node)

    def _other_members(self, node: ast.Attribute | ast.Name) -> Iterator[str]:
        """The neighbours of a member of an enumeration, written as it is."""
        if isinstance(node, ast.Name):
            if self._function and node.id in self._named_members:
                yield from _neighbours(self._named_members[node.id], node.id)
            return
        enum = _resolve(node.value, self._namespace)
        if isinstance(enum, EnumMeta):
            for other in _neighbours(list(enum.__members__), node.attr):
                yield f"{self._text(node.value)}.{other}"

    def _comprehension(self, part: ast.comprehension) -> Iterator[Change]:
        yield from self._expression(part.iter, part)
        for test in part.ifs:
            yield self._change(test, "True", "condition")
            yield self._change(test, "False", "condition")
            yield from self._expression(test)

    def _operator(self, left: ast.expr, right: ast.expr, old: str, new: tuple[str, ...]) -> Iterator[Change]:
        """Other operators in the gap between two operands."""
        gap = ast.Pass(lineno=left.end_lineno or 0, col_offset=left.end_col_offset or 0)
        gap.end_lineno, gap.end_col_offset = right.lineno, right.col_offset
        text = ast.get_source_segment(self._source, gap) or ""
        for other in new:
            changed, count = re.subn(rf"(?<![\w<>=*/]){re.escape(old)}(?![\w<>=*/])", other, text)
            if count == 1:
                yield self._change(gap, changed, "operator")

    def _comparison(self, node: ast.Compare) -> Iterator[Change]:
        operands = [node.left, *node.comparators]
        for left, op, right in zip(operands, node.ops, operands[1:], strict=False):
            yield from self._operator(left, right, _SYMBOLS[type(op)], COMPARISONS[type(op)])

    def _logic(self, node: ast.BoolOp) -> Iterator[Change]:
        other = deepcopy(node)
        other.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield self._change(node, f"({ast.unparse(other)})", "logic")
        for at in range(len(node.values)):
            rest = deepcopy(node)
            del rest.values[at]
            left = rest.values[0] if len(rest.values) == 1 else rest
            yield self._change(node, f"({ast.unparse(left)})", "operand removed")

    def _elements(self, node: ast.Tuple | ast.List | ast.Set, parent: ast.AST | None) -> Iterator[Change]:
        """Rules, commands and members of a set: what is passed on, gone through, or asked for."""
        match parent:
            case ast.Subscript():
                return
            case ast.Assign() | ast.AnnAssign():
                listed = self._function == ""
            case ast.For() | ast.comprehension() | ast.Compare() | ast.Starred():
                listed = True
            case _:
                listed = False
        for at, element in enumerate(node.elts):
            if listed or isinstance(element, ast.Call):
                rest = deepcopy(node)
                del rest.elts[at]
                yield self._change(node, ast.unparse(rest), "element removed")

    def _call(self, node: ast.Call) -> Iterator[Change]:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name in SWAPPED_CALLS:
            yield self._change(node.func, SWAPPED_CALLS[name], "call")
        if name == "abs":
            yield self._change(node, f"({self._text(node.args[0])})", "call")
        if ast.unparse(node.func).endswith("replace"):
            for at in range(len(node.keywords)):
                rest = deepcopy(node)
                del rest.keywords[at]
                yield self._change(node, ast.unparse(rest), "field removed")
        function = self._namespace.get(name)
        if inspect.isclass(function) and not isinstance(function, EnumMeta):
            for other in _neighbours(self._without_arguments(function), name):
                yield self._change(node, f"{other}()", "action")
        elif inspect.isfunction(function):
            for other in _neighbours(self._alike(function), name):
                yield self._change(node.func, other, "action")

    def _without_arguments(self, kind: type) -> list[str]:
        """`kind`, and the classes beside it that need no argument."""
        return [
            name
            for name, other in self._namespace.items()
            if inspect.isclass(other)
            and other.__module__ == kind.__module__ not in ("builtins", "typing")
            and (other is kind or _needs_nothing(other))
        ]

    def _alike(self, function: Any) -> list[str]:
        """`function`, and those beside it that take the same."""
        return [
            name
            for name, other in self._namespace.items()
            if inspect.isfunction(other)
            and other.__module__ == function.__module__
            and inspect.signature(other) == inspect.signature(function)
        ]


_SYMBOLS: dict[type, str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
    ast.Is: "is", ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in",
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%",
    ast.Pow: "**", ast.BitAnd: "&", ast.BitOr: "|", ast.LShift: "<<", ast.RShift: ">>",
}  # fmt: skip


def _other_values(value: Any) -> list[str]:
    """Other values of a constant: the other truth, the integers beside it, a number a little off."""
    if isinstance(value, bool):
        return [str(not value)]
    if isinstance(value, int):
        return [str(value + 1), str(value - 1)]
    if isinstance(value, float):
        if value == 0.0:
            return ["1.0", "-1.0"]
        return [repr(value * (1.0 + LIMIT_STEP)), repr(value * (1.0 - LIMIT_STEP))]
    return []


def _needs_nothing(kind: type) -> bool:
    if isinstance(kind, EnumMeta):  # is called with a value, whatever the signature says in Python 3.13
        return False
    try:
        inspect.signature(kind).bind()
    except (TypeError, ValueError):
        return False
    return True
