"""Why a port of this computer cannot be taken, in words for whoever asked for it."""

import errno


def why_not_taken(error: OSError, protocol: str, host: str, port: int) -> str:
    """What the system says of a port that could not be taken, which port it is, and how to see who has it.

    Args:
        error: of ``bind``.
        protocol: ``UDP`` or ``TCP``.
        host, port: what was asked for.
    """
    where = f"{protocol} port {port} on {host}"
    if error.errno == errno.EADDRINUSE:
        flag = "u" if protocol == "UDP" else "t"
        return f"{where} is in use by another program (`ss -{flag}lpn sport = :{port}` names it)"
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"{where} is not for this user: take one of 1024 or more"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{where} cannot be taken: this computer has no such address"
    return f"{where} cannot be taken: {error.strerror or error}"
