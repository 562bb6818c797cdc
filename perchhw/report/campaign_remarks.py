"""Who flew the attempts of a campaign, and what they noted."""

from collections import Counter
from collections.abc import Iterable
from html import escape
from pathlib import Path

from calibration.report_style import section, table
from onboard.record.run_record import is_run_folder, read_info


def remarks_section(records: Iterable[Path]) -> str:
    """Operators and notes of the runs in `records`, in flying order; nothing where nobody said any."""
    said: Counter[tuple[str, str]] = Counter()
    for record in filter(is_run_folder, records):
        config = read_info(record)["config"]
        said[config.get("operator") or "", config.get("note") or ""] += 1
    rows = [[escape(who), escape(what), str(n)] for (who, what), n in said.items() if who or what]
    return section("Operators and notes", table(["operator", "note", "attempts"], rows)) if rows else ""
