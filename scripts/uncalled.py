"""Public names of the packages that no code calls: a ratchet, part of ``make lint``.

    python scripts/uncalled.py

What tests, benchmarks or pages alone use is built and reached by no user. It is called, moved to the tests,
or cut; what stays for a reason stands with it in ``uncalled_allowed.txt``. That list may only shrink: a name
on it that is called by now, or gone, is an error too. What counts as a call stands in ``reach.py``.
"""

import sys
from pathlib import Path

from reach import Project

ROOT = Path(__file__).resolve().parents[1]
ALLOWED = Path(__file__).with_name("uncalled_allowed.txt")
"""A name a line (``module:name``); ``#`` begins the reason."""


def uncalled(project: Project) -> dict[str, str]:
    """Functions, classes and constants at the tops of modules that code does not reach, and who else does."""
    found = {}
    for module in (m for m in project.modules.values() if m.ours):
        for name, nodes in module.definitions.items():
            by = project.reached.get((module.name, name), "nobody")
            if name and by != "code" and not name.startswith("_"):
                place = f"{module.path.relative_to(project.root)}:{nodes[0].lineno}"
                found[f"{module.name}:{name}"] = f"{place}: {name} is used by {by} alone: call it or cut it"
    return found


def main() -> int:
    """Print how names and list differ; the exit code is 1 where they do."""
    found = uncalled(Project(ROOT, ["code"]))
    lines = ALLOWED.read_text(encoding="utf-8").splitlines()
    allowed = {line.split("#")[0].strip() for line in lines} - {""}
    if found.keys() != allowed:
        found = uncalled(Project(ROOT))  # who else uses them
    for name in sorted(found.keys() - allowed):
        print(found[name])
    for name in sorted(allowed - found.keys()):
        print(f"{ALLOWED.relative_to(ROOT)}: {name} is called by now, or gone: take it off the list")
    return int(found.keys() != allowed)


if __name__ == "__main__":
    sys.exit(main())
