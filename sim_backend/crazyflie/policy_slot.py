"""The app's policy slot: staged bundle memory (port 4, type 0x18), and what its commit parameters say.

Two buffers: the client writes the staged bytes, a commit that passes every check makes the policy live, in
the engine. A refused commit keeps the previous policy live and says why in ``perch.polStat``; the staged
bytes stay, so that they can be read back. RAM: everything is gone after a reboot.
"""

from collections.abc import Callable

from onboard.app_interface import MEMORY_SIZE, MEMORY_TYPE_APP, Parameter, PolicyStatus
from sim_backend.crazyflie.engine import Engine
from sim_backend.crazyflie.memory import RamMemory
from sim_backend.crazyflie.tables import Number, ParameterTable


class PolicySlot:
    """Staged policy of one drone, and the status of its commits.

    Attributes:
        memory: the staged bytes.
        status: of the last commit.
    """

    def __init__(self, params: ParameterTable, engine: Engine, is_flying: Callable[[], bool]) -> None:
        self.memory = RamMemory(MEMORY_TYPE_APP, MEMORY_SIZE, lambda: not is_flying())
        self._params = params
        self._engine = engine
        self._is_flying = is_flying
        self.boot()
        params.on_write(Parameter.POLICY_COMMIT, self._on_commit)

    def boot(self) -> None:
        """Lose everything, as RAM does."""
        self.memory.clear()
        self.status = PolicyStatus.NONE

    def _on_commit(self, value: Number) -> None:
        if value != 1:
            return
        self.status = self._commit()
        self._params[Parameter.POLICY_STATUS] = int(self.status)
        self._params[Parameter.POLICY_ACTIVE_CRC] = self._engine.live_crc
        self._params[Parameter.POLICY_COMMIT] = 0

    def _commit(self) -> PolicyStatus:
        length = int(self._params[Parameter.POLICY_LENGTH])
        staged = bytes(self.memory.data[:length]) if length <= MEMORY_SIZE else b""
        return self._engine.commit(staged, int(self._params[Parameter.POLICY_CRC]), self._is_flying())
