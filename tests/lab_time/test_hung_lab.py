"""A lab that hangs while somebody takes part: its time goes on without it, so that every deadline comes."""

import socket
import threading

import pytest

from onboard.lab_time import lab_time
from onboard.lab_time.lab_time import LabTime
from onboard.lab_time.messages import decode, encode


def test_a_lab_that_says_nothing_any_more_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lab_time, "PULSE_S", 0.01)
    monkeypatch.setattr(lab_time, "ANSWER_S", 5.0)
    hangs = threading.Event()

    def serve(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        with connection, connection.makefile("rb") as lines:
            for line in lines:
                asked = decode(line).get("ask")
                if asked is not None and not hangs.is_set():
                    connection.sendall(encode({"answer": asked, "t": 3.0}))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = threading.Thread(target=serve, args=(listener,))
        server.start()
        with LabTime("127.0.0.1", listener.getsockname()[1], "test") as time:
            assert time() == 3.0
            monkeypatch.setattr(lab_time, "ANSWER_S", 0.05)
            hangs.set()
            assert not time.event().wait(0.2)  # of the lab, whose turns do not come
            assert time() >= 3.2
        server.join()
