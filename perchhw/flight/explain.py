"""The diagnosis of a flight that has just ended, kept with its record."""

import logging
from pathlib import Path
from typing import Any

from perchhw.diagnosis import keep_diagnosis
from perchhw.flight.caught import Caught

_log = logging.getLogger(__name__)


def explain(folder: Path) -> dict[str, Any] | None:
    """The diagnosis of the run `folder`, as in its ``run.json``; what it fails of costs no result."""
    with Caught(lambda error: _log.error("no diagnosis of %s", folder, exc_info=error)):
        return keep_diagnosis(folder).to_json()
    return None
