"""The command as it is given, stopped and given again."""

import json
from pathlib import Path
from typing import Any

import pytest

from onboard.firmware.compiler import find_compiler
from tests.mutation.given import give


def mutation(out: Path) -> tuple[int, dict[str, Any]]:
    return give("tests.firmware.mutation", "--sample", "3", "--seed", "2", "--out", str(out))


@pytest.mark.soak
@pytest.mark.timeout(600)
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_what_was_tried_is_kept(tmp_path: Path) -> None:
    code, document = mutation(tmp_path)
    assert (code, document["tried"]) == (0, 3)
    kept = (tmp_path / "results.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(kept) == 3

    survived = json.dumps({**json.loads(kept[0]), "outcome": "survived", "by": ""})
    (tmp_path / "results.jsonl").write_text("\n".join([survived, kept[1]]) + "\n", encoding="utf-8")
    code, document = mutation(tmp_path)
    assert (code, document["tried"], document["survived"]) == (1, 3, 1)
    assert len((tmp_path / "results.jsonl").read_text(encoding="utf-8").splitlines()) == 3
