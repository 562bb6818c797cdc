"""The command as it is given."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import REPOSITORY
from tests.mutation.allowed import load_allowed
from tests.mutation.given import give
from tests.mutation.trial import Trial
from tests.patience import until

TARGET = "onboard/supervisor_info.py"


def mutation(out: Path, *options: str) -> tuple[int, dict[str, Any]]:
    return give("tests.mutation", TARGET, "--out", str(out), *options)


def lines(out: Path) -> list[str]:
    return (out / "results.jsonl").read_text(encoding="utf-8").splitlines()


@pytest.mark.further  # CI tries samples of everything
def test_a_sample_is_tried_counted_and_not_tried_again(tmp_path: Path) -> None:
    before = (REPOSITORY / TARGET).read_bytes()
    code, document = mutation(tmp_path, "--sample", "6", "--seed", "3", "--jobs", "2")
    assert (REPOSITORY / TARGET).read_bytes() == before
    assert (code, document["passed"], document["survivors"]) == (0, True, [])
    assert document["tried"] == 6 == document["killed"] + document["timeout"] + document["equivalent"]
    assert document["mutants"] > 60
    assert document["score"] == 1.0
    assert len(lines(tmp_path)) == 6

    # Stopped in the middle of a line: that one is tried again, and no other.
    kept = lines(tmp_path)
    (tmp_path / "results.jsonl").write_text("\n".join(kept[:-1]) + "\n" + kept[-1][:20], encoding="utf-8")
    assert mutation(tmp_path, "--sample", "6", "--seed", "3") == (code, document)
    assert sorted(json.loads(line)["after"] for line in lines(tmp_path)) == sorted(
        json.loads(line)["after"] for line in kept
    )


@pytest.mark.further
def test_a_survivor_is_named_with_its_line(tmp_path: Path) -> None:
    """One that was kept as survived stays so while code and tests are the same."""
    mutation(tmp_path, "--sample", "1")
    row = json.loads(lines(tmp_path)[0])
    (tmp_path / "results.jsonl").write_text(
        json.dumps({**row, "outcome": "survived"}) + "\n", encoding="utf-8"
    )
    code, document = mutation(tmp_path, "--sample", "1")
    assert (code, document["passed"], document["survived"], document["score"]) == (1, False, 1, 0.0)
    [survivor] = document["survivors"]
    file, line = survivor["at"].split(":")
    assert file == TARGET
    source = (REPOSITORY / TARGET).read_text(encoding="utf-8").splitlines()
    assert source[int(line) - 1].strip() == survivor["before"] != survivor["after"]


@pytest.mark.further
@pytest.mark.parametrize(
    ("work", "by"), [("while True: pass", "the system"), ("time.sleep(1000)", "its time being over")]
)
def test_a_mutant_that_does_not_end_is_ended(work: str, by: str) -> None:
    script = f"""
import select, time
from tests.mutation.trial import end, start
def work(send):
    {work}
trial = start(work, 2, 0.1)
while not (ended := select.select([trial.result], [], [], 0.05)[0]) and not trial.waits_in_vain():
    pass
assert bool(ended) == {by == "the system"}
assert end(trial) is None
"""
    subprocess.run([sys.executable, "-c", script], cwd=REPOSITORY, check=True, timeout=60)


def test_a_mutant_that_waits_for_the_processor_has_time() -> None:
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        computes = Trial(busy.pid, 0, deadline=0.0)
        try:
            until(lambda: not computes.waits_in_vain())
            busy.send_signal(signal.SIGSTOP)
            until(computes.waits_in_vain)
        finally:
            busy.kill()


def test_an_equivalent_mutant_needs_a_reason(tmp_path: Path) -> None:
    assert load_allowed()
    path = tmp_path / "allowed.toml"
    path.write_text('[[mutant]]\nfile = "a"\nfunction = "f"\nbefore = "b"\nafter = ["c"]\nreason = " "\n')
    with pytest.raises(ValueError, match="give the reason"):
        load_allowed(path)
