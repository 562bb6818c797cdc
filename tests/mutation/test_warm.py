"""What a fork needs to put a mutant in place: which tests call a function, and its code."""

from tests.mutation.warm import _code_of, _functions, _noting_calls

HERE = __name__


def double(x: float) -> float:
    return sum(part for part in (x, x))


class Thing:
    @property
    def size(self) -> float:
        return double(2.0)


def test_calls_of_a_module_are_noted_with_those_that_they_make() -> None:
    with _noting_calls({HERE}) as called:
        assert Thing().size == 4.0
    assert {(HERE, "Thing.size"), (HERE, "double")} <= called
    with _noting_calls({"another.module"}) as elsewhere:
        double(1.0)
    assert elsewhere == set()


def test_a_function_with_other_code_acts_so_wherever_it_was_imported() -> None:
    changed = compile(
        "def double(x):\n    return sum(part for part in (x, x, x))\n"
        "class Thing:\n    @property\n    def size(self):\n        return -1.0\n",
        "changed",
        "exec",
    )
    imported, found = double, _functions({HERE})
    kept = []
    for name in ("double", "Thing.size"):
        for function in found[HERE, name]:
            kept.append((function, function.__code__))
            function.__code__ = _code_of(changed, name)
    try:
        assert imported(2.0) == 6.0
        assert Thing().size == -1.0
    finally:
        for function, code in kept:
            function.__code__ = code
    assert Thing().size == 4.0
