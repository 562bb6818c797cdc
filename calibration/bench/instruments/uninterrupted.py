"""Work that an impatient Ctrl-C does not break off: what stops motors goes on to its end."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def to_its_end(work: Callable[[], T]) -> T:
    """Carry out `work`, and give what it gives or raise what it raises.

    Python interrupts the main thread only, so it is done on another one. Whoever interrupts meanwhile,
    however often, has to wait, and is heard afterwards.

    Raises:
        KeyboardInterrupt: somebody did. The work is done all the same.
    """
    thread = ThreadPoolExecutor(1)
    try:
        done = thread.submit(work)
    except RuntimeError:  # the interpreter ends, and starts no thread any more
        return work()
    thread.shutdown(wait=False)
    interrupt: KeyboardInterrupt | None = None
    while not done.done():
        try:
            done.exception()  # waits
        except KeyboardInterrupt as again:
            interrupt = again
    if interrupt is not None:
        raise interrupt
    return done.result()
