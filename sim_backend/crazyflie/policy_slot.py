"""The app's policy slot: staged bundle memory (port 4, type 0x18), and what its commit parameters say.

Two buffers: the client writes the staged bytes, a commit that passes every check makes the policy live, in
the engine. A refused commit keeps the previous policy live and says why in ``perch.polStat``; the staged
bytes stay, so that they can be read back. RAM: everything is gone after a reboot.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from onboard.app_interface import MEMORY_SIZE, Parameter, PolicyStatus
from onboard.policy.bundle import bundle_crc32, decode_bundle, encode_bundle
from sim_backend.crazyflie.app_memory import AppMemory
from sim_backend.crazyflie.engine import Engine
from sim_backend.crazyflie.tables import Number, ParameterTable


class PolicySlot:
    """Staged policy of one drone, and the status of its commits.

    Args:
        policy_weight: a fault of the memory: the factor of one weight of the policy, after all its checks.

    Attributes:
        memory: the staged bytes, and the engine's recorder.
        status: of the last commit.
        crc: of the live policy, as the drone believes; 0 for none.
    """

    def __init__(
        self,
        params: ParameterTable,
        engine: Engine,
        is_flying: Callable[[], bool],
        policy_weight: float = 1.0,
    ) -> None:
        self.memory = AppMemory(lambda: not is_flying(), engine.record)
        self._params = params
        self._engine = engine
        self._is_flying = is_flying
        self._policy_weight = policy_weight
        self.boot()
        params.on_write(Parameter.POLICY_COMMIT, self._on_commit)

    def boot(self) -> None:
        """Lose everything, as RAM does."""
        self.memory.clear()
        self.status = PolicyStatus.NONE
        self.crc = 0

    def _on_commit(self, value: Number) -> None:
        if value != 1:
            return
        self.status = self._commit()
        self._params[Parameter.POLICY_STATUS] = int(self.status)
        self._params[Parameter.POLICY_ACTIVE_CRC] = self.crc
        self._params[Parameter.POLICY_COMMIT] = 0

    def _commit(self) -> PolicyStatus:
        length, crc = int(self._params[Parameter.POLICY_LENGTH]), int(self._params[Parameter.POLICY_CRC])
        staged = self.memory.staged(length) if length <= MEMORY_SIZE else b""
        status = self._engine.commit(staged, crc, self._is_flying())
        if status is PolicyStatus.ACTIVE:
            self.crc = crc
            if self._policy_weight != 1.0:
                spoilt = with_a_weight_changed(staged, self._policy_weight)
                self._engine.commit(spoilt, bundle_crc32(spoilt), self._is_flying())
        return status


def with_a_weight_changed(bundle: bytes, factor: float) -> bytes:
    """A sound bundle whose policy has one weight times `factor`: the first of its network's last layer."""
    policy = decode_bundle(bundle)
    last = policy.layers[-1]
    weights = last.weights.copy()
    weights[0, 0] *= np.float32(factor)
    return encode_bundle(replace(policy, layers=(*policy.layers[:-1], replace(last, weights=weights))))
