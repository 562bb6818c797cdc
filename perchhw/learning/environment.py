"""What learned numbers depend on, besides settings and seed."""

from functools import cache
from importlib.metadata import version
from pathlib import Path

from onboard import kernel_cache


def versions() -> dict[str, str]:
    """Versions of what the numbers depend on."""
    return {package: version(package) for package in ("perchhw", "numpy", "numba")}


@cache
def environment() -> dict[str, str]:
    """What has to be equal in two processes that are to give the same numbers: versions and source."""
    source = kernel_cache.source_key(Path(kernel_cache.__file__).resolve().parents[1])
    return {**versions(), "perchhw source": source}
