"""Where what is compiled is kept, and where the cache does not take it."""

from pathlib import Path

import pytest

from onboard.user_cache import cache_for_compiled

UNWRITABLE = Path("/proc/sys/kernel/random")
"""A folder that takes no file, whoever asks."""


def test_what_a_read_only_cache_holds_is_used_from_a_folder_that_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_for_compiled("core") == tmp_path / "perchhw" / "core"
    (tmp_path / "perchhw" / "kernels").symlink_to(UNWRITABLE)
    folder = cache_for_compiled("kernels")
    assert (folder / "boot_id").read_bytes()
    (folder / "new").touch()
    assert cache_for_compiled("kernels") == folder
    (told,) = caplog.messages
    assert told.startswith(f"{tmp_path}/perchhw/kernels cannot be written")
