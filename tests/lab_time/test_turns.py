"""A turn is over when everybody waits, and not a moment before."""

import queue
import threading
from collections.abc import Iterator

import pytest

from onboard.lab_time import LabTime, LabTimeError, open_timebase
from onboard.link.driver import ResendingUdpDriver, links_live_in
from onboard.timebase import WALL
from tests.lab_time.toy_lab import ToyLab
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link


@pytest.fixture
def lab() -> Iterator[ToyLab]:
    with ToyLab() as toy:
        yield toy


class Sleeper:
    """A thread that waits for times, one after the other, and notes when it woke."""

    def __init__(self, time: LabTime, *waits: float) -> None:
        self.woke: list[float] = []
        self._time = time
        self._waits = waits
        self.thread = time.thread(self._run, "sleeper")

    def _run(self) -> None:
        for wait in self._waits:
            self._time.event().wait(wait)
            self.woke.append(self._time())


def test_a_turn_ends_when_everybody_waits_and_names_the_first_deadline(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        sleepers = [Sleeper(time, 0.5), Sleeper(time, 0.25, 0.125)]
        lab.begin_turn(0.0)
        with pytest.raises(queue.Empty):
            lab.done.get(timeout=0.2)  # this thread is still at work
        time.foreign()
        assert lab.done.get(timeout=120.0)["next"] == pytest.approx(0.25)
        assert lab.turn(0.25)["next"] == pytest.approx(0.375)
        assert lab.turn(0.375)["next"] == pytest.approx(0.5)
        assert lab.turn(0.5)["next"] is None
        assert [sleeper.woke for sleeper in sleepers] == [[0.5], [0.25, 0.375]]


def test_who_waited_longer_for_an_earlier_time_goes_first_and_alone(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        order: list[str] = []

        def act(name: str, wait: float) -> None:
            time.event().wait(wait)
            order.append(f"{name} begins")
            threading.Event().wait(0.02)
            order.append(f"{name} ends")

        for name, wait in (("late", 0.3), ("early", 0.1), ("between", 0.2)):
            time.thread(act, name, name, wait)
        time.foreign()
        lab.turn(0.0)
        lab.turn(1.0)
        assert order == [
            f"{name} {what}" for name in ("early", "between", "late") for what in ("begins", "ends")
        ]


def test_work_that_is_handed_on_keeps_the_turn_open(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        first, second, results = time.queue(), time.queue(), []

        def pass_on() -> None:
            while (item := first.get()) is not None:
                threading.Event().wait(0.02)
                second.put_nowait(item + 1)

        def take() -> None:
            for _ in range(20):
                item = second.get()
                threading.Event().wait(0.01)
                results.append((item, time()))

        time.thread(pass_on, "pass on")
        time.thread(take, "take")
        time.foreign()
        lab.turn(0.0)
        for turn in range(20):
            first.put_nowait(turn)
            lab.turn(0.01 * (turn + 1))
            assert len(results) == turn + 1
        first.put_nowait(None)
        assert [item for item, _ in results] == list(range(1, 21))


def test_a_packet_that_was_sent_holds_the_turn_until_it_is_dealt_with(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        transport, arrived, seen = time.transport("udp:1"), threading.Event(), []

        def receive() -> None:
            with transport.blocking():
                arrived.wait(120.0)
            transport.received(1)
            seen.append(time())

        time.thread(receive, "receive")
        time.foreign()
        lab.turn(0.0)
        lab.begin_turn(0.7, {"udp:1": 1})
        with pytest.raises(queue.Empty):
            lab.done.get(timeout=0.2)
        arrived.set()
        lab.done.get(timeout=120.0)
        assert seen == [0.7]


def test_a_packet_that_comes_before_its_turn_is_received_at_the_time_of_its_turn(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        transport, here, seen = time.transport("udp:1"), threading.Event(), []

        def receive() -> None:
            with transport.blocking():
                here.set()
            seen.append(time())
            transport.received(1)

        time.thread(receive, "receive")
        time.foreign()
        lab.turn(0.0)
        assert here.wait(120.0)
        lab.turn(0.004, {"udp:1": 1})
        assert seen == [0.004]


def test_a_wait_gives_up_at_its_time_and_a_queue_says_empty(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        empty: list[float] = []

        def wait() -> None:
            try:
                time.queue().get(timeout=0.25)
            except queue.Empty:
                empty.append(time())

        time.thread(wait, "wait")
        time.foreign()
        lab.turn(0.0)
        assert lab.turn(0.2)["next"] == pytest.approx(0.25)
        lab.turn(0.26)
        assert empty == [0.26]


def test_deadlines_come_also_when_the_lab_has_died(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        sleeper = Sleeper(time, 0.3)
        time.foreign()
        lab.turn(0.0)
        lab.die()
        sleeper.thread.join(20.0)
        assert sleeper.woke
        assert sleeper.woke[0] >= 0.3


def test_arming_comes_at_a_time_that_hangs_on_no_connection(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        slots = set()
        for now in (0.0, 0.2, 0.45, 0.5):
            lab.begin_turn(now)
            time.foreign()
            lab.done.get(timeout=120.0)
            slots.add(time.slot())
        assert slots == {2.0}


def test_no_lab_is_an_error_that_says_what_to_do(lab: ToyLab) -> None:
    with pytest.raises(LabTimeError, match="still running"):
        LabTime("127.0.0.1", 1, "test").join()
    with pytest.raises(LabTimeError, match="HOST:PORT"), open_timebase("test", "udp://127.0.0.1:1?time=x"):
        pass
    with (
        pytest.raises(LabTimeError, match="different labs"),
        open_timebase("test", "udp://h:1?time=a:1", "vicon://h?subject=b&time=a:2"),
    ):
        pass


def test_without_a_lab_time_is_real() -> None:
    with open_timebase("test", "udp://127.0.0.1:19850", "vicon://127.0.0.1?subject=cf1") as time:
        assert time is WALL


def test_a_bell_is_work_from_the_moment_on_in_which_it_is_rung(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        bell, heard = time.bell(), []

        def answer() -> None:
            while bell.wait():
                heard.append(time())
                time.event().wait(0.5)

        thread = time.thread(answer, "answer")
        lab.begin_turn(0.0)
        for _ in range(3):
            bell.ring()
        time.foreign()
        assert lab.done.get(timeout=120.0)["next"] == pytest.approx(0.5)
        bell.ring()
        bell.close()
        bell.ring()
        lab.turn(0.5)
        lab.turn(1.0)
        thread.join(timeout=120.0)
        assert not thread.is_alive()
        assert heard == [0.0, 0.5]  # the first three were one, or two of which the second was heard at 0.5


@pytest.mark.parametrize("of_the_lab", [True, False])
def test_a_bell_that_is_closed_lets_what_was_rung_be_heard(lab: ToyLab, of_the_lab: bool) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        bell = (time if of_the_lab else WALL).bell()
        bell.ring()
        bell.ring()
        bell.close()
        assert bell.wait()
        assert not bell.wait()
        bell.ring()
        bell.close()


def test_a_nap_ends_by_the_machines_clock_where_time_stands_still(lab: ToyLab) -> None:
    with LabTime("127.0.0.1", lab.port, "test") as time:
        time.nap(1000.0, 0.01)
        assert time() == 0.0


def test_a_thread_that_others_disown_holds_no_turn(lab: ToyLab) -> None:
    """As cflib's, which polls in real time for its next link once this one is closed."""
    with LabTime("127.0.0.1", lab.port, "test") as time:
        packets, taken, polls = time.queue(), threading.Event(), threading.Event()

        def read() -> None:
            packets.get()
            taken.set()
            polls.wait(120.0)

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        packets.put_nowait("packet")
        assert taken.wait(120.0)
        time.foreign()
        lab.begin_turn(0.0)
        with pytest.raises(queue.Empty):
            lab.done.get(timeout=0.2)
        for _ in range(2):
            time.foreign(reader)
        lab.done.get(timeout=120.0)
        polls.set()


def test_who_read_a_link_and_closes_it_is_still_at_work(lab: ToyLab) -> None:
    """Else the turn ends before it waits again, and nobody hears until when: a reboot over a link that loses
    its answer would wait for ever."""
    uri = "udp://127.0.0.1:9"
    with LabTime("127.0.0.1", lab.port, "test") as time:
        driver = ResendingUdpDriver()
        with links_live_in(uri, time):
            driver.connect(uri, None, None)
        assert driver.receive_packet(0) is None
        driver.close()
        lab.begin_turn(0.0)
        with pytest.raises(queue.Empty):
            lab.done.get(timeout=0.2)
        time.foreign()
        assert lab.done.get(timeout=120.0)["done"] == 0.0


def test_a_link_that_only_listens_says_ten_times_a_second_of_the_labs_time_that_it_is_there(
    lab: ToyLab,
) -> None:
    """However fast the lab is: after a second of its own without a packet a drone ends its log blocks."""
    with (
        TinyDrone() as drone,
        LabTime("127.0.0.1", lab.port, "test") as time,
        patient_link(drone.uri, clock=time) as link,
    ):
        time.foreign()
        turn = first = lab.turn(0.0)
        while turn["next"] < 2.95:
            turn = lab.turn(turn["next"])  # cflib, which reads the link, looks up now and then as well
        before, after = (sum(said["packets"].values()) for said in (first, turn))
        assert after - before == 29
        lab.die()
        link.close()
