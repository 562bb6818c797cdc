"""The UDP driver alone and under an unmodified cflib, against a real socket."""

import socket
import threading
from functools import partial

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.exceptions import WrongUriType
from cflib.crtp.udpdriver import UdpDriver

from onboard.link.driver import QUEUE_LIMIT, ResendingUdpDriver, install_driver, links_live_in
from onboard.timebase import WALL, Timebase, WallTime
from tests.link.tiny_drone import MEMORY_TYPE, TinyDrone
from tests.patience import PATIENCE_S, StandingClock, until

PING = CRTPPacket(0xF0, b"\0" * 9)


class Errors:
    """Collects a driver's link errors with the thread they came on."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        self.threads: list[threading.Thread] = []
        self.event = threading.Event()

    def __call__(self, message: str) -> None:
        self.messages.append(message)
        self.threads.append(threading.current_thread())
        self.event.set()


def opened(uri: str, time: Timebase = WALL) -> tuple[ResendingUdpDriver, Errors]:
    errors = Errors()
    driver = ResendingUdpDriver()
    with links_live_in(uri, time):
        driver.connect(uri, None, errors)
    return driver, errors


@pytest.fixture(autouse=True)
def _installed_for_one_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("onboard.link.driver._for_everybody", False)


def test_installs_itself_before_cflibs_driver_once() -> None:
    install_driver(for_everybody=True)
    cflib.crtp.init_drivers()  # as any user of cflib does
    install_driver()
    classes = cflib.crtp.CLASSES
    assert classes.count(ResendingUdpDriver) == 1
    assert classes.index(ResendingUdpDriver) < classes.index(UdpDriver)
    with TinyDrone() as drone:
        link = cflib.crtp.get_link_driver(drone.uri)
        assert isinstance(link, ResendingUdpDriver)
        link.close()


def test_a_stock_client_beside_our_links_keeps_cflibs_driver() -> None:
    """Lost while it connects, a link of ours would leave cflib's ``SyncCrazyflie`` waiting for ever."""
    install_driver()
    with TinyDrone() as drone:
        with links_live_in(drone.uri, WALL):
            ours = cflib.crtp.get_link_driver(drone.uri)
        stock = cflib.crtp.get_link_driver(drone.uri)
        assert (type(ours), type(stock)) == (ResendingUdpDriver, UdpDriver)
        ours.close()
        stock.close()


def test_other_schemes_are_left_to_cflib() -> None:
    with pytest.raises(WrongUriType):
        ResendingUdpDriver().connect("radio://0/80/2M", None, None)


def test_unmodified_cflib_connects_and_writes_memory_with_every_reply_doubled() -> None:
    """Over cflib's own driver the second acknowledgement deadlocks the second write."""
    install_driver(for_everybody=True)
    with TinyDrone() as drone:
        drone.copies = lambda _reply: 2
        crazyflie, connected, written = Crazyflie(), threading.Event(), threading.Semaphore(0)
        crazyflie.fully_connected.add_callback(lambda _uri: connected.set())
        crazyflie.open_link(drone.uri)
        assert connected.wait(PATIENCE_S)
        crazyflie.mem.mem_write_cb.add_callback(lambda _memory, _address: written.release())
        (memory,) = crazyflie.mem.get_mems(MEMORY_TYPE)
        for content in (bytes(range(100)), bytes(range(100, 200))):
            crazyflie.mem.write(memory, 0, content, flush_queue=True)
            assert written.acquire(timeout=PATIENCE_S)
            assert bytes(drone.memory[:100]) == content
        statistics = crazyflie.link.statistics()
        assert drone.count(0x50) <= 1 + 4 + statistics.resent, (
            "a doubled version reply must not start the download of tables twice"
        )
        assert statistics.duplicates > 20
        crazyflie.link_statistics.stop()
        crazyflie.close_link()


@pytest.mark.parametrize("header", [0xF1, 0xD1, 0x51, 0x50, 0x40, 0x20, 0x23, 0x21])
def test_every_request_of_the_connection_is_repeated_when_lost(header: int) -> None:
    install_driver(for_everybody=True)
    lost: list[bytes] = []

    def lose_first(request: bytes) -> bool:
        if request[0] & 0xF3 == header and not lost:
            lost.append(request)
            return True
        return False

    with TinyDrone() as drone:
        drone.drop = lose_first
        crazyflie, connected = Crazyflie(), threading.Event()
        crazyflie.fully_connected.add_callback(lambda _uri: connected.set())
        crazyflie.open_link(drone.uri)
        assert connected.wait(PATIENCE_S)
        assert lost
        crazyflie.link_statistics.stop()
        crazyflie.close_link()


def test_refused_packets_are_reported_once_from_another_thread_and_never_from_a_send() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    driver, errors = opened(f"udp://127.0.0.1:{port}")
    until(lambda: driver.send_packet(PING) is False and errors.event.wait(0.01))
    for _ in range(5):
        driver.send_packet(PING)
    driver.close()
    assert len(errors.messages) == 1
    assert "refused" in errors.messages[0]
    assert errors.threads[0] is not threading.current_thread()
    assert errors.threads[0].name == "UdpLinkError"


def test_silence_after_an_unanswered_question_is_an_error_after_the_limit() -> None:
    clock = StandingClock()
    with TinyDrone() as drone:
        driver, errors = opened(drone.uri + "?silence_s=0.3", WallTime(clock))
        driver.send_packet(PING)
        assert driver.receive_packet(PATIENCE_S) is not None
        clock.now = 10.0
        assert not errors.event.wait(0.1), "nothing was asked, so nothing is missing"
        drone.frozen.set()
        driver.send_packet(PING)
        clock.now = 10.29
        assert not errors.event.wait(0.1)
        clock.now = 10.31
        assert errors.event.wait(PATIENCE_S)
        driver.close()


def test_a_peer_that_never_spoke_is_not_lost() -> None:
    with TinyDrone() as drone:
        drone.frozen.set()
        clock = StandingClock()
        driver, errors = opened(drone.uri + "?silence_s=0.1", WallTime(clock))
        driver.send_packet(PING)
        clock.now = 10.0
        assert not errors.event.wait(0.1)
        driver.close()


def test_the_receive_queue_is_bounded() -> None:
    with TinyDrone() as drone:
        driver, _ = opened(drone.uri)
        driver.send_packet(PING)
        assert driver.receive_packet(PATIENCE_S) is not None
        batch, batches = 100, QUEUE_LIMIT // 100 + 5
        pushed = batch * batches

        def came(packets: int) -> bool:
            return driver.statistics().received >= packets

        for done in range(1, batches + 1):
            for _ in range(batch):
                drone.push(b"\x00console")
            until(partial(came, 1 + done * batch))
        statistics = driver.statistics()
        assert statistics.received == 1 + pushed
        assert statistics.overflow == pushed - QUEUE_LIMIT
        assert driver.receive_packet(0) is not None
        driver.close()


def test_closing_ends_the_threads_and_a_waiting_receive() -> None:
    with TinyDrone() as drone:
        before = set(threading.enumerate())
        driver, errors = opened(drone.uri)
        ended = threading.Event()

        def wait_for_packet() -> None:
            driver.receive_packet(-1)
            ended.set()

        threading.Thread(target=wait_for_packet, daemon=True).start()
        driver.close()
        left = {thread.name for thread in set(threading.enumerate()) - before}
        assert left.isdisjoint({"UdpLink", "UdpLinkResend"})
        assert ended.wait(PATIENCE_S)
        assert driver.send_packet(PING) is False
        assert driver.receive_packet(0) is None
        assert errors.messages == []


def test_oversized_datagrams_are_dropped() -> None:
    with TinyDrone() as drone:
        driver, _ = opened(drone.uri)
        driver.send_packet(PING)
        assert driver.receive_packet(PATIENCE_S) is not None
        drone.push(bytes(40))
        drone.push(b"\x00good")
        packet = driver.receive_packet(PATIENCE_S)
        assert packet is not None
        assert bytes(packet.data) == b"good"
        driver.close()
