"""The supply's second remote control, and the balance under the scale."""

import pytest

from sim_backend.bench.bench import Bench
from tests.sim_bench.benches import Stand


def test_korad_and_scpi_work_one_supply() -> None:
    stand = Stand()
    korad = stand.bench.korad
    assert korad.receive(b"*IDN?").startswith(b"KORAD")
    assert korad.receive(b"VSET1:3.90") == korad.receive(b"ISET1:10.000") == korad.receive(b"OUT1") == b""
    assert korad.receive(b"VSET1?ISET1?") == b"03.905.100"
    assert stand.supply("VOLT?", "OUTP?") == ["3.9000", "1"]
    stand.bench.run(1.0)
    assert float(korad.receive(b"VOUT1?")) == pytest.approx(3.9, abs=0.01)
    assert korad.receive(b"STATUS?") == b"\x41"
    stand.supply("OUTP OFF")
    assert korad.receive(b"STATUS?") == b"\x01"
    assert korad.receive(b"NONSENSE") == b""


def grams(bench: Bench) -> tuple[str, float]:
    """Whether the balance stands still, and what it shows."""
    head, state, value, unit = bench.balance.receive(b"SI\r\n").decode().split()
    assert (head, unit) == ("S", "g")
    return state, float(value)


def test_the_balance_shows_the_load_and_a_person_remembers_what_they_saw() -> None:
    stand = Stand()
    bench = stand.bench
    assert bench.balance.receive(b"S") == b""
    assert bench.balance.receive(b"I\r\nZ\r\n").endswith(b"ES\r\n")
    stand.say(do="put_weight", mass=0.05)
    bench.run(0.1)
    state, shown = grams(bench)
    assert (state, shown) == ("S", pytest.approx(50.0, abs=0.03))
    stand.say(do="read_scale")
    stand.say(do="remove_weight")
    bench.run(0.1)
    assert stand.say(ask="scale_reading")["value"] == pytest.approx(0.05, abs=3e-5)
    assert grams(bench)[1] == pytest.approx(0.0, abs=0.03)


def test_a_person_works_the_knobs_of_the_supply() -> None:
    stand = Stand()
    stand.say(do="set_supply", voltage=3.7, current_limit=8.0)
    stand.say(do="switch_supply", on=True)
    assert stand.say(ask="supply_voltage")["value"] == pytest.approx(3.7, abs=0.02)
    assert "true or false" in stand.say(do="switch_supply", on="yes")["error"]
    assert "voltage" in stand.say(do="set_supply", voltage=99.0, current_limit=1.0)["error"]
    stand.say(do="switch_supply", on=False)
    stand.bench.run(0.1)
    assert stand.say(ask="supply_voltage")["value"] == pytest.approx(0.0, abs=0.02)
