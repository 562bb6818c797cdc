"""One module per CRTP port: packets to calls of the firmware's protocols, results to packets."""

from collections.abc import Callable

from sim_backend.crazyflie.crtp import Packet

#: How a port sends a packet to the client.
Send = Callable[[Packet], None]
