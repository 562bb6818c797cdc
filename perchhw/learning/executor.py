"""Where the rollouts run: the cores of this machine, or an existing Dask cluster. The result is the same.

Work is a plain function of a task that can be sent to another process: a frozen dataclass with ``__call__``
that holds settings. Every task makes its random numbers from the settings and itself, so that neither the
order of the work nor who does it can change a result.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from perchhw.learning.errors import LearningInputError

Task = TypeVar("Task")
Result = TypeVar("Result")


class Executor(Protocol):
    """Does work on many tasks."""

    def spread(self, work: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[Task, Result]]:
        """Do the tasks and give each with its result as it comes, in any order.

        When the caller stops (an error, Ctrl-C), tasks that have not begun are dropped.
        """
        ...

    def describe(self) -> dict[str, Any]:
        """Who does the work, for records."""
        ...


@dataclass(frozen=True)
class LocalThreads:
    """Threads of this process.

    The kernels release the interpreter lock, so that threads use all cores with one copy of the compiled
    code; docs/learning.md has the comparison with processes.

    Attributes:
        workers: threads, 0 for one a core.
    """

    workers: int = 0

    def spread(self, work: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[Task, Result]]:
        """See :class:`Executor`."""
        with ThreadPoolExecutor(self._threads()) as threads:
            under_way = {threads.submit(work, task): task for task in tasks}
            try:
                for done in as_completed(under_way):
                    yield under_way.pop(done), done.result()
            finally:
                threads.shutdown(wait=False, cancel_futures=True)

    def _threads(self) -> int:
        return self.workers or os.cpu_count() or 1

    def describe(self) -> dict[str, Any]:
        """See :class:`Executor`."""
        return {"backend": "threads", "workers": self._threads()}


ALL_CORES = LocalThreads()
"""All cores of this machine."""


@contextmanager
def open_executor(workers: int = 0, scheduler: str | None = None) -> Iterator[Executor]:
    """The executor for ``--workers`` or ``--scheduler``.

    Raises:
        LearningInputError: both are given, the address is none, dask is not installed, or a worker has other
            software than this process.
        LearningError: nothing answers at the address, or it has no workers.
    """
    if scheduler is None:
        yield LocalThreads(workers)
        return
    if workers:
        raise LearningInputError(
            "--workers counts threads of this machine, --scheduler works on a cluster: give one of them"
        )
    try:
        from perchhw.learning.dask_cluster import connect
    except ImportError as error:
        raise LearningInputError("--scheduler needs dask: pip install 'perchhw[cluster]'") from error
    with connect(scheduler) as cluster:
        yield cluster
