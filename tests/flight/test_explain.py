"""A flight that cannot be explained, as on a full disk, costs no result, and a sentence tells it."""

import logging
from pathlib import Path

import pytest

from perchhw.flight.explain import explain


def test_a_run_that_cannot_be_explained_is_told_in_a_sentence(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        assert explain(tmp_path / "gone") is None
    (told,) = caplog.records
    assert "no diagnosis of" in told.getMessage()
    assert "gone" in told.getMessage()
    assert told.exc_info is None
