"""The operator as a person who works instruments that have no port."""

from calibration.bench.procedures.operator import Operator, Question, Task

SCALE_READING = Question(
    "scale_reading",
    "what the scale showed; motors may turn again when you have typed it",
    "kg",
    "g",
    (-0.5, 2.0),
    0.05e-3,
)
SUPPLY_READING = Question("supply_voltage", "voltage that the supply shows", "V", "V", (2.5, 4.6), 5e-3)


class OperatorAsPerson:
    """A :class:`~calibration.bench.instruments.manual.Person`."""

    def __init__(self, operator: Operator) -> None:
        self._operator = operator

    def look_at_scale(self, seconds: float) -> None:
        """Said and not waited for: motors turn meanwhile."""
        text = f"Read the scale now, within {seconds:g} s, and remember it: you are asked when motors stand."
        self._operator.do(Task("read_scale", text, noticed=True))

    def weight(self) -> float:
        """What was read then [kg]."""
        return self._operator.measure(SCALE_READING)[0]

    def voltage(self) -> float:
        """What the supply shows [V]."""
        return self._operator.measure(SUPPLY_READING)[0]

    def set_supply(self, voltage: float, current_limit: float) -> None:
        """Voltage [V] and current limit [A]."""
        text = f"Set the supply to {voltage:.2f} V with a current limit of {current_limit:.1f} A."
        self._operator.do(
            Task("set_supply", text, {"voltage": voltage, "current_limit": current_limit}, noticed=True)
        )

    def switch_supply(self, on: bool) -> None:
        """Off is said and not waited for: it is on the way out, too."""
        text = f"Switch the supply {'on' if on else 'OFF'}."
        self._operator.do(Task("switch_supply", text, {"on": on}, noticed=not on))
