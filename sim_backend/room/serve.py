"""The simulated room as a whole: feed in; Vicon DataStream (TCP) and Tracker object stream (UDP) out."""

import asyncio
import contextlib
import heapq
import itertools
import json
import socket
import time
from collections.abc import Callable

import numpy as np

from mocap_bridge.rotation import euler_xyz_from_quaternion
from mocap_bridge.tracker_udp import TrackerItem, encode_blocks
from onboard.clock import Clock
from onboard.taken_port import why_not_taken
from sim_backend.room.cameras import CameraFrame, Cameras
from sim_backend.room.datastream_server import DataStreamServer
from sim_backend.room.feed import ANSWER, FeedError, FeedReceiver, FeedUpdate, decode_feed
from sim_backend.room.settings import RoomError, RoomSettings


class _FeedProtocol(asyncio.DatagramProtocol):
    """Hands on feed datagrams with their source; foreign ones are counted and left alone."""

    def __init__(self, take: Callable[[FeedUpdate, tuple[str, int]], None]) -> None:
        self._take = take
        self.refused = 0

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        try:
            updates = decode_feed(data)
        except FeedError:
            self.refused += 1
            return
        for update in updates:
            self._take(update, addr)


class RoomServer:
    """Serves one room on the running event loop: ``await start()``, then the ports are known, ``await
    close()``.

    Without a feed the cameras run and see nothing. Bodies that the feed names but the settings do not are
    ignored.

    Attributes:
        vicon_port: TCP port of the DataStream server.
        vicon_udp_port: UDP port that the object stream is sent to.
        feed_port: UDP port for true poses.
        died: set when the fault ``dies_at`` has struck.
    """

    def __init__(
        self,
        settings: RoomSettings,
        rng: np.random.Generator,
        clock: Clock = time.monotonic,
        driven_seed: int | None = None,
    ) -> None:
        """With `driven_seed` the feed is the clock, and the noise of each frame hangs on its number alone."""
        self._settings = settings
        self._driven_seed = driven_seed
        self._world_now = 0.0
        self._number = 0
        self._tracker_packets = 0
        self._delayed: list[tuple[float, int, CameraFrame, float]] = []
        self._order = itertools.count()
        self._rng = rng
        self._clock = clock if driven_seed is None else lambda: self._world_now
        self._cameras = Cameras(settings, rng)
        self._feed = FeedReceiver(settings.feed_timeout)
        self._datastream = DataStreamServer(settings.rate_hz)
        self._tracker_socket: socket.socket | None = None
        self._feed_transport: asyncio.DatagramTransport | None = None
        self._task: asyncio.Task[None] | None = None
        self._last_send_time = 0.0
        self.died = asyncio.Event()
        self.vicon_port = settings.vicon_port
        self.vicon_udp_port = settings.vicon_udp_port
        self.feed_port = settings.feed_port

    async def start(self) -> None:
        """Open the sockets and start the cameras.

        Raises:
            RoomError: a port cannot be taken.
        """
        host = self._settings.host
        loop = asyncio.get_running_loop()
        protocol, port = "UDP", self._settings.feed_port
        try:
            self._feed_transport, _ = await loop.create_datagram_endpoint(
                lambda: _FeedProtocol(self._take_update), local_addr=(host, self._settings.feed_port)
            )
            self.feed_port = self._feed_transport.get_extra_info("sockname")[1]
            protocol, port = "TCP", self._settings.vicon_port
            self.vicon_port = await self._datastream.start(host, self._settings.vicon_port)
        except OSError as error:
            await self.close()
            raise RoomError(
                f"no simulated room: {why_not_taken(error, protocol, host, port)}; is a simulated lab "
                "running already? Use that, end it, or give another port (--vicon-port 0: a free one)"
            ) from error
        if self.vicon_udp_port == 0:
            self.vicon_udp_port = _free_udp_port(host)
        self._tracker_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._tracker_socket.setblocking(False)
        if self._driven_seed is None:
            self._task = asyncio.create_task(self._run_cameras())

    async def close(self) -> None:
        """Stop the cameras, drop all clients, close all sockets. May be called again."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None
        await self._datastream.close()
        if self._feed_transport is not None:
            self._feed_transport.close()
        if self._tracker_socket is not None:
            self._tracker_socket.close()
            self._tracker_socket = None

    def _take_update(self, update: FeedUpdate, source: tuple[str, int]) -> None:
        if self._driven_seed is None:
            self._feed.observe(update, self._clock())
            return
        self._world_now = update.world_time
        self._feed.observe(update, update.world_time)
        self._expose_what_is_due(self._driven_seed)
        if update.flags & ANSWER and self._feed_transport is not None:
            sent = self._datastream.packets_sent() | {f"tracker:{self.vicon_udp_port}": self._tracker_packets}
            answer = {"t": update.world_time, "sent": sent}
            self._feed_transport.sendto(json.dumps(answer).encode(), source)

    def _expose_what_is_due(self, seed: int) -> None:
        """In the lab's time: the frames until now, then those that the network has delayed until now."""
        settings, tolerance = self._settings, 1e-9
        while (self._number + 1) * settings.period + settings.latency <= self._world_now + tolerance:
            self._number += 1
            self._rng = self._cameras.rng = np.random.default_rng((seed, self._number))
            if not self.died.is_set() and self._step(self._number, self._number * settings.period):
                self.died.set()
                self._datastream.stop()
        while self._delayed and self._delayed[0][0] <= self._world_now + tolerance:
            _, _, frame, latency = heapq.heappop(self._delayed)
            self._send(frame, latency)

    async def _run_cameras(self) -> None:
        """Expose frame after frame; each is sent `latency` after its exposure, late frames are skipped."""
        period, latency = self._settings.period, self._settings.latency
        start = self._clock()
        number = 0
        while True:
            number += 1
            due = start + number * period + latency
            delay = due - self._clock()
            if delay < -5.0 * period:
                number += int(-delay / period)
                continue
            await asyncio.sleep(max(0.0, delay))
            if self._step(number, start + number * period):
                self.died.set()
                await self._datastream.close()
                return

    def _step(self, number: int, exposure_time: float) -> bool:
        """One frame; True when the room dies here."""
        faults = self._settings.faults
        world_time = self._feed.world_time(exposure_time)
        if faults.dies_at is not None and world_time is not None and world_time >= faults.dies_at:
            return True
        bodies = self._feed.bodies_at(exposure_time)
        frame = self._cameras.expose(number, exposure_time, bodies, world_time)
        if faults.drop > 0.0 and self._rng.random() < faults.drop:
            return False
        latency = self._clock() - exposure_time
        if faults.jitter > 0.0:
            self._send_later(frame, latency, faults.jitter * self._rng.random())
        else:
            self._send(frame, latency)
        return False

    def _send_later(self, frame: CameraFrame, latency: float, delay: float) -> None:
        if self._driven_seed is not None:
            self._last_send_time = max(self._last_send_time, self._world_now + delay)
            heapq.heappush(self._delayed, (self._last_send_time, next(self._order), frame, latency))
            return
        # A network delays frames but TCP keeps their order; the microsecond keeps the loop's order too.
        loop = asyncio.get_running_loop()
        self._last_send_time = max(self._last_send_time + 1e-6, loop.time() + delay)
        loop.call_at(self._last_send_time, self._send, frame, latency)

    def _send(self, frame: CameraFrame, latency: float) -> None:
        self._datastream.publish(frame, latency)
        if self._tracker_socket is None:
            return
        items = [
            TrackerItem(
                body.name,
                (
                    1000.0 * body.pose.position[0],
                    1000.0 * body.pose.position[1],
                    1000.0 * body.pose.position[2],
                ),
                euler_xyz_from_quaternion(body.pose.quaternion),
            )
            for body in frame.bodies
            if body.pose is not None
        ]
        for block in encode_blocks(frame.number, items, self._settings.udp_block_size):
            try:
                self._tracker_socket.sendto(block, (self._settings.host, self.vicon_udp_port))
                self._tracker_packets += 1
            except (BlockingIOError, ConnectionRefusedError):
                return  # nobody listens, or the system's buffer is full: UDP loses this frame


def _free_udp_port(host: str) -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
