"""The files in which numba keeps a kernel, told from damaged ones.

Numba unpickles whatever is there: half a file, as a power failure or a full disk leaves it, ends every later
start in an error of pickle's, and a wrong byte within the machine code is run. Each file ends in a CRC-32
here. One that does not agree with it is as good as none: the kernel is compiled anew and put in its place.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import crc32

# mypy: allow-untyped-calls
from numba.core.caching import Cache, IndexDataCacheFile

_CRC_BYTES = 4


class KernelFile(IndexDataCacheFile):
    """Index and data of one kernel; pickle does not look at what stands behind them."""

    def save(self, key: Any, data: Any) -> None:
        """Keep a kernel; a disk that does not take it costs the next start the time to compile."""
        with suppress(OSError):
            super().save(key, data)

    def _load_index(self) -> Any:
        return super()._load_index() if _is_whole(self._index_path) else {}

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        if not _is_whole(path):
            raise OSError(f"{path} is damaged")  # as one that is not there: numba compiles
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BytesIO]:
        content = BytesIO()
        yield content
        whole = content.getvalue()
        with super()._open_for_write(filepath) as file:
            file.write(whole + crc32(whole).to_bytes(_CRC_BYTES, "little"))


def keep_in_whole_files(cache: Cache) -> None:
    """Let numba's cache of one function use such files."""
    cache._cache_file = KernelFile(
        cache_path=cache.cache_path,
        filename_base=cache._impl.filename_base,
        source_stamp=cache._impl.locator.get_source_stamp(),
    )


def _is_whole(path: str) -> bool:
    try:
        content = Path(path).read_bytes()
    except OSError:
        return False
    return crc32(content[:-_CRC_BYTES]).to_bytes(_CRC_BYTES, "little") == content[-_CRC_BYTES:]
