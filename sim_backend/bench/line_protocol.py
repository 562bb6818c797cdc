"""The line protocol of tachometer and load cell, as the boards speak it (bench notes 4).

ASCII lines ``text*HH``. In protocol 1 HH is the exclusive or of all bytes of the text, in two hexadecimal
digits; in protocol 2 there are four, a CRC-16 (CCITT, starting from FFFF), which our sketches speak.

    I,<protocol>,<kind>,<firmware>,<uid>,<tick_us>          who I am: after a start and when asked
    E,<seq>,<t0_us>,<d1>,...,<d7>                  up to 8 edges: the first, then differences
    H,<seq>,<t_us>,<total>,<overflow>,<level>      heartbeat, every 100 ms, always
    L,<seq>,<t_us>,<counts>                        one conversion of the load cell
    M,<seq>,<t_us>,<tag>                           echo of a mark
    X,<seq>,<t_us>,<code>,<text>                   something is wrong

The host says ``?`` (who are you), ``S`` (start), ``P`` (stop) and ``M<tag>`` with a line end (mark).
"""

import binascii
from functools import reduce
from operator import xor

EDGES_A_LINE = 8
HEARTBEAT_S = 0.1
TICK_US = 4
"""Resolution of micros() on a 16 MHz AVR."""
MICROS_RANGE = 1 << 32
SEQUENCE_RANGE = 1 << 16


def checksum(text: str) -> int:
    """Exclusive or of all bytes of an ASCII text."""
    return reduce(xor, text.encode("ascii"), 0)


def line(protocol: int, *fields: str | int) -> bytes:
    """One line of protocol 1 or 2 without its end."""
    text = ",".join(str(field) for field in fields)
    if protocol == 2:
        return f"{text}*{binascii.crc_hqx(text.encode('ascii'), 0xFFFF):04X}".encode("ascii")
    return f"{text}*{checksum(text):02X}".encode("ascii")
