"""The drone: link, firmware, landing app, settings, battery, clock. Each a function of what it answered."""

from collections.abc import Callable

from onboard.app_interface import INTERFACE_VERSION, MEMORY_SIZE, Parameter
from onboard.firmware.constants import vehicle_crc32
from perchhw.doctor.check_result import CheckResult, CheckVerdict, judged, not_known
from perchhw.doctor.readings import DroneReadings, Readings

ROUND_TRIP = 0.05
"""s, median: at 100 poses a second a slower link queues them."""

CLOCK_RATE_OFF = 0.01
"""The drone's clock beside ours: a quartz is within 0.01 %, what is logged in 2 s is told within 1 %."""

REVISION = "firmware.revision0"
KNOWN_REVISIONS = {0x2A18FC29: "2026.08"}
"""Revisions of crazyflie-firmware that perchhw was held against."""

WITHOUT_APP = "motion capture, hover and test flights work without it; policies and landings do not"

SETTINGS: dict[str, tuple[int, str, str]] = {
    "stabilizer.controller": (
        6,
        "the landing app is the out-of-tree controller",
        "build it with CONTROLLER_OOT",
    ),
    "stabilizer.estimator": (2, "the complementary filter takes no poses", "build it with ESTIMATOR_KALMAN"),
    "powerDist.idleThrust": (
        0,
        "else propellers turn as soon as the drone is armed, and hanging from the ceiling",
        "build it with MOTORS_DEFAULT_IDLE_THRUST=0",
    ),
    "motorPowerSet.enable": (
        0,
        "else the bench's override has the motors, and no stop reaches them",
        "end what runs on the bench, and reboot the drone",
    ),
}
"""Parameter: value that a landing needs, why, and how the firmware comes to have it."""


def link(readings: DroneReadings, _: Readings) -> CheckResult:
    """Median and longest of the round trips."""
    ordered = sorted(readings.round_trips)
    median = ordered[len(ordered) // 2]
    return judged(
        "link",
        median <= ROUND_TRIP,
        f"round trip {1e3 * median:.1f} ms, at most {1e3 * ordered[-1]:.0f} ms, of {len(ordered)}",
        f"{1e3 * ROUND_TRIP:.0f} ms",
        "poses and orders go by it",
        "bring the radio nearer, take another channel (scan for Wi-Fi), use 2M",
    )


def firmware(readings: DroneReadings, _: Readings) -> CheckResult:
    """A revision that we do not know is named; the tables decide what works."""
    why = "names and meanings of parameters change between releases"
    wanted = ", ".join(f"{name} ({number:08x})" for number, name in KNOWN_REVISIONS.items())
    revision = readings.parameters.get(REVISION)
    if revision is None:
        measured = f"no {REVISION}"
    elif int(revision) in KNOWN_REVISIONS:
        name = KNOWN_REVISIONS[int(revision)]
        return CheckResult("firmware", CheckVerdict.FINE, f"{name} ({int(revision):08x})", wanted, why)
    else:
        measured = f"revision {int(revision):08x}, unknown to perchhw"
    remedy = "what the lines below find works as it says; for the rest flash a known release"
    return CheckResult("firmware", CheckVerdict.NOTE, measured, wanted, why, remedy)


def landing_app(readings: DroneReadings, _: Readings) -> CheckResult:
    """All names of the interface, and its version."""
    wanted, why = f"version {INTERFACE_VERSION}", f"it takes the policy and lands; {WITHOUT_APP}"
    version = readings.parameters.get(Parameter.VERSION)
    if version is None:
        return judged("landing_app", False, "none", wanted, why, "flash the firmware with the landing app")
    if version != INTERFACE_VERSION:
        return judged(
            "landing_app", False, f"version {version:g}", wanted, why, "flash the firmware of this perchhw"
        )
    if readings.missing:
        lacks = f"version {version:g}, without {', '.join(readings.missing)}"
        return judged("landing_app", False, lacks, wanted, why, "flash the firmware of this perchhw")
    return judged("landing_app", True, f"version {version:g}", wanted, why, "")


def vehicle(readings: DroneReadings, all_readings: Readings) -> CheckResult | None:
    """The firmware was built for the vehicle that the host believes in."""
    flashed = readings.parameters.get(Parameter.VEHICLE_CRC)
    if flashed is None:
        return None  # landing_app says it
    name, crc = all_readings.vehicle.name, vehicle_crc32(all_readings.vehicle)
    return judged(
        "vehicle",
        int(flashed) == crc,
        f"constants {int(flashed):08x}",
        f"{crc:08x}, of {name}",
        "mass, motors, gains and limits are compiled into the firmware",
        f"flash the firmware that was built for {name}, or name the vehicle that is flashed (--vehicle)",
    )


def app_memory(readings: DroneReadings, _: Readings) -> CheckResult:
    """The memory that policies are uploaded to."""
    problem = readings.app_memory_problem
    return judged(
        "app_memory",
        problem is None,
        f"{MEMORY_SIZE} bytes" if problem is None else problem,
        f"{MEMORY_SIZE} bytes",
        "policies are uploaded to it; " + WITHOUT_APP,
        "flash the firmware of this perchhw",
    )


def setting(name: str) -> Callable[[DroneReadings, Readings], CheckResult]:
    """The check of one parameter of :data:`SETTINGS`."""
    needed, why, remedy = SETTINGS[name]

    def check(readings: DroneReadings, _: Readings) -> CheckResult:
        value = readings.parameters.get(name)
        if value is None:
            missing = f"the firmware has no {name}"
            return not_known(name, missing, str(needed), why, "flash a known release of the firmware")
        return judged(name, value == needed, f"{value:g}", str(needed), why, remedy)

    return check


def arming(readings: DroneReadings, _: Readings) -> CheckResult:
    """A build that arms by itself cannot be told when."""
    return judged(
        "arming",
        not readings.supervisor.auto_arm,
        "arms by itself" if readings.supervisor.auto_arm else "by order",
        "by order",
        "the supervisor arms when all checks have passed, and disarms",
        "build it with MOTORS_REQUIRE_ARMING",
    )


def rehearsal(readings: DroneReadings, _: Readings) -> CheckResult | None:
    """A host that dies leaves the mode on, and the supervisor says nothing of it."""
    mode = readings.parameters.get(Parameter.REHEARSE)
    if mode is None:
        return None  # landing_app says it
    return judged(
        "rehearsal",
        mode == 0,
        "off" if mode == 0 else "on",
        "off",
        "a drone that rehearses cannot be armed",
        "rehearse again to its end, or switch the drone off and on",
    )


def drone_state(readings: DroneReadings, _: Readings) -> CheckResult:
    """The drone's own supervisor has no objection."""
    info = readings.supervisor
    wrong = [
        name
        for name, holds in (
            ("locked", info.is_locked),
            ("tumbled", info.is_tumbled),
            ("crashed", info.is_crashed),
            ("armed", info.is_armed),
            ("cannot arm", not (info.can_arm or info.is_armed)),
        )
        if holds
    ]
    return judged(
        "drone_state",
        not wrong,
        ", ".join(wrong) or "can arm",
        "can arm",
        "a drone that has stopped itself does not take off",
        "put it upright on its start mark and switch it off and on (check hover and fly reboot it, too)",
    )


def battery(readings: DroneReadings, all_readings: Readings) -> CheckResult:
    """The pack at rest."""
    limits = all_readings.limits
    wanted = f"{limits.battery_at_rest:g} to {limits.battery_full:g} V at rest"
    why, remedy = "a lower pack does not give the thrust of a flip", "charge or change the battery"
    if readings.voltage is None:
        return not_known(
            "battery", "pm.vbat was not logged", wanted, why, "reboot the drone; look at its console"
        )
    fine = limits.battery_at_rest <= readings.voltage <= limits.battery_full
    return judged("battery", fine, f"{readings.voltage:.2f} V", wanted, why, remedy)


def drone_clock(readings: DroneReadings, _: Readings) -> CheckResult:
    """Its milliseconds beside ours."""
    wanted = f"1 within {100 * CLOCK_RATE_OFF:g} %"
    why = "telemetry is put on the host's time by it"
    remedy = "a busy computer, or a link that queues: look at the link, and try again"
    rate = readings.clock_rate
    if rate is None:
        return not_known("drone_clock", "nothing was logged", wanted, why, remedy)
    return judged(
        "drone_clock", abs(rate - 1.0) <= CLOCK_RATE_OFF, f"{rate:.4f} s a second", wanted, why, remedy
    )


CHECKS: tuple[Callable[[DroneReadings, Readings], CheckResult | None], ...] = (
    link,
    firmware,
    landing_app,
    vehicle,
    app_memory,
    *(setting(name) for name in SETTINGS),
    arming,
    rehearsal,
    drone_state,
    battery,
    drone_clock,
)
