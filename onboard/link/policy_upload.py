"""Uploading a policy: stage, read back, compare, commit, and believe only the checksum that the drone
reports.

The drone validates the staged bundle by itself and keeps its previous policy when it refuses (see
:mod:`onboard.app_interface`). Its memory is volatile: after a reboot there is no policy.
"""

import zlib

from onboard.app_interface import BUNDLE_ADDRESS, MEMORY_TYPE_APP, Parameter, PolicyStatus
from onboard.link.errors import CommandRefused, LinkTimeout, PolicyRefused
from onboard.link.landing_app import check_interface
from onboard.link.memory import Memories
from onboard.link.parameters import Parameters
from onboard.timebase import Timebase

#: A refusal that was there before the commit is taken for this commit's when it is still there after this
#: time [s].
_STALE_AFTER_S = 0.3
_POLL_S = 0.01
_WRITE_ATTEMPTS = 3

REASONS: dict[PolicyStatus, str] = {
    PolicyStatus.REFUSED_LENGTH: "its length is not that of a bundle",
    PolicyStatus.REFUSED_CRC: "its checksum is wrong: it was damaged",
    PolicyStatus.REFUSED_FORMAT: "its format, version or dimensions are not known to this firmware",
    PolicyStatus.REFUSED_RANGE: "it contains numbers that are not finite or out of range",
    PolicyStatus.REFUSED_FLYING: "the drone is flying; land first",
    PolicyStatus.REFUSED_VECTORS: "it has more support vectors than the drone's control loop has time for",
}


class PolicyUpload:
    """Uploads policies and reports which one is live."""

    def __init__(
        self, parameters: Parameters, memories: Memories, commit_timeout_s: float, clock: Timebase
    ) -> None:
        self._parameters = parameters
        self._memories = memories
        self._commit_timeout_s = commit_timeout_s
        self._clock = clock

    def active_crc(self) -> int:
        """zlib.crc32 of the live bundle; 0 if there is none.

        Raises:
            NoSuchVariable: the firmware has no perching app.
        """
        return int(self._parameters.read(Parameter.POLICY_ACTIVE_CRC))

    def upload(self, bundle: bytes) -> int:
        """Make ``bundle`` the live policy; returns its checksum as the drone reports it.

        Raises:
            NoSuchVariable: the firmware has no perching app, or one of another interface version.
            PolicyRefused: the drone refuses it, for the reason in the message, and keeps its previous policy.
            LinkTimeout, LinkLost: the link failed; which policy is live must be asked again.
        """
        check_interface(self._parameters.read)
        self._stage(bundle)
        crc = zlib.crc32(bundle)
        before = self._status()
        self._parameters.write(Parameter.POLICY_LENGTH, len(bundle))
        self._parameters.write(Parameter.POLICY_CRC, crc)
        self._parameters.write(Parameter.POLICY_COMMIT, 1)
        return self._wait_for_verdict(crc, before)

    def _stage(self, bundle: bytes) -> None:
        for _ in range(_WRITE_ATTEMPTS):
            try:
                self._memories.write(MEMORY_TYPE_APP, bundle, BUNDLE_ADDRESS)
            except CommandRefused as error:
                raise PolicyRefused(
                    f"the drone does not accept a policy now (is it flying?): {error}"
                ) from error
            if self._memories.read(MEMORY_TYPE_APP, BUNDLE_ADDRESS, len(bundle)) == bundle:
                return
        raise PolicyRefused(
            f"what the drone stored differs from the policy, {_WRITE_ATTEMPTS} times; nothing was committed"
        )

    def _status(self) -> int:
        return int(self._parameters.read(Parameter.POLICY_STATUS))

    def _wait_for_verdict(self, crc: int, before: int) -> int:
        committed = self._clock()
        pause = self._clock.event()
        while (waited := self._clock() - committed) < self._commit_timeout_s:
            status = self._status()
            if status == PolicyStatus.ACTIVE and self.active_crc() == crc:
                return crc
            if status >= PolicyStatus.REFUSED_LENGTH and (status != before or waited > _STALE_AFTER_S):
                raise PolicyRefused(
                    f"the drone refuses the policy: {_reason(status)}. It keeps the one it had."
                )
            pause.wait(_POLL_S)
        raise LinkTimeout(
            f"the drone did not say within {self._commit_timeout_s:g} s if it takes the policy ({status})"
        )


def _reason(status: int) -> str:
    try:
        return REASONS[PolicyStatus(status)]
    except ValueError:
        return f"status {status}, unknown to this program"
