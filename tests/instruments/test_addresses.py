"""URIs of scales and supplies: which instrument they open, and what is said of those that are none."""

import pytest

from calibration.bench.instruments.addresses import InstrumentAddress, ScaleAddress, SupplyAddress
from calibration.bench.instruments.balance import Balance
from calibration.bench.instruments.errors import InstrumentInputError
from calibration.bench.instruments.kept_supply import KeptSupply
from calibration.bench.instruments.load_cell import LoadCell
from calibration.bench.instruments.manual import ManualScale, ManualSupply
from calibration.bench.instruments.scale import Scale
from calibration.bench.instruments.schemes import SCALES, SUPPLIES, InstrumentScheme, in_words
from tests.instruments.pty_device import LineBoard, PtyDevice
from tests.instruments.test_polled_instruments import Somebody, TinyKorad, TinyScpi, balance

NOBODY = Somebody([])


@pytest.mark.parametrize("uri", ["loadcell://{}?baud=115200", "serial://{}", "{}"])
def test_a_load_cell_is_what_a_bare_port_means(uri: str) -> None:
    with LineBoard("load") as board, ScaleAddress.of(uri.format(board.name)).open(NOBODY) as scale:
        assert isinstance(scale, LoadCell)
        assert scale.device == board.name


@pytest.mark.parametrize("schemes", [SCALES, SUPPLIES])
def test_what_a_bare_port_means_does_not_depend_on_the_order_of_the_table(
    schemes: dict[str, InstrumentScheme],
) -> None:
    turned = dict(reversed(schemes.items()))
    meant = InstrumentAddress.parse("/dev/ttyUSB0", turned, "instrument").scheme
    assert meant == InstrumentAddress.parse("/dev/ttyUSB0", schemes, "instrument").scheme
    assert [text for text in in_words(turned.values()).split(", ") if "just the port" in text] == [
        f"{schemes[meant].example} for {schemes[meant].what} (or just the port)"
    ]


def test_a_balance_and_a_person_are_scales() -> None:
    scales: list[Scale] = []
    with PtyDevice(balance({b"SI": b"S S 1.5 g\r\n"})) as device:
        for uri in (f"mtsics://{device.name}?baud=9600", "manual://"):
            with ScaleAddress.of(uri).open(Somebody([0.0015])) as scale:
                scale.begin()
                scale.look(0.1)
                assert scale.read().indication == pytest.approx(1.5e-3)
                scales.append(scale)
    assert [type(scale) for scale in scales] == [Balance, ManualScale]


@pytest.mark.parametrize(
    ("uri", "tiny"),
    [
        ("scpi://{}?baud=9600", TinyScpi),
        ("serial://{}?baud=9600", TinyScpi),
        ("{}", TinyScpi),
        ("korad://{}", TinyKorad),
    ],
)
def test_supplies_with_a_port_are_kept_and_can_be_cut(
    uri: str, tiny: type[TinyScpi] | type[TinyKorad]
) -> None:
    with PtyDevice(tiny()) as device:
        address = SupplyAddress.of(uri.format(device.name))
        assert address.can_be_cut
        with address.open(NOBODY) as supply:
            assert isinstance(supply, KeptSupply)
            supply.set(3.7, 5.0)
            supply.switch(on=True)
            assert supply.measure().voltage == 3.7


def test_a_supply_in_a_persons_hands_cannot_be_cut() -> None:
    address = SupplyAddress.of("manual://")
    assert not address.can_be_cut
    assert isinstance(address.open(NOBODY), ManualSupply)


@pytest.mark.parametrize("uri", ["scpi:///dev/ttyUSB0", "scales:///dev/x", "manual:///dev/x", "mtsics:/x://"])
def test_what_is_no_scale_is_told_with_what_is(uri: str) -> None:
    with pytest.raises(InstrumentInputError, match=r"is no scale: write loadcell://.*mtsics://.*manual://"):
        ScaleAddress.of(uri)


@pytest.mark.parametrize("uri", ["loadcell:///dev/ttyUSB0", "tcp://host:1"])
def test_what_is_no_supply_is_told_with_what_is(uri: str) -> None:
    with pytest.raises(InstrumentInputError, match=r"is no supply: write scpi://.*korad://.*manual://"):
        SupplyAddress.of(uri)


@pytest.mark.parametrize("port", ["/dev/x?baud=fast", "/dev/x?bits=8", ""])
def test_a_port_that_is_none_is_told(port: str) -> None:
    with pytest.raises(InstrumentInputError):
        ScaleAddress.of(f"loadcell://{port}").open(NOBODY)
