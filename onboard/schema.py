"""The version that every file of ours carries: ``schema = "perchhw.KIND/NUMBER"``, and who may read it.

A file of an older version would be migrated here; there is none yet, so every other version is refused by its
name. A file without one is none of ours.
"""

import re

RUN_SCHEMA = "perchhw.run/1"
"""Of a recorded run: here, since both who plays its poses and who reads all of it ask for it."""
_SCHEMA = re.compile(r"perchhw\.(?P<kind>[a-z_-]+)/(?P<number>[0-9]{1,9})")


def schema_problem(found: object, wanted: str) -> str | None:
    """What is wrong with the schema of a file that is to be read as `wanted`, or None.

    Args:
        found: what the file says under ``schema``; None where it says nothing.
        wanted: what this program reads, as ``perchhw.lab/1``.

    Returns:
        In words that follow the name of the file and of its key.
    """
    if found == wanted:
        return None
    if found is None:
        return f'is missing; a file of this kind says "{wanted}"'
    ours = _SCHEMA.fullmatch(wanted)
    theirs = _SCHEMA.fullmatch(found) if isinstance(found, str) else None
    if theirs is None or ours is None:
        return f'is {found!r}, and must be "{wanted}"'
    if theirs["kind"] != ours["kind"]:
        return f'is "{found}", a file of another kind; give one of "{wanted}"'
    if int(theirs["number"]) > int(ours["number"]):
        return f'is "{found}", newer than this perchhw, which reads "{wanted}": update perchhw'
    return (
        f'is "{found}", older than what this perchhw reads ("{wanted}"), and nothing migrates it: '
        "read it with the perchhw that wrote it, or make it anew"
    )
