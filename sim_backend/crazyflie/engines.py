"""The engine of a drone by its name; each is imported where it is used, for C needs a compiler."""

from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import Engine
from sim_backend.engine_name import EngineName


def make_engine(name: EngineName, vehicle: Vehicle) -> Engine:
    """The engine of a drone whose firmware was built for `vehicle`."""
    if name is EngineName.C:
        from sim_backend.crazyflie.c_engine import CEngine

        return CEngine(vehicle)
    from sim_backend.crazyflie.reference_engine import ReferenceEngine

    return ReferenceEngine(vehicle)
