"""What a lab and those who take part in its turns say to each other: one JSON object a line, over TCP.

From the lab: ``{"t": s, "packets": {key: n}}``, it is `t`, and so many packets have been sent to each socket.
To the lab: ``{"done": t, "next": s or null, "packets": {key: n}}``, the turn of `t` is over, nothing happens
here before `next` unless packets come, and so many packets have been sent.

Asked of the lab, and answered by ``{"answer": name, ...}``: ``{"ask": "join", "name": str}`` -> `t`;
``{"ask": "open", "key": key}`` -> `packets` sent there before; ``{"ask": "connecting"}`` -> `runs`, whether
time goes on meanwhile, and `wait`, whether a drone is not done yet with what was sent before: to be asked
again later; ``{"ask": "connected", "t": s}`` -> `t`; ``{"ask": "leave"}``; ``{"ask": "status"}`` -> figures.
Told without an answer: ``{"close": key, "packets": n}``, so many were sent there in all.

A key is ``udp:PORT`` (a client of a drone), ``tcp:PORT`` (a client of the DataStream) or ``tracker:PORT``
(a listener to the object stream); ports are those of the participant's sockets, on the lab's machine.
"""

import json
from typing import Any

Message = dict[str, Any]


def encode(message: Message) -> bytes:
    """One line."""
    return json.dumps(message, separators=(",", ":")).encode() + b"\n"


def decode(line: bytes) -> Message:
    """The message in a line.

    Raises:
        ValueError: it is not a JSON object.
    """
    message = json.loads(line)
    if not isinstance(message, dict):
        raise ValueError(f"not a message of a lab's clock: {line[:80]!r}")
    return message
