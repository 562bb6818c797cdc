"""cflib as it comes, over its own driver and with nothing cached: ``python -m tests.link.bare_cflib URI``
prints the seconds until it is fully connected, and waits for that for ever."""

import os
import sys
import threading
import time

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crtp.udpdriver import UdpDriver


def main() -> None:
    """Connect and print; the link is not closed, which could take as long again."""
    cflib.crtp.CLASSES[:] = [UdpDriver]
    crazyflie, connected = Crazyflie(), threading.Event()
    crazyflie.fully_connected.add_callback(lambda _uri: connected.set())
    start = time.monotonic()
    crazyflie.open_link(sys.argv[1])
    connected.wait()
    sys.stdout.write(f"{time.monotonic() - start:.2f}\n")
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
