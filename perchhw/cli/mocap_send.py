"""``perchhw mocap send``: poses of a room to a vehicle that speaks MAVLink."""

from typing import Annotated, Any

import typer

from perchhw.cli import exit_codes
from perchhw.cli.output import emit


def send(
    uri: Annotated[str, typer.Argument(help="Where the poses come from, as of `mocap watch`.")],
    to: Annotated[
        str, typer.Option(metavar="mavlink://HOST:PORT", help="The vehicle; ?key=FILE signs what is sent.")
    ],
    message: Annotated[
        str,
        typer.Option("--as", help="odometry, vision (VISION_POSITION_ESTIMATE) or mocap (ATT_POS_MOCAP)."),
    ] = "odometry",
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="How long; default: until interrupted.")
    ] = None,
) -> int:
    """Send the good poses of a source to a vehicle with PX4 or ArduPilot; exit code 1 when none was sent."""
    from mocap_bridge.bridge import PoseBridge
    from mocap_bridge.errors import MocapUriError
    from mocap_bridge.mavlink.address import parse_mavlink_address
    from mocap_bridge.mavlink.pose_sink import MavlinkPoseSink, PoseMessage
    from onboard.lab_time import open_timebase

    if message not in tuple(PoseMessage):
        raise MocapUriError(f"--as {message}: no such message; write one of {', '.join(PoseMessage)}")
    address = parse_mavlink_address(to)
    with (
        open_timebase("mocap send", uri) as time,
        MavlinkPoseSink(address, PoseMessage(message), time) as sink,
        PoseBridge(uri, sink=None, clock=time, on_sample=sink.on_sample) as bridge,
    ):
        forever = float("inf") if seconds is None else seconds
        bridge.wait_for(lambda _: False, forever)
        status = bridge.status()
    result: dict[str, Any] = {
        "uri": uri,
        "to": str(address),
        "message": message,
        "sent": sink.sent,
        "lost": sink.lost,
        "heard": [f"{system}/{component}" for system, component in sorted(sink.heard)],
        "verdict": status.verdict.value,
        "error": status.error,
    }
    emit(result, "\n".join(f"{name}: {value}" for name, value in result.items()))
    return exit_codes.DONE if sink.sent else exit_codes.FAILED
