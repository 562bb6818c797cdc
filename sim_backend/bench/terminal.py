"""A pseudo-terminal as an instrument's serial port."""

import os
import select
import termios
import tty

_SPEEDS = {
    termios.B1200: 1200,
    termios.B2400: 2400,
    termios.B4800: 4800,
    termios.B9600: 9600,
    termios.B19200: 19200,
    termios.B38400: 38400,
    termios.B57600: 57600,
    termios.B115200: 115200,
    termios.B230400: 230400,
    termios.B460800: 460800,
    termios.B921600: 921600,
}
_READ_MAX = 4096


class Terminal:
    """The instrument's end of a serial port.

    Attributes:
        name: device that the computer opens, ``/dev/pts/N``.
        overrun: bytes that the computer did not take in time.
    """

    def __init__(self) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        attributes = termios.tcgetattr(slave)
        attributes[4] = attributes[5] = termios.B115200
        termios.tcsetattr(slave, termios.TCSANOW, attributes)
        self.name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self.overrun = 0

    @property
    def is_open(self) -> bool:
        """Whether the computer has the port open."""
        return not any(event & select.POLLHUP for _, event in self._poll.poll(0))

    @property
    def speed(self) -> int:
        """Baud rate that the computer has set; 0 for an unusual one."""
        return _SPEEDS.get(termios.tcgetattr(self._master)[4], 0)

    def read(self) -> bytes:
        """What the computer has sent."""
        try:
            return os.read(self._master, _READ_MAX)
        except OSError:  # nothing there, or the port is closed
            return b""

    def write(self, data: bytes) -> None:
        """Hand bytes to the computer; what its buffer has no room for is lost, as on a real port."""
        try:
            written = os.write(self._master, data)
        except OSError:  # full, or the port was closed in between
            written = 0
        self.overrun += len(data) - written

    def close(self) -> None:
        """Pull the plug."""
        os.close(self._master)
