"""Fixtures shared by all tests."""

import gc
import os
import signal
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from onboard.link import machine_files
from perchhw.lab_process import SimulatedLab
from tests.drawn_examples import SOAK, USUAL
from tests.tiers import drawn, longest_first

REPOSITORY = Path(__file__).resolve().parents[1]

# A shell's background jobs ignore these two keys, and so would every program that a test gives them to.
for key, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGQUIT, signal.SIG_DFL)):
    if signal.getsignal(key) is signal.SIG_IGN:
        signal.signal(key, handler)

# A kernel's first call compiles, and a busy machine is slow: time is no property of a test here. Nor is
# chance: the same examples each time, so that what was green stays green; the long proofs draw many others.
settings.register_profile(
    "perchhw",
    deadline=None,
    derandomize=True,
    max_examples=USUAL,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("soak", deadline=None, max_examples=SOAK)
settings.load_profile("perchhw")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("tiers", "the tests' tiers")
    group.addoption(
        "--sample", type=int, metavar="N", help="run N of the tests, drawn from all that are chosen"
    )
    group.addoption("--sample-seed", type=int, metavar="S", default=1, help="another sample (default: 1)")


def pytest_report_header(config: pytest.Config) -> str | None:
    count, seed = config.getoption("sample"), config.getoption("sample_seed")
    return None if count is None else f"sample: {count} tests of seed {seed}"


@pytest.hookimpl(trylast=True)  # after -m and -k
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """All processes of a run do the same, as they have to."""
    count = config.getoption("sample")
    if count is not None:
        items[:], others = drawn(items, count, config.getoption("sample_seed"))
        config.hook.pytest_deselected(items=others)
    items[:] = longest_first(items, [item.path for item in items])


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Thousands of tests stay until the end: no collection of garbage need look at them again and again. Nor
    is there much of it: looked for as often as Python does by default, it costs a tenth of a drawn page."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 50, 100)
        gc.enable()


@pytest.fixture(scope="module")
def crazyflie_uri() -> Iterator[str]:
    """Address of a simulated drone for a module: until the session's end, as the plugin's own, it would use a
    twentieth of a core."""
    with SimulatedLab("drone", ("--drone-port", "0")) as served:
        yield served.drones[0]


@pytest.fixture
def own_drone_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of what this machine's processes know of its drones, for this test alone: its drone has an
    address that the drones of other tests, which run at the same time, have too."""
    folder = tmp_path / "drone files"
    monkeypatch.setattr(machine_files, "FOLDER", folder)
    return folder


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real data (the authors' flights, public flights, bench logs), kept beside the project.

    ``PERCHHW_SHARED_DATA`` overrides the place. Tests that need it skip where it is absent.
    """
    folder = Path(os.environ.get("PERCHHW_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
    if not (folder / "README.md").is_file():
        pytest.skip(f"real data not found at {folder}; set PERCHHW_SHARED_DATA to the folder with habas2022/")
    return folder
