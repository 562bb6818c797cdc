"""The supply: its remote control and what it feeds."""

import pytest

from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.power import Pack, PowerStage
from tests.sim_bench.benches import Stand, vehicle


def test_set_and_ask_in_every_spelling() -> None:
    stand = Stand()
    assert stand.supply("*IDN?")[0].count(",") == 3
    assert stand.supply("VOLT 3.9", "volt?") == ["3.9000"]
    assert stand.supply(":SOURce:VOLTage:LEVel 4.05", "SOUR:VOLT?") == ["4.0500"]
    assert stand.supply("CURR 2.5;CURR?") == ["2.5000"]
    assert stand.supply("OUTP?", "OUTP ON", "OUTPut:STATe?") == ["0", "1"]
    stand.bench.run(1.0)
    volts, amperes = (float(text) for text in stand.supply("MEAS:VOLT?", "MEASure:CURRent:DC?"))
    assert volts == pytest.approx(4.05, abs=0.01)
    assert amperes == pytest.approx(0.0, abs=0.015)
    assert stand.supply("SYST:ERR?") == ['0,"No error"']


def test_a_line_may_come_in_pieces_with_any_end() -> None:
    scpi = Stand().bench.scpi
    assert scpi.receive(b"VOL") == b""
    assert scpi.receive(b"T 1.5\r\nVOLT") == b""
    assert scpi.receive(b"?\r\n") == b"1.5000\n"


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("VOLT 25", "-222"),
        ("VOLT -1", "-222"),
        ("VOLT x", "-104"),
        ("FOO 1", "-113"),
        ("FOO?", "-113"),
        ("OUTP 3", "-224"),
        ("VOLT nan", "-222"),
    ],
)
def test_what_it_cannot_do_is_in_the_queue_once(command: str, code: str) -> None:
    stand = Stand()
    before = stand.supply("VOLT?", "OUTP?")
    assert stand.supply(command) == []
    assert stand.supply("SYST:ERR?", "SYST:ERR?")[0].startswith(code)
    assert stand.supply("SYST:ERR?") == ['0,"No error"']
    assert stand.supply("VOLT?", "OUTP?") == before


def test_error_queue_overflows_and_is_cleared() -> None:
    stand = Stand(supply_error=True)
    assert stand.supply("SYST:ERR?")[0].startswith("-330")
    for _ in range(30):
        stand.supply("NONSENSE")
    errors = [stand.supply("SYST:ERR?")[0] for _ in range(20)]
    assert errors[-1].startswith("-350")
    stand.supply("NONSENSE", "*CLS")
    assert stand.supply("SYST:ERR?") == ['0,"No error"']


def test_leads_cost_voltage() -> None:
    supply = PowerStage(BenchFaults(lead_resistance=0.1))
    supply.voltage, supply.current_limit, supply.output = 4.0, 10.0, True
    for _ in range(1000):
        volts = supply.feed(3.0, 0.001)
    assert supply.terminal == 4.0
    assert volts == pytest.approx(3.7)
    supply.output = False
    assert supply.feed(3.0, 0.001) == 0.0


def test_current_limit_holds_the_current_and_lets_go() -> None:
    stand = Stand(current_limit=1.5)
    stand.supply("VOLT 4.0", "CURR 8", "OUTP ON")
    stand.say(do="mount_on_scale")
    stand.bench.run(1.0)
    assert stand.bench.on_supply
    stand.command(*(4 * [40 * 256]))
    stand.bench.run(1.0)
    assert not stand.bench.supply.limiting
    assert stand.bench.supply.terminal == pytest.approx(4.0)
    stand.command(*(4 * [150 * 256]))
    stand.bench.run(3.0)
    assert stand.bench.supply.limiting
    assert stand.bench.supply.current == pytest.approx(1.5, rel=0.03)
    assert stand.bench.supply.terminal < 3.9
    stand.command(0, 0, 0, 0)
    stand.bench.run(2.0)
    assert not stand.bench.supply.limiting


def test_battery_sags_and_empties() -> None:
    battery = vehicle().battery
    pack = Pack(battery, None)
    assert pack.feed(0.0, 0.001) == pytest.approx(battery.open_circuit_full.value)
    drop = pack.feed(0.0, 0.001) - pack.feed(4.0, 0.001)
    assert drop == pytest.approx(4.0 * battery.resistance.value, rel=1e-3)
    for _ in range(60_000):
        volts = pack.feed(4.0, 0.001)
    assert volts < battery.open_circuit_full.value - drop - 0.1
    pack.exchange()
    assert pack.feed(0.0, 0.001) == pytest.approx(battery.open_circuit_full.value, abs=1e-3)
