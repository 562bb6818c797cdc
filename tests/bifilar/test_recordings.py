"""Files of recordings: ours, the authors' of 2022, cfclient's; and what broken ones are told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.bench.inertia.errors import SwingFileError, UnusableSwingError
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.recordings import OWN_HEADER, read_swing, write_swing
from calibration.bench.inertia.swing import Swing
from onboard.errors import InputError
from tests.drawn_examples import examples
from tests.truth.bench.pendulum import Hang, record

OWN = ",".join(OWN_HEADER)
CLIENT = "gyro.x_x,gyro.x_y,gyro.y_x,gyro.y_y,gyro.z_x,gyro.z_y"
GROUND = "k_ep,k_run,t,wx,wy,wz,Error"


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
@pytest.mark.parametrize("with_acceleration", [True, False])
def test_what_is_written_is_read(tmp_path: Path, name: str, with_acceleration: bool) -> None:
    swing = record(Hang(), np.random.default_rng(0), 10.0, cycles=4.0)
    swing = swing if with_acceleration else replace(swing, acceleration=None)
    write_swing(tmp_path / name, swing)
    back = read_swing(tmp_path / name, axis=(0.0, 0.0, 1.0))
    assert np.allclose(back.time, np.round(swing.time, 3), rtol=0.0, atol=1e-12)
    assert np.array_equal(back.gyro, swing.gyro)
    assert (back.acceleration is None) == (not with_acceleration)
    assert back.clock == "drone"
    assert fit_swing(back).period.value == pytest.approx(fit_swing(swing).period.value, rel=1e-5)


def test_the_header_is_the_one_that_was_agreed(tmp_path: Path) -> None:
    swing = record(Hang(), np.random.default_rng(0), 10.0, cycles=1.0)
    write_swing(tmp_path / "a.csv", swing)
    first = (tmp_path / "a.csv").read_text().splitlines()[0]
    assert first == "t_ms,gyro_x[rad/s],gyro_y[rad/s],gyro_z[rad/s],acc_x[m/s2],acc_y[m/s2],acc_z[m/s2]"


def test_host_stamps_are_not_written_as_the_drones(tmp_path: Path) -> None:
    swing = replace(record(Hang(), np.random.default_rng(0), 10.0, cycles=1.0), clock="host")
    with pytest.raises(SwingFileError, match="stamped by the drone"):
        write_swing(tmp_path / "a.csv", swing)
    with pytest.raises(SwingFileError, match="No such file"):
        write_swing(tmp_path / "none" / "a.csv", replace(swing, clock="drone"))


def test_units_and_clocks_of_the_other_kinds(tmp_path: Path) -> None:
    client = tmp_path / "client.csv"
    client.write_text(f"{CLIENT}\n1000.,180.0,1000.,0.0,1000.,-90.0\n1020.,90,1020.,0,1020.,0\n")
    swing = read_swing(client)
    assert np.allclose(swing.time, [1.0, 1.02])
    assert np.allclose(swing.gyro[0], [np.pi, 0.0, -np.pi / 2.0])
    ground = tmp_path / "ground.csv"
    ground.write_text(
        f"{GROUND}\n0,0,40.0,0.1,0.2,0.3,\n0,0,2.0,9,9,9,\n\n0,0,50.0,8,8,8,Flip Data\n0,0,40.1,0.2,0.1,0,\n"
    )
    swing = read_swing(ground)
    assert swing.clock == "host"
    assert np.allclose(swing.time, [40.0, 40.1])
    assert np.allclose(swing.gyro, [[0.1, 0.2, 0.3], [0.2, 0.1, 0.0]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty first row"),
        ("t,x\n1,2\n", "not a recording of a swing"),
        (f"{OWN}\n1,0,0,0,0,0\n", "row 2: 6 cells"),
        (f"{OWN}\n1,0,0,0,0,0,9\n2,0,zero,0,0,0,9\n", "row 3 column 'gyro_y[rad/s]': 'zero' is not a number"),
        (f"{OWN}\n1,0,0,nan,0,0,9\n", "row 2 column 'gyro_z[rad/s]': 'nan' is not a finite number"),
        (f"{OWN}\n1,0,0,0,0,,9\n", "row 2 column 'acc_y[m/s2]': '' is not a finite number"),
        (f"{OWN}\n1.5,0,0,0,0,0,9\n", "row 2 column 't_ms': not a 24-bit number"),
        (f"{OWN}\n16777216,0,0,0,0,0,9\n", "row 2 column 't_ms': not a 24-bit number"),
        (f"{CLIENT}\n1,2,1,2,3,2\n", "row 2 columns 'gyro.x_x', 'gyro.y_x', 'gyro.z_x': the times differ"),
        (f"{GROUND}\n0,0,40.0,0.1,,0.3,\n", "row 2 column 'wy': '' is not a finite number"),
    ],
)
def test_broken_files_are_told_where(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "swing.csv"
    path.write_text(text)
    with pytest.raises(SwingFileError) as error:
        read_swing(path)
    assert words in str(error.value)
    assert str(path) in str(error.value)
    assert isinstance(error.value, InputError)


def test_no_file_and_no_gzip(tmp_path: Path) -> None:
    with pytest.raises(SwingFileError, match="No such file"):
        read_swing(tmp_path / "none.csv")
    (tmp_path / "a.csv.gz").write_bytes(b"\x1f\x8b broken")
    with pytest.raises(SwingFileError, match="cannot be read"):
        read_swing(tmp_path / "a.csv.gz")


@settings(max_examples=examples(100))
@given(
    st.sampled_from([OWN, CLIENT, GROUND, ""]),
    st.lists(
        st.lists(
            st.sampled_from(
                ["", "0", "1", "-2.5", "1e400", "nan", "x", "16777215", '"', "\x00", "\r", "40.1"]
            ),
            max_size=8,
        ),
        max_size=8,
    ),
)
def test_any_text_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, header: str, rows: list[list[str]]
) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "f.csv"
    path.write_bytes("\n".join([header, *(",".join(row) for row in rows)]).encode())
    try:
        swing = read_swing(path)
        fit_swing(swing)
    except (SwingFileError, UnusableSwingError):
        return
    assert isinstance(swing, Swing)
