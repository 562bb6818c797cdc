"""What a benchmark's document says about where it ran, and the processor time of what it started."""

import os
import platform
import resource


def machine() -> dict[str, object]:
    """Cores that this process may use, the processor and the version of Python, by their keys."""
    return {
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "machine": platform.processor() or platform.machine(),
        "python": platform.python_version(),
    }


def processor_seconds() -> float:
    """User and system time of all child processes that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
