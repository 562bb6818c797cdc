"""A session from the choice of the mutants to the document."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

# Loaded once here and shared by all the processes that are forked. Nothing of the mutated code is.
import numba  # noqa: F401
import numpy as np

from tests.mutation.allowed import load_allowed
from tests.mutation.document import document_of
from tests.mutation.mutant import Mutant
from tests.mutation.session import mutants_in, try_all
from tests.mutation.store import Store, progress, state_of
from tests.mutation.targets import targets

SOURCES = ("onboard", "mocap_bridge", "perchhw/supervisor", "tests/mutation")
"""Folders whose change makes earlier results void, beside the target's own tests."""


def run(
    names: Sequence[str], sample: int | None, seed: int, jobs: int, out: Path, *, again: bool
) -> dict[str, Any]:
    """Try all mutants, or `sample` of them, and return the document that is printed."""
    chosen = targets(names)
    every = mutants_in(chosen)
    asked = drawn(every, sample, seed)
    states = {target.file: state_of((*SOURCES, *target.tests)) for target in chosen}
    store = Store(out, states, again=again)
    open_ = [mutant for mutant in asked if mutant.key not in store.verdicts]
    with progress() as bar:
        trying = bar.add_task("mutants", total=len(asked), completed=len(asked) - len(open_))
        for tests in dict.fromkeys(target.tests for target in chosen):
            sharing = [target for target in chosen if target.tests == tests]
            files = {target.file for target in sharing}
            mutants = [mutant for mutant in open_ if mutant.file in files]
            for mutant, verdict in try_all(sharing, mutants, jobs) if mutants else ():
                store.keep(mutant, verdict)
                bar.advance(trying)
                bar.refresh()
    document = document_of(every, asked, store.verdicts, load_allowed())
    return {"seed": None if sample is None else seed, **document}


def drawn(every: list[Mutant], sample: int | None, seed: int) -> list[Mutant]:
    """All mutants, or `sample` of them, in their order."""
    if sample is None or sample >= len(every):
        return every
    picked = np.random.default_rng(seed).choice(len(every), sample, replace=False)
    return [every[at] for at in sorted(picked)]
