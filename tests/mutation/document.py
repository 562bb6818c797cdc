"""What a run says: its score, and the survivors that have no reason."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from tests.mutation.allowed import Allowed, not_applicable
from tests.mutation.mutant import Key, Mutant
from tests.mutation.session import Verdict

_OUTCOMES = ("killed", "timeout", "survived", "equivalent")


def document_of(
    every: Sequence[Mutant],
    asked: Sequence[Mutant],
    verdicts: Mapping[Key, Verdict],
    allowed: Sequence[Allowed],
) -> dict[str, Any]:
    """The score, the counts by file, and what is wrong.

    Args:
        every: all mutants there are. asked: those that were tried.
        verdicts: of those, at least.
        allowed: the equivalent ones.
    """
    files = {mutant.file for mutant in every}
    stale = not_applicable(allowed, every, files)
    rows, survivors, not_equivalent = [], [], []
    for file in sorted(files):
        counts: Counter[str] = Counter()
        for mutant in (m for m in asked if m.file == file):
            verdict = verdicts[mutant.key]
            reasons = [entry.reason for entry in allowed if entry.covers(mutant)]
            survived = verdict.outcome == "survived"
            counts["equivalent" if survived and reasons else verdict.outcome] += 1
            if survived and not reasons:
                survivors.append(_shown(mutant))
            elif reasons and not survived:
                not_equivalent.append({**_shown(mutant), "noticed_by": verdict.by or verdict.outcome})
        rows.append({"file": file, **_score(counts)})
    total = Counter({key: sum(row[key] for row in rows) for key in _OUTCOMES})
    return {
        "passed": not (survivors or stale or not_equivalent),
        "mutants": len(every),
        **_score(total),
        "files": rows,
        "survivors": survivors,
        "allowed_but_noticed": not_equivalent,
        "allowed_but_gone": stale,
    }


def _score(counts: Counter[str]) -> dict[str, Any]:
    noticed = counts["killed"] + counts["timeout"]
    judged = noticed + counts["survived"]
    score = round(noticed / judged, 4) if judged else None
    return {"tried": counts.total(), **{key: counts[key] for key in _OUTCOMES}, "score": score}


def _shown(mutant: Mutant) -> dict[str, str]:
    return {
        "at": f"{mutant.file}:{mutant.line}",
        "function": mutant.function,
        "kind": mutant.kind,
        "before": mutant.before,
        "after": mutant.after,
    }
