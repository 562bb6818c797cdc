"""The radio chip (nRF51): power switch and resets, port 15 channel 3 (crazyflie2-nrf-firmware ``main.c``).

client to drone, header ``FF``::

    (empty)         poll                            -> FF
    FE 01           all off                         -> FF; then nothing answers until the button is pressed
    FE 02           microcontroller and decks off   -> FF; only the radio answers
    FE 03           microcontroller on              -> FF; boots when it was off
    FE 04           battery voltage                 -> FF FE 04 f32 volts
    FE 05, FE 06    LED on, off                     -> FF
    FE FF           reset, first step               -> FF FE FF, 6 bytes of chip address
    FE F0 u8        reset, second step              -> FF; 0 to the bootloader, else to the firmware

Every packet that reaches the radio is acknowledged on the air; ``FF`` stands for an acknowledgement
without data, which is how a UDP client sees that the radio is there. There is no bootloader in the
simulation: after a reset into it the microcontroller stays off until it is switched on or reset into the
firmware.
"""

import struct
from enum import Enum, IntEnum

from sim_backend.crazyflie.crtp import NULL, Packet
from sim_backend.crazyflie.interfaces import FirmwarePort

MARK = 0xFE
CHIP_ADDRESS = bytes.fromhex("e7e7e7e7e7e7")


class Power(Enum):
    """What has power."""

    ALL_OFF = "all off"
    RADIO_ONLY = "radio only"
    ON = "on"


class RadioCommand(IntEnum):
    """Commands of the radio chip."""

    ALL_OFF = 0x01
    SYSTEM_OFF = 0x02
    SYSTEM_ON = 0x03
    BATTERY_VOLTAGE = 0x04
    RESET = 0xF0
    RESET_INIT = 0xFF


class Radio:
    """Power state of one drone and the commands that change it.

    Attributes:
        power: what has power now.
    """

    def __init__(self, firmware: FirmwarePort) -> None:
        """The drone is on."""
        self._firmware = firmware
        self.power = Power.ON
        self._reset_ready = False

    def handle(self, packet: Packet) -> bytes | None:
        """The datagram that answers a packet for the radio; ``None`` when nothing has power."""
        if self.power is Power.ALL_OFF:
            return None
        if len(packet.payload) < 2 or packet.payload[0] != MARK:
            return NULL
        return self._command(packet.payload[1], packet.payload[2:])

    def press_button(self) -> None:
        """The power button: switches everything off, or on."""
        if self.power is Power.ALL_OFF:
            self._switch_on()
        else:
            self._switch_off(Power.ALL_OFF)

    def _command(self, command: int, data: bytes) -> bytes:
        if command == RadioCommand.ALL_OFF:
            self._switch_off(Power.ALL_OFF)
        elif command == RadioCommand.SYSTEM_OFF:
            self._switch_off(Power.RADIO_ONLY)
        elif command == RadioCommand.SYSTEM_ON:
            self._switch_on()
        elif command == RadioCommand.BATTERY_VOLTAGE:
            return NULL + bytes([MARK, command]) + struct.pack("<f", self._firmware.battery_voltage())
        elif command == RadioCommand.RESET_INIT:
            self._reset_ready = True
            return NULL + bytes([MARK, command]) + CHIP_ADDRESS
        elif command == RadioCommand.RESET and self._reset_ready and len(data) == 1:
            self._reset_ready = False
            self._switch_off(Power.RADIO_ONLY)
            if data[0] != 0:
                self._switch_on()
        return NULL

    def _switch_off(self, power: Power) -> None:
        if self.power is Power.ON:
            self._firmware.power_off()
        self.power = power

    def _switch_on(self) -> None:
        if self.power is not Power.ON:
            self.power = Power.ON
            self._firmware.reboot()
