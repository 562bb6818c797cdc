"""Port 0, console: text from the drone, to whoever listens.

channel 0, drone to client::

    text, 1..30 bytes of ASCII; a packet ends with a line or when it is full

Nothing is received on this port.
"""

from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet, Port


def console_packets(text: str) -> list[Packet]:
    """The packets of a piece of text. Beyond ASCII: ``?`` (cflib decodes packet by packet)."""
    data = text.encode("ascii", "replace")
    return [
        Packet(Port.CONSOLE, 0, line[start : start + PAYLOAD_MAX])
        for line in data.splitlines(keepends=True)
        for start in range(0, len(line), PAYLOAD_MAX)
    ]
