"""A step of a walkthrough is done once, and a result that cannot be read is an error of ours."""

from pathlib import Path

import pytest

from perchhw.walkthrough.steps import StepResultError, step


def test_a_step_is_done_once(tmp_path: Path) -> None:
    done: list[Path] = []

    def work(folder: Path) -> dict[str, int]:
        done.append(folder)
        return {"value": len(done)}

    assert step(tmp_path / "a", work) == step(tmp_path / "a", work) == {"value": 1}


@pytest.mark.parametrize("text", ['{"value": ', "[1]", "[" * 100_000, "\xff"])
def test_a_damaged_result_is_named_with_what_to_do(text: str, tmp_path: Path) -> None:
    (tmp_path / "result.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(StepResultError, match=r"result\.json: cannot be read .*remove it"):
        step(tmp_path, lambda folder: {})
