"""Question and answer with a device that speaks only when asked: supplies and balances."""

from calibration.bench.instruments.diagnosis import text_share
from calibration.bench.instruments.errors import InstrumentTimeout, WrongBaudRate
from calibration.bench.instruments.transport import Address, SerialPort
from onboard.clock import Clock, monotonic
from onboard.closing import Closing

_ANSWER_BYTES_MAX = 512
#: A device without line ends has finished when it is silent for so long [s].
_PAUSE_S = 0.06


class Conversation(Closing):
    """An open port with one question at a time; a context manager."""

    def __init__(self, address: str, default_baud: int, *, clock: Clock = monotonic) -> None:
        """Open the port.

        Raises:
            InstrumentInputError, InstrumentNotFound.
        """
        self._port = SerialPort(Address.parse(address, default_baud))
        self._clock = clock
        self._rest = b""

    @property
    def device(self) -> str:
        """Name of the port."""
        return self._port.address.device

    def tell(self, command: bytes) -> None:
        """Send a command that has no answer."""
        self._port.write(command)

    @property
    def answer_s(self) -> float:
        """How long an answer may take [s], as the address says."""
        return self._port.address.answer_s

    def ask_line(self, command: bytes) -> str:
        """Send a command; its answer is the next line (LF or CRLF), whatever lay there before is old.

        Raises:
            InstrumentTimeout: no complete line within :attr:`answer_s`.
            WrongBaudRate: the answer is no text.
            InstrumentLost: unplugged.
        """
        self._discard_old()
        self._port.write(command)
        deadline = self._clock() + self.answer_s
        while b"\n" not in self._rest:
            left = deadline - self._clock()
            if left <= 0.0 or len(self._rest) > _ANSWER_BYTES_MAX:
                raise self._no_answer(command, self._rest)
            self._rest += self._port.read(left)
        line, _, self._rest = self._rest.partition(b"\n")
        return self._text(command, line)

    def ask_unterminated(self, command: bytes, length: int | None = None) -> bytes:
        """Send a command whose answer has no end: `length` bytes, or all until it is silent.

        Raises:
            InstrumentTimeout: nothing, or too little, within :attr:`answer_s`.
        """
        self._discard_old()
        self._port.write(command)
        deadline = self._clock() + self.answer_s
        answer = b""
        while not answer and (left := deadline - self._clock()) > 0.0:
            answer = self._port.read(left)
        while answer and len(answer) < (length or _ANSWER_BYTES_MAX):
            more = self._port.read(_PAUSE_S)
            if not more:
                break
            answer += more
        if not answer or (length is not None and len(answer) != length):
            raise self._no_answer(command, answer)
        return answer

    def close(self) -> None:
        """Close the port; idempotent."""
        self._port.close()

    def _discard_old(self) -> None:
        self._rest = b""
        self._port.discard()

    def _text(self, command: bytes, line: bytes) -> str:
        if text_share(line) < 1.0:
            raise self._no_answer(command, line)
        return line.decode("ascii").strip()

    def _no_answer(self, command: bytes, received: bytes) -> InstrumentTimeout | WrongBaudRate:
        asked = command.decode("ascii", "replace").strip()
        if text_share(received) < 1.0:
            return WrongBaudRate(
                f"{self.device} answers {asked!r} with bytes that are no text: wrong speed? It is set to "
                f"{self._port.address.baud} baud"
            )
        got = f"only {received[:40]!r}" if received else "nothing"
        return InstrumentTimeout(
            f"{self.device} answered {got} to {asked!r} within {self.answer_s:g} s: is it on, is it this "
            "port? A slow one may have longer: ?answer_s=SECONDS behind its address"
        )
