"""Which code a simulated drone runs: a name for users, without importing any of it."""

from enum import StrEnum

from onboard.firmware.compiler import find_compiler, needed_compiler


class EngineName(StrEnum):
    """Which code the drone runs."""

    C = "c"
    REFERENCE = "reference"


def usable_engine(name: EngineName | None) -> EngineName:
    """The engine to fly with: `name`, or for None the C one where a compiler is found.

    Raises:
        NoCompiler: C is asked for and there is no compiler.
    """
    if name is None:
        return EngineName.C if find_compiler() is not None else EngineName.REFERENCE
    if name is EngineName.C:
        needed_compiler()
    return name
