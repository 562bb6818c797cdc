"""Simulated drones that are not what their vehicle file says."""

from pathlib import Path

from onboard.vehicle.file_format import LIBRARY

FILE = "crazyflie21-upgraded"
_TEXT = (LIBRARY / f"{FILE}.toml").read_text(encoding="utf-8")


def effect(name: str, unit: str, **values: float) -> str:
    """An effect's table."""
    rows = [
        f'{k} = {{ value = {v}, unit = "{unit}", sigma = 0, source = "test" }}' for k, v in values.items()
    ]
    return "\n".join(["", "[[effects]]", f'name = "{name}"', *rows, ""])


def drone(folder: Path, *effects: str, **replaced: tuple[str, str]) -> str:
    """A vehicle file with effects, and numbers replaced: `key` = (what the file says, what it is)."""
    text = _TEXT + "".join(effects)
    for key, (said, true) in replaced.items():
        assert f"{key} = {{ value = {said}," in text
        text = text.replace(f"{key} = {{ value = {said},", f"{key} = {{ value = {true},")
    file = folder / "true.toml"
    file.write_text(text, encoding="utf-8")
    return str(file)


WEAK_MOTOR = effect("motor_imbalance", "1", m1=1.0, m2=0.86, m3=1.0, m4=1.0)
LATE_POSES = effect("pose_delay", "s", delay=0.03)
GYRO_BIAS = effect("gyro_bias", "rad/s", x=0.03, y=0.0, z=0.0)
