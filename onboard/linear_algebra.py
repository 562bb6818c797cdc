"""Threads of the linear algebra, of numpy's and of scipy's: the fits here have small matrices.

A second thread would spin for most of the time that a small product takes; on a busy machine every product
waits until the system has given each of them a core, and a fit takes many times as long. The command line
says so in the environment before anything is loaded; in a notebook it is too late for that.
"""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def on_one_thread() -> Iterator[None]:
    """While open, or in a function that it decorates, whoever asks for linear algebra does it alone."""
    import scipy.linalg  # noqa: F401  # has a library of its own, and only what is loaded can be limited
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
