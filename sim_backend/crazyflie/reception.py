"""What the firmware has received and not worked on yet, because its answers find no place in the queue
towards the radio.

A task that answers waits for a place (``crtpSendPacketBlock``). Meanwhile 16 packets for its port wait in the
port's queue; when that is full, the task that distributes packets waits as well, and then five packets of any
port wait in the queue of the radio. One more is an assertion (``radiolink.c``), and the drone restarts, also
in flight (``crtp.c``, ``radiolink.c`` of bitcraze/crazyflie-firmware 2a18fc29).
"""

from collections import deque
from collections.abc import Callable

from sim_backend.crazyflie.crtp import Packet, Port
from sim_backend.crazyflie.interfaces import FirmwareAssertion

PORT_QUEUE = 16
RECEPTION_QUEUE = 5
_ANSWERED_BY_TASKS = frozenset(
    {Port.PARAM, Port.MEMORY, Port.LOG, Port.SETPOINT_HIGH_LEVEL, Port.SUPERVISOR, Port.PLATFORM}
)


class Reception:
    """Hands packets to their ports when these can answer.

    Args:
        has_room: whether an answer finds a place now.
        work: hands a packet to its port.
    """

    def __init__(self, has_room: Callable[[], bool], work: Callable[[Packet], None]) -> None:
        self._has_room = has_room
        self._work = work
        self._queues: dict[int, deque[Packet]] = {port: deque() for port in _ANSWERED_BY_TASKS}
        self._received: deque[Packet] = deque()

    def take(self, packet: Packet) -> None:
        """A packet from the radio.

        Raises:
            FirmwareAssertion: five wait already, or what it causes.
        """
        if len(self._received) >= RECEPTION_QUEUE:
            raise FirmwareAssertion("radiolink.c: the queue of received packets is full")
        self._received.append(packet)
        self.go_on()

    def go_on(self) -> None:
        """Work on what waits, as far as there is room for answers.

        Raises:
            FirmwareAssertion: what a packet causes.
        """
        self._serve_tasks()
        while self._received and self._distribute(self._received[0]):
            self._received.popleft()
            self._serve_tasks()

    def clear(self) -> None:
        """The drone restarts."""
        for queue in (self._received, *self._queues.values()):
            queue.clear()

    def _serve_tasks(self) -> None:
        for queue in self._queues.values():
            while queue and self._has_room():
                self._work(queue.popleft())

    def _distribute(self, packet: Packet) -> bool:
        """Whether the packet is off the task that distributes."""
        queue = self._queues.get(packet.port)
        if queue is not None:
            if len(queue) < PORT_QUEUE:
                queue.append(packet)
                return True
            return False
        if packet.port == Port.LINK and not self._has_room():  # echoes are answered on the spot
            return False
        self._work(packet)
        return True
