"""The serial line of the bench in figures: a paced device for minutes, and what a bad line costs.

Prints one JSON document. ``paced``: a simulated tachometer in a process of its own sends 830 edges/s over a
pseudo-terminal at the pace of 115200 baud; lost edges and lines, and the share of one core that the reading
process takes. ``bad_line``: one bit flipped in 1 % of all bytes, for both checksums: lines said, accepted,
and accepted with another value than was said.
"""

import argparse
import json
import multiprocessing
import os
import platform
import time
import tty
from multiprocessing.connection import Connection

import numpy as np

from calibration.bench.instruments.continuity import Continuity
from calibration.bench.instruments.protocol import Banner, EdgeLine, LineParser, crc16, xor_checksum
from calibration.bench.instruments.tachometer import Tachometer

EDGES_PER_S = 830.0
GROUP = 8
BYTES_PER_S = 11_520.0


def frame(text: str, protocol: int) -> bytes:
    """A line with its checksum."""
    body = text.encode()
    tail = f"*{crc16(body):04X}" if protocol == 2 else f"*{xor_checksum(body):02X}"
    return body + tail.encode() + b"\n"


def device(pipe: Connection, seconds: float) -> None:
    """A tachometer on a pseudo-terminal that keeps the pace of its wire; tells how many edges it sent."""
    master, slave = os.openpty()
    tty.setraw(slave)
    pipe.send(os.ttyname(slave))
    while b"S" not in os.read(master, 256):
        os.write(master, frame("I,2,tach,1.0,bench,4", 2))
    seq = total = beats = 0
    start = time.monotonic()
    free = start
    while (now := time.monotonic() - start) < seconds:
        lines = b""
        while (total + GROUP) / EDGES_PER_S <= now:
            first = int(1e6 * total / EDGES_PER_S)
            steps = ",".join(["1204"] * (GROUP - 1))
            lines += frame(f"E,{seq & 0xFFFF},{first & 0xFFFFFFFF},{steps}", 2)
            seq, total = seq + 1, total + GROUP
        if now >= 0.1 * beats:
            lines += frame(f"H,{seq & 0xFFFF},{int(1e6 * now) & 0xFFFFFFFF},{total},0,1", 2)
            seq, beats = seq + 1, beats + 1
        free = max(free, time.monotonic()) + len(lines) / BYTES_PER_S
        os.write(master, lines)
        time.sleep(max(0.002, free - time.monotonic()))
    pipe.send((total, seq))
    pipe.recv()


def paced(seconds: float) -> dict[str, float]:
    """Read the paced device; losses and load."""
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    process = multiprocessing.get_context("spawn").Process(target=device, args=(theirs, seconds))
    process.start()
    edges = 0
    with Tachometer(ours.recv()) as tachometer:
        tachometer.start()
        cpu, wall = time.process_time(), time.monotonic()
        while not ours.poll():
            edges += tachometer.take(0.5).edges.size
        cpu, wall = time.process_time() - cpu, time.monotonic() - wall
        sent, lines = ours.recv()
        while edges < sent and (more := tachometer.take(0.5)).alive | (more.edges.size > 0):
            edges += more.edges.size
        report = tachometer.report
        ours.send(None)
    process.join()
    return {
        "seconds": round(wall, 1),
        "edges_sent": sent,
        "edges_missing": sent - edges,
        "lines_sent": lines,
        "lines_lost": report.link.lost + sum(report.link.faults.values()),
        "share_of_one_core": round(cpu / wall, 4),
    }


def bad_line(protocol: int, lines: int, seed: int) -> dict[str, int]:
    """One bit flipped in 1 % of all bytes of so many lines of edges."""
    rng = np.random.default_rng(seed)
    said, parts, ticks = {}, [], 0
    for seq in range(lines):
        ticks += 10_000
        steps = rng.integers(1_100, 1_300, GROUP - 1)
        said[seq] = tuple(int(tick) for tick in ticks + np.r_[0, np.cumsum(steps)])
        parts.append(frame(",".join(map(str, ["E", seq, ticks, *steps])), protocol))
    data = np.frombuffer(b"".join(parts), dtype=np.uint8).copy()
    hit = rng.random(data.size) < 0.01
    data[hit] ^= np.left_shift(1, rng.integers(0, 8, data.size)).astype(np.uint8)[hit]
    parser, continuity = LineParser(), Continuity()
    placed = []
    for line in parser.feed(frame(f"I,{protocol},tach,1.0,bench,4", protocol) + data.tobytes()):
        placed += [] if isinstance(line, Banner) else continuity.place(line, 0.0)
    accepted = [one.line for one in placed + continuity.finish() if isinstance(one.line, EdgeLine)]
    wrong = sum(said.get(line.seq) != line.ticks for line in accepted)
    return {
        "lines_said": lines,
        "bytes_spoilt": int(hit.sum()),
        "lines_accepted": len(accepted),
        "lines_accepted_with_another_value": wrong,
        "restarts_believed": continuity.restarts,
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="of the paced device")
    parser.add_argument("--lines", type=int, default=60_000, help="of the bad line, at most 65536")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    result = {
        "machine": {
            "processor": platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
        },
        "paced": paced(arguments.seconds),
        "bad_line": {
            name: bad_line(protocol, arguments.lines, arguments.seed)
            for name, protocol in (("xor", 1), ("crc16", 2))
        },
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
