"""Where what is compiled is kept, and where the cache does not take it."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from onboard.firmware.compiler import find_compiler
from onboard.user_cache import cache_for_compiled
from tests.conftest import REPOSITORY
from tests.patience import until

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
    assert folder.stat().st_mode & 0o777 == 0o700, "though it was copied from one that is read-only"
    (folder / "new").touch()
    assert cache_for_compiled("kernels") == folder
    (told,) = caplog.messages
    assert told.startswith(f"{tmp_path}/perchhw/kernels cannot be written")


USES_A_CACHE_FOR_NOW = """\
import sys
from onboard.user_cache import cache_for_compiled
print(cache_for_compiled("kernels"), flush=True)
sys.stdin.read()
"""
STARTS_ANOTHER = """\
import os, subprocess, sys
from onboard.user_cache import cache_for_compiled
folder = str(cache_for_compiled("kernels"))
code = "import os, sys; from onboard.kernel_cache import use_cache_of_this_source as use\\n"
code += "use(); print(os.environ['NUMBA_CACHE_DIR'], flush=True); sys.stdin.read()"
subprocess.run([sys.executable, "-c", code], env={**os.environ, "NUMBA_CACHE_DIR": folder})
"""


class Starts:
    """Processes whose cache cannot be written, each with a folder for now in `folder`."""

    def __init__(self, tmp_path: Path, stack: ExitStack) -> None:
        self.folder, self._stack = tmp_path / "tmp", stack
        self.folder.mkdir()
        (tmp_path / "perchhw").mkdir()
        (tmp_path / "perchhw" / "kernels").symlink_to(UNWRITABLE)
        gone = {"NUMBA_CACHE_DIR"}
        self._environment = {name: value for name, value in os.environ.items() if name not in gone}
        self._environment |= {"XDG_CACHE_HOME": str(tmp_path), "TMPDIR": str(self.folder)}

    def process(self, code: str) -> tuple[subprocess.Popen[str], str]:
        """One that runs until its input ends, and its first line."""
        begun = subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=self._environment,
            cwd=REPOSITORY,
        )
        self._stack.enter_context(begun)
        self._stack.callback(begun.kill)
        assert begun.stdout is not None
        return begun, begun.stdout.readline().strip()

    def left(self) -> set[Path]:
        """Folders for now that are there once another process has come and gone."""
        another, folder = self.process(USES_A_CACHE_FOR_NOW)
        assert Path(folder).is_dir()
        another.communicate()
        assert another.returncode == 0
        assert not Path(folder).exists()
        return set(self.folder.iterdir())


@pytest.fixture
def starts(tmp_path: Path) -> Iterator[Starts]:
    with ExitStack() as stack:
        yield Starts(tmp_path, stack)


def test_what_a_killed_process_left_goes_with_the_next_start_and_a_living_ones_stays(starts: Starts) -> None:
    living, its = starts.process(USES_A_CACHE_FOR_NOW)
    killed, left = starts.process(USES_A_CACHE_FOR_NOW)
    killed.kill()
    killed.wait()
    assert Path(left).is_dir()
    assert starts.left() == {Path(its)}
    living.communicate()
    assert starts.left() == set()


def test_what_a_killed_process_left_stays_while_one_that_it_started_uses_it(starts: Starts) -> None:
    killed, folder = starts.process(STARTS_ANOTHER)
    killed.kill()
    killed.wait()
    assert starts.left() == {Path(folder)}
    assert killed.stdin is not None
    killed.stdin.close()  # by which the child ends, and takes it away
    until(lambda: not Path(folder).exists())


USES_TWO_FOLDERS_AS_DO_THOSE_THAT_IT_STARTS = """\
import os, subprocess, sys
from onboard.user_cache import cache_for_compiled
os.environ["XDG_CACHE_HOME"] = sys.argv[1]
for folder in ("kernels", "core"):
    assert cache_for_compiled(folder).is_dir()
if len(sys.argv) < 5:
    subprocess.run([sys.executable, "-c", os.environ["CODE"], *sys.argv[1:], "one more"], check=True)
"""


def test_that_a_cache_cannot_be_written_is_said_once_of_it_whoever_uses_it(tmp_path: Path) -> None:
    said = []
    for cache in ("first", "second"):
        (tmp_path / cache).touch()  # a file, in which there can be no folder
        code = USES_TWO_FOLDERS_AS_DO_THOSE_THAT_IT_STARTS
        ended = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / cache)],
            env={**os.environ, "CODE": code, "TMPDIR": str(tmp_path)},
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            check=True,
        )
        said.append(ended.stderr)
    for cache, told in zip(("first", "second"), said, strict=True):
        assert told.startswith(f"{tmp_path / cache}/perchhw/kernels cannot be written (Not a directory)")
        assert len(told.splitlines()) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"first", "second"}


ON_A_FULL_DISK = """\
mount -t tmpfs -o size=64k none "$XDG_CACHE_HOME" || exit
head -c 65536 /dev/zero >"$XDG_CACHE_HOME/fill"
exec "$0" -c 'from onboard.firmware.compiler import compiled_library
print(compiled_library(["-O0"]).is_file())
from onboard.kernel_cache import use_cache_of_this_source
use_cache_of_this_source()'
"""


@pytest.mark.skipif(None in (find_compiler(), shutil.which("unshare")), reason="no C compiler, or no unshare")
def test_on_a_full_disk_compiled_code_is_kept_for_now_among_temporary_files(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    ended = subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", ON_A_FULL_DISK, sys.executable],
        env=environment | {"XDG_CACHE_HOME": str(tmp_path)},
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    if ended.stderr.startswith(("unshare: ", "mount: ")):
        pytest.skip(f"no file system can be mounted here: {ended.stderr}")
    assert ended.stdout == "True\n", ended.stderr
    (told,) = [line for line in ended.stderr.splitlines() if "cannot be written" in line]
    assert told.startswith(f"{tmp_path}/perchhw/core cannot be written (No space left on device)")
    assert "make room there, or name another folder by XDG_CACHE_HOME" in told


WHERE_NOTHING_CAN_BE_WRITTEN = """\
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from onboard.user_cache import NoCache, cache_for_compiled
print(cache_for_compiled("full"))
try:
    cache_for_compiled("kernels")
except NoCache as told:
    print(told)
"""


def test_where_temporary_files_have_no_room_either_a_full_cache_is_used_and_a_read_only_one_refused(
    starts: Starts,
) -> None:
    ended, folder = starts.process(WHERE_NOTHING_CAN_BE_WRITTEN)
    assert Path(folder).name == "full", "what is in there is of use"
    assert ended.stdout is not None
    assert "XDG_CACHE_HOME and TMPDIR" in ended.stdout.read()
