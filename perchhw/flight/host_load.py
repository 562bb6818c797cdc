"""How busy the computer is: what is late for that reason is nobody else's fault."""

import os


def host_load() -> dict[str, float | int | None]:
    """``cpus``, and ``load``: processes that ran or waited, mean over the last minute; None on Windows."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {"cpus": os.cpu_count() or 1, "load": load}
