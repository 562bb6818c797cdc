"""Policy files: round trip, refusals, import from the authors' format, shipped policies."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.policy.files import (
    ActionLayer,
    PolicyError,
    PolicyFileError,
    find_policy,
    import_authors_policy,
    load_policy,
    make_policy,
    policy_crc32,
    policy_document,
    save_policy,
    shipped_policies,
    shipped_policy_path,
)
from tests.onboard.policies import policies, small_policy


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("policies")


@given(policies())
def test_file_round_trip_is_exact(folder, policy):
    path = folder / "any.policy.json"
    save_policy(policy, path)
    loaded = load_policy(path)
    assert encode_bundle(loaded) == encode_bundle(policy)
    assert loaded.name == policy.name


def test_provenance_and_crc_are_kept(tmp_path):
    policy = replace(small_policy(), provenance={"seed": 3, "pairs": {"rows": 2}})
    path = tmp_path / "a.policy.json"
    save_policy(policy, path)
    assert load_policy(path).provenance == {"seed": 3, "pairs": {"rows": 2}}
    assert json.loads(path.read_text())["bundle_crc32"] == bundle_crc32(encode_bundle(policy))


def test_numbers_are_written_short():
    document = policy_document(small_policy())
    assert document["action"]["layers"][1]["weights"] == [[-0.001, 0.002]]
    assert document["action"]["a_rot_min"] == -0.0095


def test_a_policy_cannot_be_changed_in_place():
    policy = small_policy()
    with pytest.raises(ValueError, match="read-only"):
        policy.scaler_mean[0] = 1.0
    policy.compiled().scaler_mean[0] = 1.0
    assert policy.scaler_mean[0] == 0.25


def edited(tmp_path, change):
    document = json.loads(json.dumps(policy_document(small_policy())))
    change(document)
    path = tmp_path / "edited.policy.json"
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("schema"), r"schema.*perchhw\.policy/1"),
        (lambda d: d.update(schema="perchhw.policy/2"), r"perchhw\.policy/2.*newer"),
        (lambda d: d.pop("scaler"), "scaler is missing"),
        (lambda d: d["trigger"].pop("gamma"), r"trigger\.gamma is missing"),
        (lambda d: d["trigger"].update(gama=2), r"trigger\.gama is not known"),
        (lambda d: d["trigger"].update(gamma="2"), r"trigger\.gamma must be one number"),
        (lambda d: d["trigger"].update(gamma=True), r"trigger\.gamma must be one number"),
        (lambda d: d["trigger"].update(gamma=10**400), r"trigger\.gamma must be one number"),
        (lambda d: d["trigger"].update(gamma=1e60), "gamma holds inf"),
        (lambda d: d["trigger"].update(kernel="linear"), r"trigger\.kernel.*rbf"),
        (
            lambda d: d["trigger"]["support_vectors"][0].pop(),
            r"trigger\.support_vectors must be a list of rows",
        ),
        (lambda d: d["trigger"]["support_vectors"].pop(), "2 dual coefficients need"),
        (lambda d: d["trigger"]["dual_coefficients"].clear(), "0 support vectors"),
        (lambda d: d["action"].update(unit="N mm"), r"action\.unit.*N m"),
        (lambda d: d["action"].update(layers=[]), "0 action layers"),
        (lambda d: d["action"].update(layers=[1]), r"action\.layers\[0\] must be an object"),
        (lambda d: d["action"]["layers"][1].update(weights=[[1, 2, 3]]), "weights of action layer 2"),
        (lambda d: d["action"]["layers"][1].pop("bias"), r"action\.layers\[1\]\.bias is missing"),
        (lambda d: d["action"].update(a_rot_min=-9.5), r"a_rot_min \[N m\] holds -9.5"),
        (lambda d: d["scaler"]["std"].__setitem__(1, 0), "standard deviation holds 0"),
        (lambda d: d["scaler"]["std"].append(1), "three standard deviations"),
        (lambda d: d["trigger"].update(intercept=0.1), "intercept"),
        (lambda d: d["scaler"]["mean"].__setitem__(0, 0.26), "damaged or edited"),
        (lambda d: d.update(bundle_crc32="0x1"), "bundle_crc32 must be a whole number"),
        (lambda d: d.update(inputs=["tau", "of_y", "d_ceil"]), "inputs must be"),
        (lambda d: d.update(provenance=[]), "provenance must be an object"),
        (lambda d: d.update(name=None), "name must be text"),
    ],
)
def test_a_bad_file_is_refused_by_file_and_key(tmp_path, change, words):
    path = edited(tmp_path, change)
    with pytest.raises(PolicyFileError, match=words) as refusal:
        load_policy(path)
    assert str(path) in str(refusal.value)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[1]",
        b"null",
        b"\xff\xfe\x00",
        b'{"a": NaN}',
        b"[" * 100000,
        b'{"a": 1' + b"0" * 5000 + b"}",
    ],
)
def test_what_is_no_policy_file_is_refused(tmp_path, content):
    path = tmp_path / "bad.policy.json"
    path.write_bytes(content)
    with pytest.raises(PolicyFileError, match=re.escape(str(path))):
        load_policy(path)


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(),
        lambda c: st.lists(c) | st.dictionaries(st.sampled_from(["schema", "scaler", "trigger", "mean"]), c),
        max_leaves=8,
    )
)
def test_any_json_is_a_policy_or_refused(folder, content):
    path = folder / "noise.policy.json"
    path.write_text(json.dumps(content))
    with pytest.raises(PolicyError):
        load_policy(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "none.policy.json", tmp_path):
        with pytest.raises(PolicyFileError, match="cannot be read"):
            load_policy(path)
    with pytest.raises(PolicyFileError, match="cannot be written"):
        save_policy(small_policy(), tmp_path / "no" / "folder.policy.json")


def test_a_bundle_loads_as_a_policy(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(encode_bundle(small_policy()))
    assert policy_crc32(load_policy(path)) == policy_crc32(small_policy())


def test_shipped_policies_are_found_and_others_named():
    for name in shipped_policies():
        assert load_policy(shipped_policy_path(name)).layer_sizes[0] == 3
        assert find_policy(name) == shipped_policy_path(name)
    with pytest.raises(PolicyFileError, match="no-such"):
        shipped_policy_path("no-such")
    with pytest.raises(PolicyFileError, match="no-such"):
        find_policy("no-such")


def test_make_policy_gives_the_tau_range():
    policy = small_policy()
    made = make_policy(
        name="made",
        scaler_mean=policy.scaler_mean,
        scaler_std=policy.scaler_std,
        support_vectors=policy.support_vectors,
        dual_coefficients=policy.dual_coefficients,
        gamma=2.0,
        intercept=-1.0,
        layers=policy.layers,
        provenance={},
    )
    assert 0.2421875 < made.tau_min < 0.25 < made.tau_max < 0.2578125
    assert made.a_rot_min == pytest.approx(-9.56e-3, abs=1e-5)


# --- the authors' format


def authors_document():
    return {
        "inputs": ["tau [s]", "of_y = -v_x/d_ceil [1/s]", "d_ceil [m]"],
        "scaler": {"mean": [0.25, -4.0, 0.5], "std": [0.015625, 2.0, 0.25]},
        "trigger": {
            "kernel": "rbf",
            "gamma": 2.0,
            "intercept": -1.0,
            "dual_coef": [1.0, 0.5],
            "support_vectors": [[0, 0, 0], [1, 0.5, 0.25]],
        },
        "action": {
            "activation": "elu",
            "layers": [
                {"W": [[0.5, 1, 0.25], [-0.25, -0.5, 1]], "b": [0.125, -0.5]},
                {"W": [[-1, 2]], "b": [-6.5]},
            ],
        },
    }


def imported(tmp_path, document):
    path = tmp_path / "theirs.json"
    path.write_text(json.dumps(document))
    return import_authors_policy(path)


def test_import_negates_of_y_and_converts_to_newton_metres(tmp_path):
    theirs, ours = imported(tmp_path, authors_document()), small_policy()
    for name in ("scaler_mean", "scaler_std", "support_vectors", "dual_coefficients", "gamma", "intercept"):
        np.testing.assert_array_equal(getattr(theirs, name), getattr(ours, name))
    for mine, other in zip(ours.layers, theirs.layers, strict=True):
        np.testing.assert_allclose(other.weights, mine.weights, rtol=1e-6)
        np.testing.assert_allclose(other.bias, mine.bias, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.update(inputs=["tau", "theta_x", "d_ceil"]), "inputs"),
        (lambda d: d["trigger"].pop("dual_coef"), r"trigger\.dual_coef is missing"),
        (lambda d: d["trigger"].update(support_vectors=[[0, 0], [1, 1]]), r"support_vectors has 2 columns"),
        (lambda d: d["action"].update(layers=[]), r"action\.layers is empty"),
        (
            lambda d: d["action"].update(scaler={"mean": [0, 0, 0], "std": [1, 1, 1]}),
            r"action\.scaler differs",
        ),
        (lambda d: d["action"].update(activation="relu"), "relu"),
        (lambda d: d["action"]["layers"][1].update(b=[float("inf")]), "Infinity"),
        (lambda d: d["trigger"].update(intercept=-2.0), "fires nowhere"),
    ],
)
def test_a_bad_authors_policy_is_refused(tmp_path, change, words):
    document = authors_document()
    change(document)
    with pytest.raises(PolicyFileError, match=words) as refusal:
        imported(tmp_path, document)
    assert "theirs.json" in str(refusal.value)


def test_a_misplaced_authors_policy_says_how_to_import_it(shared_data):
    with pytest.raises(PolicyFileError, match="policy import"):
        load_policy(shared_data / "habas2022/policy/flown_policy.json")


def test_the_flown_policy_keeps_its_numbers(shared_data):
    policy = import_authors_policy(shared_data / "habas2022/policy/flown_policy.json")
    assert policy.layer_sizes == (3, 10, 10, 10, 1)
    assert len(policy.dual_coefficients) == 69
    np.testing.assert_allclose(policy.scaler_mean, [0.23116, 4.01815, 0.48297], rtol=1e-6)
    assert policy.intercept == np.float32(-1.36515)
    assert len(encode_bundle(policy)) == 2276


def test_non_rectangular_layers_are_refused():
    with pytest.raises(PolicyError, match="layer weights"):
        ActionLayer([[1.0, 2.0], [3.0]], [0.0])
