"""The bench as a whole, in this process: power, safety record, faults by name."""

import pytest

from sim_backend.bench.bench import Place
from sim_backend.bench.faults import BENCH_RULES, BenchFaults, Unplugging
from sim_backend.fault_values import FaultError, FaultWindow
from sim_backend.faults import fault_table, parse_faults
from sim_backend.lab_faults import DroneFaults
from tests.sim_bench.benches import HANG_Z, Stand

MID = 100 * 256


def on_supply(stand: Stand, volts: float = 4.0) -> None:
    stand.supply(f"VOLT {volts}", "CURR 8", "OUTP ON")
    stand.say(do="clamp", motor=1)
    stand.bench.run(1.0)
    assert stand.bench.on_supply


def test_battery_until_the_supply_is_on_and_then_the_supply_alone() -> None:
    stand = Stand()
    stand.say(do="clamp", motor=1)
    stand.bench.run(0.5)
    assert not stand.bench.on_supply
    assert stand.bench.board_voltage > 4.0
    boots = stand.bench.firmware.boot_count
    on_supply(stand, 3.6)
    assert stand.bench.board_voltage == pytest.approx(3.6, abs=0.02)
    assert stand.bench.firmware.boot_count == boots, "plugging the supply in costs no reboot"
    stand.command(MID, 0, 0, 0)
    stand.bench.run(0.5)
    stand.supply("OUTP OFF")
    stand.bench.run(0.01)
    assert stand.bench.silent
    assert not stand.bench.driven
    stand.bench.run(1.0)
    stand.supply("OUTP ON")
    stand.bench.run(0.5)
    assert stand.bench.firmware.boot_count == boots + 1
    assert not stand.bench.driven, "a rebooted drone has forgotten its command"
    stand.say(do="place_on_floor")
    stand.bench.run(0.1)
    assert stand.bench.place is Place.FLOOR
    assert stand.bench.board_voltage > 4.0


def test_drone_reads_its_voltage_with_the_error_of_its_divider() -> None:
    stand = Stand(gauge_error=0.015)
    on_supply(stand)
    assert stand.bench.firmware.power.supply == pytest.approx(1.015 * 4.0, abs=0.01)


def test_the_fault_on_battery_never_uses_the_supply() -> None:
    stand = Stand(on_battery=True)
    stand.supply("VOLT 3.3", "OUTP ON")
    stand.say(do="clamp", motor=1)
    stand.bench.run(0.5)
    assert not stand.bench.on_supply


def test_too_much_voltage_burns_the_drone() -> None:
    stand = Stand()
    on_supply(stand)
    stand.supply("VOLT 7.4")
    stand.bench.run(0.1)
    stand.supply("VOLT 4.0")
    stand.bench.run(1.0)
    assert stand.bench.silent
    assert any("burnt" in text for text in stand.bench.record.incidents)


def test_record_says_when_motors_turned_and_how_long_after_the_last_word() -> None:
    stand = Stand()
    stand.say(do="clamp", motor=1)
    stand.bench.run(1.0)
    firmware = stand.bench.firmware
    for tick in range(2000):
        if tick == 100:
            stand.command(MID, 0, 0, 0)
        if tick <= 500 and tick % 100 == 0:
            firmware.on_packet()
        stand.bench.step()
    assert stand.say(ask="spin_record")["value"]["spins"][0]["stopped"] is None
    stand.command(0, 0, 0, 0)
    stand.bench.run(0.1)
    (spin,) = stand.bench.record.spins
    assert spin.place == "clamped"
    assert spin.started == pytest.approx(1.1, abs=0.005)
    assert spin.stopped == pytest.approx(3.0, abs=0.005)
    assert spin.last_command == pytest.approx(3.0, abs=0.005)
    assert spin.last_packet == pytest.approx(1.5, abs=0.005)
    assert spin.longest_silence == pytest.approx(1.5, abs=0.01)


def test_a_free_drone_at_full_thrust_takes_off() -> None:
    stand = Stand()
    stand.bench.run(0.1)
    stand.command(*(4 * [255 * 256]))
    stand.bench.run(1.0)
    assert any("took off" in text for text in stand.bench.record.incidents)


def test_frozen_and_dead_drones() -> None:
    frozen = Stand(drone=DroneFaults(freeze_drone_at=1.0))
    frozen.say(do="clamp", motor=1)
    frozen.command(MID, 0, 0, 0)
    frozen.bench.run(1.1)
    frozen.command(0, 0, 0, 0)
    frozen.bench.run(0.5)
    assert frozen.bench.silent
    assert frozen.bench.driven, "motors of a frozen drone keep their command"
    dead = Stand(drone=DroneFaults(drone_dies_at=1.0))
    dead.command(MID, 0, 0, 0)
    dead.bench.run(1.1)
    assert dead.bench.silent
    assert not dead.bench.driven


def test_same_seed_same_bench() -> None:
    def run(seed: int) -> tuple[bytes, float]:
        stand = Stand(seed=seed)
        stand.say(**HANG_Z)
        stand.say(do="twist", angle=0.1)
        stand.say(do="clamp", motor=1)
        stand.bench.tachometer.receive(b"S", stand.bench.time)
        stand.command(MID, 0, 0, 0)
        stand.bench.run(1.0)
        return stand.bench.tachometer.wire.take(stand.bench.time), stand.say(ask="mass")["value"]

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_faults_by_name() -> None:
    faults = BenchFaults.parse(
        {
            "bench_reset_at": "3,7.5",
            "bench_stall": "4",
            "bench_unplug": "scale:9",
            "bench_line_ends": "mix",
            "bench_scale_rate": "10",
            "bench_inverted": "1",
            "bench_link_loss": "5:2",
            "bench_flicker": "100",
        }
    )
    assert faults.reset_at == (3.0, 7.5)
    assert faults.stall == FaultWindow(4.0, 4.3)
    assert faults.unplug == Unplugging("scale", 9.0)
    assert (faults.line_ends, faults.scale_rate, faults.inverted, faults.flicker) == ("mix", 10, True, 100.0)
    assert faults.link_loss.covers(6.9)
    assert not faults.link_loss.covers(7.0)
    assert set(BENCH_RULES) <= set(fault_table())
    assert parse_faults(["bench_flip=0.01"]).bench == {"bench_flip": "0.01"}


@pytest.mark.parametrize("name", BENCH_RULES)
def test_every_fault_refuses_nonsense_with_its_meaning(name: str) -> None:
    with pytest.raises(FaultError, match=f"{name}=nonsense"):
        BenchFaults.parse({name: "nonsense"})


@pytest.mark.parametrize("text", ["-1", "nan", "1e9:x"])
def test_times_must_be_times(text: str) -> None:
    with pytest.raises(FaultError):
        BenchFaults.parse({"bench_stall": text})


def test_unknown_fault_is_refused() -> None:
    with pytest.raises(FaultError, match="bench_nothing"):
        BenchFaults.parse({"bench_nothing": "1"})
