"""A term without a name: what a fit takes beside the variables of named effects."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from calibration.gap.data.channels import Channel
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle


@dataclass(frozen=True)
class UnnamedTerm(ABC):
    """Something that no named effect describes, linear in its values.

    Attributes:
        channel: where it acts.
        regressor: name of what it goes with; "time" for a line.
        columns: signals per unit of each value (m/s2, rad/s2 or V), shape (n, 7) each.
    """

    channel: Channel
    regressor: str
    columns: tuple[FloatArray, ...]

    @abstractmethod
    def formula(self, values: FloatArray, vehicle: Vehicle) -> str:
        """The term in words, with numbers.

        Args:
            values: fitted, one per column.
            vehicle: whose mass and inertia turn accelerations into forces and torques.
        """
