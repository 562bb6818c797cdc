"""Supplies, balances and persons: what they are asked, what they answer, and what is off in the end."""

import math
import re
import threading
from collections.abc import Callable

import pytest

from calibration.bench.instruments.balance import Balance
from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    InstrumentLost,
    InstrumentRefused,
    InstrumentTimeout,
    ScaleUnusable,
    WrongBaudRate,
    WrongDevice,
)
from calibration.bench.instruments.manual import ManualScale, ManualSupply
from calibration.bench.instruments.supply import KoradSupply, ScpiSupply
from tests.instruments.pty_device import PtyDevice


class TinyScpi:
    """A supply with a load resistor, a current limit and an error queue."""

    def __init__(self, resistance: float = 10.0) -> None:
        self.voltage = self.limit = 0.0
        self.on = True
        self.errors = ['-330,"Self-test failed"']
        self.resistance = resistance

    def __call__(self, data: bytes) -> bytes:
        return b"".join(self._line(line) for line in data.decode().splitlines())

    def _line(self, line: str) -> bytes:
        current = min(self.voltage / self.resistance, self.limit) if self.on else 0.0
        answers = {
            "*IDN?": "ACME,PS1,7,1.0",
            "MEAS:VOLT?": f"{current * self.resistance:.3f}",
            "MEAS:CURR?": f"{current:.3f}",
            "SYST:ERR?": self.errors[0] if self.errors else '+0,"No error"',
        }
        if line in answers:
            self.errors = self.errors[1:] if line == "SYST:ERR?" else self.errors
            return answers[line].encode() + b"\r\n"
        word, _, value = line.partition(" ")
        if word == "OUTP":
            self.on = value == "ON"
        elif word == "VOLT" and float(value) <= 30.0:
            self.voltage = float(value)
        elif word == "CURR":
            self.limit = float(value)
        else:
            self.errors.append('-222,"Data out of range"')
        return b""


KORAD_COMMANDS = re.compile(rb"[VI]SET1:[0-9.]+|[VI]SET1\?|[VI]OUT1\?|OUT[01]|STATUS\?|\*IDN\?")


class TinyKorad:
    """A Korad: no line ends, fixed formats, clips what is out of range."""

    def __init__(self) -> None:
        self.values = {b"VSET1": b"00.00", b"ISET1": b"0.000"}
        self.status = 0x41

    def __call__(self, data: bytes) -> bytes:
        """Of what came since the last look: on a busy machine several commands at once."""
        return b"".join(self._answer(command) for command in KORAD_COMMANDS.findall(data))

    def _answer(self, data: bytes) -> bytes:
        name, _, value = data.partition(b":")
        if name in self.values:
            self.values[name] = (b"%05.2f" if name == b"VSET1" else b"%05.3f") % min(float(value), 5.1)
        elif data in (b"OUT1", b"OUT0"):
            self.status = self.status & ~0x40 | (0x40 if data == b"OUT1" else 0)
        return {
            b"*IDN?": b"KORADKA3005PV2.0",
            b"VSET1?": self.values[b"VSET1"],
            b"ISET1?": self.values[b"ISET1"],
            b"VOUT1?": b"03.70",
            b"IOUT1?": b"1.234",
            b"STATUS?": bytes((self.status,)),
        }.get(data, b"")


def test_a_scpi_supply_is_set_read_and_off_in_the_end() -> None:
    tiny = TinyScpi()
    with PtyDevice(tiny) as device:
        with ScpiSupply(device.patient) as supply:
            assert supply.identity == "ACME,PS1,7,1.0"
            assert supply.errors_at_open == ('-330,"Self-test failed"',)
            supply.set(4.0, 1.0)
            supply.switch(on=True)
            reading = supply.measure()
            assert (reading.voltage, reading.current, reading.limited) == (4.0, 0.4, False)
            tiny.resistance = 2.0
            assert supply.measure().limited
            with pytest.raises(InstrumentRefused, match=r"'VOLT 31.0000'.*out of range"):
                supply.set(31.0, 1.0)
            for bad in (-1.0, math.nan, math.inf):
                with pytest.raises(InstrumentInputError):
                    supply.set(3.0, bad)
            assert tiny.on
        assert not tiny.on


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize(("tiny", "kind"), [(TinyScpi(), ScpiSupply), (TinyKorad(), KoradSupply)])
def test_the_output_is_off_after_an_error(
    tiny: Callable[[bytes], bytes], kind: type[ScpiSupply] | type[KoradSupply], error: type[BaseException]
) -> None:
    with PtyDevice(tiny) as device:
        with pytest.raises(error), kind(device.patient) as supply:  # noqa: PT012
            supply.switch(on=True)
            raise error
        device.await_received(b"OUTP OFF" if kind is ScpiSupply else b"OUT0")


def test_a_supply_that_cannot_be_switched_off_is_shouted_about() -> None:
    with PtyDevice(TinyScpi()) as device:
        supply = ScpiSupply(device.patient)
        device.unplug()
        with pytest.raises(InstrumentError, match="SWITCH THE SUPPLY OFF BY HAND"):
            supply.close()
        supply.close()


def test_a_korad_supply_is_set_read_back_and_says_when_it_limits() -> None:
    tiny = TinyKorad()
    with PtyDevice(tiny) as device, KoradSupply(device.patient) as supply:
        assert supply.identity == "KORADKA3005PV2.0"
        supply.set(3.7, 5.0)
        assert tiny.values == {b"VSET1": b"03.70", b"ISET1": b"5.000"}
        supply.switch(on=True)
        reading = supply.measure()
        assert (reading.voltage, reading.current, reading.limited) == (3.7, 1.234, False)
        tiny.status &= ~0x01
        assert supply.measure().limited
        with pytest.raises(InstrumentRefused, match=r"took VSET1 = 5.1 instead of 12"):
            supply.set(12.0, 1.0)
        supply.set(3.7, 10.0)
        assert tiny.values[b"ISET1"] == b"5.100", "the most that it has"


def balance(answers: dict[bytes, bytes]) -> Callable[[bytes], bytes]:
    return lambda data: answers.get(data.strip(), b"ES\r\n")


def test_a_balance_is_read_in_any_unit_that_it_may_show() -> None:
    answers = {b"SI": b"S S      12.345 g\r\n"}
    with PtyDevice(balance(answers)) as device, Balance(device.patient) as scale:
        for answer, mass, stable in (
            (b"S S      12.345 g\r\n", 0.012345, True),
            (b"S D     -0.50 g\n", -0.0005, False),
            (b"S S 1.5 kg\r\n", 1.5, True),
        ):
            answers[b"SI"] = answer
            read, steady = scale.read_mass()
            assert (read, steady) == (pytest.approx(mass), stable)
        scale.look(0.1)
        answers[b"SI"] = b"S D 3.0 g\r\n"
        scale.begin()
        with pytest.raises(ScaleUnusable, match="not read once"):
            scale.read()
        scale.look(0.1)
        reading = scale.read()
        assert reading.indication == pytest.approx(0.003)
        assert [finding.code for finding in reading.findings] == ["unstable"]


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b"S +\r\n", "overload"),
        (b"S -\r\n", "underload"),
        (b"S I\r\n", "busy"),
        (b"EL\r\n", "refuses"),
        (b"S S 12.3.4 g\r\n", "answers"),
        (b"S S 12.3 oz\r\n", "answers"),
        (b"S S nan g\r\n", "answers"),
        (b"S S 1_0 g\r\n", "answers"),
    ],
)
def test_what_is_no_mass_is_no_mass(answer: bytes, words: str) -> None:
    answers = {b"SI": b"S S 0.0 g\r\n"}
    with PtyDevice(balance(answers)) as device, Balance(device.patient) as scale:
        answers[b"SI"] = answer
        with pytest.raises(InstrumentRefused, match=words):
            scale.read_mass()


def test_wrong_devices_and_silence_are_named_in_time() -> None:
    with PtyDevice() as silent:
        for kind in (Balance, ScpiSupply, KoradSupply):
            with pytest.raises(InstrumentTimeout, match="answered nothing"):
                kind(silent.name)
            with pytest.raises(InstrumentTimeout, match=r"within 0\.1 s: .*\?answer_s=SECONDS"):
                kind(f"serial://{silent.name}?baud=9600&answer_s=0.1")
    with PtyDevice(lambda _data: b"\x80\xfe\x10\n") as noise, pytest.raises(WrongBaudRate, match="no text"):
        ScpiSupply(noise.patient)
    with PtyDevice(lambda _data: b"hello\n") as other:
        for kind in (Balance, ScpiSupply):
            with pytest.raises(WrongDevice):
                kind(other.patient)


@pytest.mark.parametrize(
    ("kind", "tiny"),
    [(ScpiSupply, TinyScpi()), (KoradSupply, TinyKorad()), (Balance, balance({b"SI": b"S S 1.0 g\r\n"}))],
)
def test_a_slow_device_is_waited_for_as_its_address_says(
    kind: Callable[[str], ScpiSupply | KoradSupply | Balance], tiny: Callable[[bytes], bytes]
) -> None:
    slow = threading.Event()

    def answer(data: bytes) -> bytes:
        if not slow.is_set():
            slow.wait(1.2)  # longer than one that says nothing of itself may take
            slow.set()
        return tiny(data)

    with PtyDevice(answer) as device, kind(device.patient) as instrument:
        assert slow.is_set()
        assert instrument.device == device.name


def test_half_an_answer_is_none_and_the_next_one_is_whole() -> None:
    answers = {b"SI": b"S S 1.0 g\r\n"}
    with PtyDevice(balance(answers)) as device, Balance(f"{device.name}?answer_s=3") as scale:
        answers[b"SI"] = b"S S 99"
        with pytest.raises(InstrumentTimeout, match="only b'S S 99'"):
            scale.read_mass()
        answers[b"SI"] = b"S S 2.0 g\r\n"
        assert scale.read_mass() == (pytest.approx(0.002), True)
        device.unplug()
        with pytest.raises(InstrumentLost):
            scale.look(0.1)


class Somebody:
    """Does what they are told and says what they see."""

    def __init__(self, weights: list[float], volts: float = 3.71) -> None:
        self.weights, self.volts = weights, volts
        self.done: list[str] = []

    def look_at_scale(self, seconds: float) -> None:
        self.done.append(f"look {seconds:g} s")

    def weight(self) -> float:
        return self.weights.pop(0)

    def voltage(self) -> float:
        return self.volts

    def set_supply(self, voltage: float, current_limit: float) -> None:
        self.done.append(f"{voltage:.2f} V, {current_limit:.1f} A")

    def switch_supply(self, on: bool) -> None:
        self.done.append("on" if on else "off")


def test_a_person_reads_a_scale_and_a_supply() -> None:
    somebody = Somebody([0.060, math.nan])
    scale = ManualScale(somebody)
    scale.begin()
    scale.look(0.1)
    assert scale.read().indication == 0.060
    with pytest.raises(InstrumentInputError, match="read it again"):
        scale.read()
    assert somebody.done.pop() == "look 4 s"
    with ManualSupply(somebody) as supply:
        supply.set(3.7, 6.0)
        supply.switch(on=True)
        supply.switch(on=True)
        reading = supply.measure()
        assert reading.voltage == 3.71
        assert math.isnan(reading.current)
        somebody.volts = 3.9
        supply.set(3.9, 6.0)
        assert supply.measure().voltage == 3.9
    supply.close()
    assert somebody.done == ["3.70 V, 6.0 A", "on", "3.90 V, 6.0 A", "off"]
