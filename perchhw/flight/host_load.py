"""How busy the computer is: what is late for that reason is nobody else's fault."""

import os


class Lateness:
    """How late this program itself ran while a drone flew: the direct measure of a computer that is too busy.

    Attributes:
        watched: it flies now.
        worst: longest time that something waited for this program, s.
    """

    def __init__(self) -> None:
        self.watched = False
        self.worst = 0.0

    def note(self, late: float) -> None:
        """Something was due, or had come, `late` s ago. Of threads that call at once one may go unheard."""
        if self.watched and late > self.worst:
            self.worst = late


def host_load() -> dict[str, float | int | None]:
    """``cpus``, and ``load``: processes that ran or waited, mean over the last minute; None on Windows."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {"cpus": os.cpu_count() or 1, "load": load}
