"""A class name says what it is wherever it is read: none exists twice."""

import ast
from collections import defaultdict

from tests.conftest import REPOSITORY

PACKAGES = ("onboard", "mocap_bridge", "sim_backend", "calibration", "perchhw")


def test_no_public_class_name_exists_twice() -> None:
    homes = defaultdict(list)
    for package in PACKAGES:
        for file in (REPOSITORY / package).rglob("*.py"):
            for node in ast.parse(file.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    homes[node.name].append(str(file.relative_to(REPOSITORY)))
    assert len(homes) > 500
    assert {name: files for name, files in homes.items() if len(files) > 1} == {}
