"""What is mutated, and the tests that have to notice."""

from collections.abc import Sequence
from dataclasses import dataclass

from tests.conftest import REPOSITORY


@dataclass(frozen=True, slots=True)
class Target:
    """A source file (path below the repository, with slashes) and the files or folders of its tests."""

    file: str
    tests: tuple[str, ...]

    @property
    def module(self) -> str:
        """The dotted name under which it is imported."""
        return self.file.removesuffix(".py").replace("/", ".")


TESTS = {
    "onboard/landing/*.py": ("tests/onboard/landing",),
    "onboard/supervisor_info.py": ("tests/onboard/test_supervisor_info.py",),
    "mocap_bridge/health.py": ("tests/mocap/test_health.py", "tests/mocap/test_health_limits.py"),
    "perchhw/supervisor/*.py": ("tests/supervisor",),
}
"""Files of the safety code, and where their tests are."""

LEFT_OUT = (
    "tests/onboard/landing/test_any_input.py::test_no_input_makes_it_forget_its_rules",
    "tests/onboard/landing/test_brake.py::test_without_policy_every_approach_brakes_before_the_ceiling",
    "tests/onboard/landing/test_brake.py::test_a_missed_trigger_brakes_where_physics_allows",
    "tests/supervisor/test_any_order_of_events.py",
    "tests/supervisor/test_authors_corridor.py",
)
"""Tests, or files of tests, that take seconds interpreted. What they would notice, quick ones notice too."""


def targets(names: Sequence[str] = ()) -> list[Target]:
    """All targets, or those whose path begins with one of `names`. A package's ``__init__`` only names."""
    found = [
        Target(path.relative_to(REPOSITORY).as_posix(), tests)
        for pattern, tests in TESTS.items()
        for path in sorted(REPOSITORY.glob(pattern))
        if path.name != "__init__.py"
    ]
    return [target for target in found if not names or target.file.startswith(tuple(names))]
