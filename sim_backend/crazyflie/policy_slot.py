"""The app's policy slot: staged bundle memory (port 4, type 0x18), validation on commit, the live policy.

Two buffers: the client writes the staged bytes, a commit that passes every check makes the policy live. A
refused commit keeps the previous policy live and says why in ``perch.polStat``; the staged bytes stay, so
that they can be read back. RAM: everything is gone after a reboot.
"""

import math
from collections.abc import Callable

from onboard.app_interface import MEMORY_SIZE, MEMORY_TYPE_APP, Parameter, PolicyStatus
from onboard.policy.bundle import BundleFault, PolicyBundleError, bundle_crc32, decode_bundle
from onboard.policy.model import CompiledPolicy
from sim_backend.crazyflie.memory import RamMemory
from sim_backend.crazyflie.tables import Number, ParameterTable

_REFUSALS = {
    BundleFault.LENGTH: PolicyStatus.REFUSED_LENGTH,
    BundleFault.CRC: PolicyStatus.REFUSED_CRC,
    BundleFault.FORMAT: PolicyStatus.REFUSED_FORMAT,
    BundleFault.RANGE: PolicyStatus.REFUSED_RANGE,
    BundleFault.VECTORS: PolicyStatus.REFUSED_VECTORS,
}


class PolicySlot:
    """Staged and live policy of one drone.

    Attributes:
        memory: the staged bytes.
        live: compiled policy, or None.
        live_crc: CRC32 of the live bundle, 0 for none.
        tau_min: least tau at which the live policy can fire, s; NaN for none.
        status: of the last commit.
    """

    def __init__(self, params: ParameterTable, is_flying: Callable[[], bool]) -> None:
        self.memory = RamMemory(MEMORY_TYPE_APP, MEMORY_SIZE, lambda: not is_flying())
        self._params = params
        self._is_flying = is_flying
        self.boot()
        params.on_write(Parameter.POLICY_COMMIT, self._on_commit)

    def boot(self) -> None:
        """Lose everything, as RAM does."""
        self.memory.clear()
        self.live: CompiledPolicy | None = None
        self.live_crc = 0
        self.tau_min = math.nan
        self.status = PolicyStatus.NONE

    def _on_commit(self, value: Number) -> None:
        if value != 1:
            return
        self.status = self._commit()
        self._params[Parameter.POLICY_STATUS] = int(self.status)
        self._params[Parameter.POLICY_ACTIVE_CRC] = self.live_crc
        self._params[Parameter.POLICY_COMMIT] = 0

    def _commit(self) -> PolicyStatus:
        if self._is_flying():
            return PolicyStatus.REFUSED_FLYING
        length = int(self._params[Parameter.POLICY_LENGTH])
        if not 0 < length <= MEMORY_SIZE:
            return PolicyStatus.REFUSED_LENGTH
        staged = bytes(self.memory.data[:length])
        crc = bundle_crc32(staged)
        if crc != self._params[Parameter.POLICY_CRC]:
            return PolicyStatus.REFUSED_CRC
        try:
            policy = decode_bundle(staged)
        except PolicyBundleError as error:
            return _REFUSALS[error.fault]
        self.load(policy.compiled(), crc, float(policy.tau_min))
        return PolicyStatus.ACTIVE

    def load(self, policy: CompiledPolicy, crc: int, tau_min: float) -> None:
        """Make a policy live."""
        self.live, self.live_crc, self.tau_min = policy, crc, tau_min
