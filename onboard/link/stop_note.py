"""Every ``perchhw stop`` leaves a note for the machine, so that nobody takes off again who has not seen it.

The drone itself cannot tell a campaign about a stop between two attempts: every attempt leaves it locked, and
the next one begins with a reboot. A stop that another machine sent at such a moment leaves no trace.
"""

import logging
import os
import time

from onboard.link.errors import DroneStopped
from onboard.link.machine_files import file_of, open_for_all

_ENDING = ".stopped"
_log = logging.getLogger(__name__)


def note_stop(uri: str) -> bool:
    """Note that the drone at `uri` is being stopped; whether it could be, else that is told, too.

    Raises:
        LinkInputError: the URI cannot be used.
    """
    path = file_of(uri, _ENDING)
    try:
        file = open_for_all(path)
        try:
            os.pwrite(file, f"{time.time_ns()}\n".encode(), 0)
        finally:
            os.close(file)
    except OSError as error:
        _log.error("cannot note the stop of %s (%s: %s): see to it that nobody takes off", uri, path, error)
        return False
    return True


class StopsSince:
    """The stops of one drone by ``perchhw stop`` since this was made.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneStopped: there may have been one: its note cannot be read.
    """

    def __init__(self, uri: str) -> None:
        self._uri = uri
        self._path = file_of(uri, _ENDING)
        self._known = self._last()

    def check(self) -> None:
        """Returns when there was none.

        Raises:
            DroneStopped: somebody stopped the drone.
        """
        if self._last() != self._known:
            raise DroneStopped(
                f"stopped: somebody stopped {self._uri} with perchhw stop; find out why, then go on"
            )

    def _last(self) -> bytes | None:
        """What the last stop noted; None before the first.

        Raises:
            DroneStopped: there is a note, and it cannot be read.
        """
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise DroneStopped(
                f"was {self._uri} stopped? Its note {self._path} cannot be read ({error}): remove it"
            ) from error
