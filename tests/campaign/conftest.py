"""A small campaign file."""

from pathlib import Path

import pytest

CAMPAIGN = """
schema = "perchhw.campaign/1"
drone = "udp://127.0.0.1:19850"
mocap = "vicon://127.0.0.1:18801?subject=cf1"
seed = 7

[grid]
speeds = [2.0, 2.5]
angles_deg = "40:60:20"
repeats = 2
"""


@pytest.fixture
def campaign_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(CAMPAIGN)
    return path
