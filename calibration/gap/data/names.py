"""One name for each flight: two days may each have a `flight_00`."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from calibration.flights import Flight


def distinctly_named(flights: Sequence[Flight]) -> list[Flight]:
    """The flights in their order; those that share a name with their folders before it, as many as it takes.

    The same file given twice is numbered, and found to be a copy elsewhere.
    """
    names = [flight.name for flight in flights]
    folders = [flight.source.absolute().parent.parts[1:] for flight in flights]
    depth = 0
    while depth < max((len(parts) for parts in folders), default=0) and len(set(names)) < len(names):
        shared = Counter(names)
        depth += 1
        names = [
            name if shared[name] == 1 or depth > len(parts) else f"{parts[-depth]}/{name}"
            for name, parts in zip(names, folders, strict=True)
        ]
    seen: Counter[str] = Counter()
    for index, name in enumerate(names):
        seen[name] += 1
        if seen[name] > 1:
            names[index] = f"{name} ({seen[name]})"
    return [replace(flight, name=name) for flight, name in zip(flights, names, strict=True)]
