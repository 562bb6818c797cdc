"""Time of a stranger's first test: from the wheel in an empty project to green.

    python benchmarks/first_test.py [--wheel perchhw-0.1.0-py3-none-any.whl]

Makes a virtual environment, installs the wheel and pytest into it, and runs the first file of docs/pytest.md
twice, at first with nothing compiled. The wheel is built of what is committed here unless one is given. Needs
pip's registry; what pip has downloaded before comes from its cache. Seconds by the clock on the wall, and of
the processors for all child processes. Prints one JSON document.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from machine import machine, processor_seconds

REPOSITORY = Path(__file__).resolve().parent.parent
LIMIT_S = 180.0
"""What is promised from the install to green, wall s."""


def timed(*command: str, folder: Path, environment: Mapping[str, str]) -> dict[str, float]:
    """Run it to its end; one that fails ends the benchmark with what it said."""
    started, used = time.perf_counter(), processor_seconds()
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"`{' '.join(command)}` failed:\n{done.stdout}{done.stderr}")
    return {"wall_s": time.perf_counter() - started, "cpu_s": processor_seconds() - used}


def measure(wheel: Path | None, folder: Path) -> dict[str, dict[str, float]]:
    """All steps, in an empty folder."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
    environment["XDG_CACHE_HOME"] = str(folder / "cache")
    project, python = folder / "project", str(folder / "env" / "bin" / "python")
    project.mkdir()
    page = (REPOSITORY / "docs" / "pytest.md").read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0]
    (project / "test_flight.py").write_text(code, encoding="utf-8")
    if wheel is None:
        source = str(folder / "perchhw.tar.gz")
        archive = ("git", "archive", "--prefix=perchhw/", "-o", source, "HEAD")
        timed(*archive, folder=REPOSITORY, environment=environment)
        build = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", source)
        timed(*build, folder=folder, environment=environment)
        (wheel,) = folder.glob("*.whl")
    timed(sys.executable, "-m", "venv", str(folder / "env"), folder=folder, environment=environment)
    install = (python, "-m", "pip", "install", "-q", str(wheel.resolve()), "pytest")
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    test = (python, "-m", "pytest", "-q")
    return {
        "install": timed(*install, folder=project, environment=kept),
        "first": timed(*test, folder=project, environment=environment),
        "second": timed(*test, folder=project, environment=environment),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--wheel", type=Path)
    wheel, load = parser.parse_args().wheel, os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        steps = measure(wheel, Path(folder))
    until_green = steps["install"]["wall_s"] + steps["first"]["wall_s"]
    document = {
        "benchmark": "first_test",
        **steps,
        "until_green_s": until_green,
        "ratio_to_promise": until_green / LIMIT_S,
        "load_average_before": load,
        **machine(),
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
