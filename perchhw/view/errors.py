"""What keeps a view from being shown."""

import importlib.util

from onboard.errors import InputError
from perchhw.errors import FlightStackError


class ViewError(FlightStackError, InputError):
    """The view cannot be made; the message says what to install or give."""


def require_rerun() -> None:
    """Look whether Rerun is installed, without importing it.

    Raises:
        ViewError: it is not.
    """
    if importlib.util.find_spec("rerun") is None:
        raise ViewError("the view needs rerun-sdk: pip install 'perchhw[view]'")
