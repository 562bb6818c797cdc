"""Rollouts on an existing Dask cluster. The only module that imports dask.

The scheduler does again what a worker that died had under way or had not handed over yet.
"""

import asyncio
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

import dask
from distributed import Client, Future, KilledWorker
from distributed.comm.core import connect as handshake

from perchhw.learning.environment import environment
from perchhw.learning.errors import LearningError, LearningInputError

Task = TypeVar("Task")
Result = TypeVar("Result")

CONNECT_TIMEOUT = 5
"""s until a scheduler that does not answer counts as absent."""

WORKER_TIMEOUT = 3
"""s that a scheduler without workers is given to find one."""

LOOK_EVERY = 2.0
"""s without a result after which the cluster is looked at."""

PATIENCE = 60.0
"""s without any worker after which the work is given up."""

BATCHES_A_THREAD = 8
"""At least, so that threads end at about the same time."""

BATCH_MOST = 8
"""Trials in a batch at most: a third of a second of work, against 1 to 2 ms that a task costs the cluster."""

_ADDRESS = re.compile(r"(tcp|tls)://[^/:]+:[0-9]+")


@contextmanager
def connect(address: str) -> "Iterator[DaskCluster]":
    """The cluster of the scheduler at `address` (``tcp://HOST:PORT``).

    Raises:
        LearningInputError: the address is none, or a worker has other software than this process.
        LearningError: nothing answers there, or it has no workers.
    """
    if not _ADDRESS.fullmatch(address):
        raise LearningInputError(f"--scheduler {address!r}: write tcp://HOST:PORT")
    patience = {"distributed.comm.timeouts.connect": CONNECT_TIMEOUT, "logging.distributed": "critical"}
    with dask.config.set(patience):
        try:
            asyncio.run(_shake_hands(address))
        except (OSError, TimeoutError, ValueError, EOFError, MemoryError) as error:
            reason = "it is another server" if isinstance(error, MemoryError) else error
            raise LearningError(
                f"no Dask scheduler answers at {address} ({reason}): start one with 'dask scheduler', and "
                "workers with 'dask worker ADDRESS', or leave out --scheduler"
            ) from error
        with Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False) as client:
            cluster = DaskCluster(client, address)
            cluster.check_workers()
            yield cluster


async def _shake_hands(address: str) -> None:
    """Connect once before a Client does: one that fails takes long to close.

    Another server's greeting, read as a length, asks for more memory than there is.
    """
    connection = await handshake(address, timeout=CONNECT_TIMEOUT)
    connection.abort()


class DaskCluster:
    """An executor (:class:`perchhw.learning.executor.Executor`) on a connected cluster."""

    def __init__(self, client: Client, address: str) -> None:
        self._client = client
        self._address = address

    def describe(self) -> dict[str, Any]:
        """Who does the work, for records."""
        threads = self._client.nthreads()
        return {"backend": "dask", "processes": len(threads), "workers": sum(threads.values())}

    def check_workers(self) -> None:
        """Refuse a cluster that has no workers, or one whose numbers would differ from ours.

        Raises:
            LearningInputError, LearningError: see :func:`connect`.
        """
        try:
            self._client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
        except TimeoutError as error:
            raise LearningError(
                f"the Dask scheduler at {self._address} has no workers: start them with "
                f"'dask worker {self._address}'"
            ) from error
        for worker, answer in self._client.run(environment, on_error="return").items():
            if isinstance(answer, BaseException):
                raise LearningInputError(
                    f"worker {worker} cannot tell its version of perchhw ({answer!r}): install "
                    f"{_text(environment())} there"
                )
            _refuse_difference(answer, environment(), worker)

    def spread(self, work: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[Task, Result]]:
        """See :class:`perchhw.learning.executor.Executor`.

        Raises:
            LearningInputError: a worker that joined later has other software.
            LearningError: the scheduler is gone, or all workers are for a minute.
        """
        batches = list(_batches(tasks, sum(self._client.nthreads().values())))
        finished: SimpleQueue[Future[Any]] = SimpleQueue()
        futures = self._client.map(do_batch, batches, work=work, here=environment(), pure=False)
        batch_of = dict(zip((future.key for future in futures), batches, strict=True))
        try:
            for future in futures:
                future.add_done_callback(finished.put)
            while batch_of:
                future, results = self._next(finished)
                yield from zip(batch_of.pop(future.key), results, strict=True)
        finally:
            if batch_of and self._client.status == "running":
                self._client.cancel(futures, force=True)

    def _next(self, finished: "SimpleQueue[Future[Any]]") -> tuple[Future[Any], list[Any]]:
        """The next batch that is done, and its results."""
        without_workers = 0.0
        while True:
            try:
                future = finished.get(timeout=LOOK_EVERY)
            except Empty:
                without_workers = 0.0 if self._has_workers() else without_workers + LOOK_EVERY
                if without_workers >= PATIENCE:
                    raise LearningError(
                        f"all workers of {self._address} are gone for {PATIENCE:g} s: start some, then go on "
                        "with --resume"
                    ) from None
                continue
            try:
                return future, future.result(timeout=LOOK_EVERY)
            except TimeoutError:  # the worker died before it handed over: the batch is done again
                future.add_done_callback(finished.put)
            except CancelledError as error:
                raise self._lost() from error
            except (KilledWorker, ImportError) as error:
                raise LearningError(
                    f"the workers of {self._address} cannot do the work: {error}; look at their logs, then "
                    "go on with --resume"
                ) from error

    def _has_workers(self) -> bool:
        if self._client.status != "running":
            raise self._lost()
        try:
            return bool(self._client.nthreads())
        except OSError as error:
            raise self._lost() from error

    def _lost(self) -> LearningError:
        return LearningError(
            f"the Dask scheduler at {self._address} is gone: start it again, then go on with --resume"
        )


def do_batch(batch: Sequence[Task], work: Callable[[Task], Result], here: dict[str, str]) -> list[Result]:
    """On a worker: the work on each task of a batch.

    Raises:
        LearningInputError: the worker's software is not that of the process that asks (`here`).
    """
    _refuse_difference(environment(), here, "of the cluster")
    return [work(task) for task in batch]


def _batches(tasks: Sequence[Task], threads: int) -> Iterator[tuple[Task, ...]]:
    size = min(max(len(tasks) // (BATCHES_A_THREAD * max(threads, 1)), 1), BATCH_MOST)
    for start in range(0, len(tasks), size):
        yield tuple(tasks[start : start + size])


def _refuse_difference(there: dict[str, str], here: dict[str, str], worker: str) -> None:
    if there != here:
        raise LearningInputError(
            f"worker {worker} has {_text(there)}, this process {_text(here)}: install the same everywhere"
        )


def _text(environment_of: dict[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in environment_of.items())
