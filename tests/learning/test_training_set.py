"""Reading sensory-motor pairs."""

import numpy as np
import pytest

from perchhw.learning.training_set import TrainingSetError, load_training_set

HEADER = "speed_m_s,angle_deg,trial,tau,theta_x,d_ceil,a_rot,landing_rate,four_leg_rate"
GOOD = "2.5,45,0,0.23,4.0,0.4,-0.0065,0.9,0.7"


def table(tmp_path, *rows, header=HEADER):
    path = tmp_path / "pairs.csv"
    path.write_text("\n".join((header, *rows)) + "\n")
    return path


def test_our_table(tmp_path):
    pairs = load_training_set(
        table(tmp_path, GOOD, "2.5,45,1,,,,,0.1,0.0", "2.5,45,2,0.2,1,0.5,-0.005,0.8,0.8")
    )
    np.testing.assert_allclose(pairs.states, [[0.23, 4.0, 0.4], [0.2, 1.0, 0.5]])
    np.testing.assert_allclose(pairs.a_rot, [-0.0065, -0.005])
    assert pairs.source["rows"] == 3
    assert pairs.source["pairs"] == 2


def test_the_rate_that_decides_can_be_chosen(tmp_path):
    path = table(tmp_path, GOOD, "2.5,45,2,0.2,1,0.5,-0.005,0.8,0.8")
    assert len(load_training_set(path, rate_column="four_leg_rate").a_rot) == 1
    assert len(load_training_set(path, landing_rate_min=0.85).a_rot) == 1


def test_each_condition_teaches_what_is_best_there(tmp_path):
    rows = ["2.5,45,0,0.23,4.0,0.4,-0.006,0.9,0.7", "2.5,45,1,0.2,4.0,0.4,-0.005,0.5,0.5"]
    rows += ["1.5,80,0,0.25,1.0,0.3,-0.007,0.4,0.4", "1.5,80,1,0.24,1.0,0.3,-0.008,0.3,0.3"]
    pairs = load_training_set(table(tmp_path, *rows), landing_rate_min=0.25, share_of_best=0.8)
    np.testing.assert_allclose(pairs.landing_rate, [0.9, 0.4])
    assert pairs.source["share_of_best"] == 0.8


def test_the_authors_table(shared_data):
    pairs = load_training_set(shared_data / "habas2022/policy/training_set_NL.csv")
    assert pairs.source["rows"] == 1046
    assert len(pairs.a_rot) == 307
    assert pairs.source["rows_with_implausible_angle"] == 1
    # Ranges of the 307 rows, in our signs and units (notes on the authors' data, section 3).
    np.testing.assert_allclose(pairs.states.min(axis=0), [0.206, -0.013, 0.147], atol=1e-3)
    np.testing.assert_allclose(pairs.states.max(axis=0), [0.278, 9.77, 0.916], atol=1e-3)
    np.testing.assert_allclose([pairs.a_rot.min(), pairs.a_rot.max()], [-9.61e-3, -2.86e-3], atol=5e-6)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("2.5,45,0,,4,0.4,-0.0065,0.9,0", "row 3 column 'tau': '' is not a finite"),
        ("2.5,45,0,x,4,0.4,-0.0065,0.9,0", "row 3 column 'tau': 'x' is not a number"),
        ("2.5,45,0,nan,4,0.4,-0.0065,0.9,0", "row 3 column 'tau': 'nan' is not a finite"),
        ("2.5,45,0,0,4,0.4,-0.0065,0.9,0", "row 3 column 'tau': 0 must be above 0"),
        ("2.5,45,0,0.2,4,-0.4,-0.0065,0.9,0", "row 3 column 'd_ceil'"),
        ("2.5,45,0,0.2,4,0.4,0.0065,0.9,0", "row 3 column 'a_rot': 0.0065 must be negative"),
        ("2.5,45,0,0.2,4,0.4,-0.0065,90,0", "row 3 column 'landing_rate': 90 is not a rate"),
        ("2.5,45,0,0.2,4,0.4,-0.0065,,0", "row 3 column 'landing_rate'"),
        ("2.5,45", "row 3: 2 cells"),
        ("2.5,steep,0,0.2,4,0.4,-0.0065,0.9,0", "row 3 column 'angle_deg': 'steep'"),
    ],
)
def test_a_bad_row_is_named(tmp_path, row, words):
    with pytest.raises(TrainingSetError, match=words):
        load_training_set(table(tmp_path, GOOD, row))


def test_a_bad_table_is_refused(tmp_path):
    with pytest.raises(TrainingSetError, match="no column 'd_ceil'"):
        load_training_set(table(tmp_path, GOOD, header=HEADER.replace("d_ceil", "distance")))
    with pytest.raises(TrainingSetError, match="has no rows"):
        load_training_set(table(tmp_path))
    with pytest.raises(TrainingSetError, match=r"no row has landing_rate >= 0.95"):
        load_training_set(table(tmp_path, GOOD), landing_rate_min=0.95)
    with pytest.raises(TrainingSetError, match="check the path"):
        load_training_set(tmp_path / "none.csv")
