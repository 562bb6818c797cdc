"""``perchhw mocap``: what a mocap source delivers, and to whom else."""

import math
import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mocap_bridge.uri import LOOPBACK, address_forms, parse_mocap_uri
from perchhw.cli.environment import MOCAP_VARIABLE
from perchhw.cli.lab_options import LabDrone
from perchhw.cli.mocap_calibrate import calibrate
from perchhw.cli.mocap_send import send
from perchhw.cli.options import Lab, any_of
from perchhw.cli.output import emit, written
from perchhw.consoles import console, progress_console, say

if TYPE_CHECKING:
    from mocap_bridge.bridge import BridgeStatus

_TAKE_PART = (
    "is it a simulated lab with a pace of its own? It sends poses to those who take part in its turns: "
    "give the whole address, with time=HOST:PORT, as its ready line and its lab file have it"
)

_OF_LABS = ("vicon", "vicon-udp")
"""Schemes of the rooms that are simulated."""

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Motion capture: look at a source.")
app.command()(send)
app.command()(calibrate)


@app.command()
def watch(
    uri: Annotated[
        str | None,
        typer.Argument(
            envvar=MOCAP_VARIABLE,
            help=f"{any_of(address_forms())}. Default: that of the lab file.",
        ),
    ] = None,
    lab: Lab = None,
    drone: LabDrone = None,
    seconds: Annotated[float, typer.Option(min=0.1, max=3600.0, help="How long to watch.")] = 5.0,
) -> int:
    """Report rate, gaps, age, health and the last pose of a source; exit code 1 when it is not good."""
    from mocap_bridge.bridge import PoseBridge
    from mocap_bridge.health import PoseVerdict
    from onboard.lab_time import open_timebase
    from perchhw.lab.partial import poses_of

    uri = uri or poses_of(lab, drone)
    ages: list[float] = []

    def note_age(sample: Any, _: PoseVerdict) -> None:
        if sample.latency is not None or sample.source_time is not None:
            ages.append(sample.receipt_time - sample.capture_time)

    with (
        open_timebase("mocap watch", uri) as time,
        PoseBridge(uri, sink=None, clock=time, on_sample=note_age) as bridge,
    ):
        for second in range(1, math.ceil(seconds) + 1):
            bridge.wait_for(lambda _: False, min(1.0, seconds - second + 1))
            status = bridge.status()
            if second < seconds:
                written(sys.stderr, partial(_say, second, status))
    result = summary(uri, seconds, status, ages)
    emit(result, _table(result))
    return 0 if result["ok"] else 1


def _say(second: int, status: "BridgeStatus") -> None:
    """Where it stands after so many seconds, in a line."""
    pose = None if status.last_sample is None else status.last_sample.position
    where = "" if pose is None else " at ({:.3f}, {:.3f}, {:.3f}) m".format(*pose)
    line = f"{second} s: {status.verdict.name.lower()}, {status.rate_hz:.0f} Hz{where}"
    say(progress_console(), line)


def summary(uri: str, seconds: float, status: "BridgeStatus", ages: list[float]) -> dict[str, Any]:
    """The JSON document of ``mocap watch``: SI units; what never came is null.

    Args:
        uri: the source's URI.
        seconds: how long was watched (s).
        status: the bridge's status at the end.
        ages: age at receipt (s) of each sample of which the source tells anything about time.
    """
    from mocap_bridge.health import PoseVerdict

    health, source, last = status.health, status.source, status.last_sample
    ordered = sorted(ages)
    return {
        "uri": uri,
        "seconds": seconds,
        "ok": status.verdict is PoseVerdict.OK,
        "verdict": status.verdict.value,
        "error": status.error,
        "connected": status.connected,
        "reconnects": status.reconnects,
        "frames": health.samples,
        "good": health.good,
        "rate_hz": status.rate_hz,
        "missing_frames": health.missing_frames,
        "duplicates": health.duplicates,
        "restarts": health.restarts,
        "rejects": {verdict.value: count for verdict, count in health.rejects.items()},
        "age": status.age,
        "age_at_receipt": {
            "p50": ordered[len(ordered) // 2] if ordered else None,
            "p99": ordered[int(0.99 * (len(ordered) - 1))] if ordered else None,
            "max": ordered[-1] if ordered else None,
        },
        "late_warnings": health.late_warnings,
        "round_trip": source.round_trip if source else None,
        "frame_period": source.period if source else None,
        "subjects": list(source.subjects) if source else [],
        "next": _TAKE_PART if health.samples == 0 and _may_be_a_lab_that_waits(uri) else None,
        "last_pose": None
        if last is None
        else {
            "frame": last.frame,
            "occluded": last.occluded,
            "position": last.position,
            "quaternion": last.quaternion,
            "quality": last.quality,
            "latency": last.latency,
        },
    }


def _may_be_a_lab_that_waits(uri: str) -> bool:
    """Whether a simulated lab on this computer may be meant, by an address that does not name its clock."""
    from onboard.lab_time import time_address

    address = parse_mocap_uri(uri)
    here = address.host in (LOOPBACK, "localhost", "::1")
    return here and address.scheme in _OF_LABS and time_address(uri) is None


def _table(result: dict[str, Any]) -> Callable[[], None]:
    def draw() -> None:
        from rich.table import Table

        table = Table(title=f"mocap {result['uri']}", show_header=False, title_justify="left")
        table.add_row("verdict", result["verdict"] + (f" ({result['error']})" if result["error"] else ""))
        table.add_row("rate", f"{result['rate_hz']:.1f} Hz in the last second")
        table.add_row(
            "frames", f"{result['frames']}, {result['missing_frames']} missing, {result['good']} good"
        )
        rejects = ", ".join(f"{count} {name}" for name, count in result["rejects"].items())
        table.add_row("not good", rejects or "none")
        table.add_row(
            "age at receipt", ", ".join(f"{k} {_ms(v)}" for k, v in result["age_at_receipt"].items())
        )
        table.add_row("ping", _ms(result["round_trip"]))
        table.add_row("subjects", ", ".join(result["subjects"]) or "none known")
        table.add_row("last pose", _pose_text(result["last_pose"]))
        if result["next"] is not None:
            table.add_row("next", result["next"])
        console().print(table)

    return draw


def _ms(seconds: float | None) -> str:
    return "unknown" if seconds is None else f"{1000.0 * seconds:.2f} ms"


def _pose_text(pose: dict[str, Any] | None) -> str:
    if pose is None:
        return "none came"
    if pose["position"] is None:
        return f"frame {pose['frame']}: occluded"
    x, y, z = pose["position"]
    qx, qy, qz, qw = pose["quaternion"]
    return (
        f"frame {pose['frame']}: ({x:.4f}, {y:.4f}, {z:.4f}) m, "
        f"quaternion ({qx:.4f}, {qy:.4f}, {qz:.4f}, {qw:.4f})"
    )
