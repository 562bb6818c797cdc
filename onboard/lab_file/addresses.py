"""The addresses of the drones of a lab file, whatever else is wrong with it: a stop asks no more."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from onboard.lab_file.model import SCHEMA, LabFileError
from onboard.schema import schema_problem
from onboard.toml_file import read_toml

_ADDRESS = re.compile(r"""(?<![\w+-])(?:udp|radio|usb)://[^\s"'`,;<>()\[\]{}#]+""")
_COMMENT = re.compile(r"^[ \t]*#.*$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class DroneAddresses:
    """What was found.

    Attributes:
        uris: every address once, in the order of the file.
        doubt: why they were looked for in the text of the file instead of in its tables; empty: they were
            not.
    """

    uris: list[str]
    doubt: str


def drone_addresses(path: Path) -> DroneAddresses:
    """Find the drones of a lab file: in its tables, or, where these do not tell all, anywhere in its text.

    Raises:
        LabFileError: the file cannot be read, or there is no address in it.
    """
    doubt = ""
    uris: list[str] = []
    try:
        text = path.read_bytes().decode("latin-1")
        content = read_toml(path, LabFileError)
    except OSError as problem:
        raise LabFileError(f"{path}: cannot be read ({problem.strerror}); check the path") from problem
    except LabFileError as problem:
        doubt = str(problem)
    else:
        tables = content.get("drones")
        rows = tables if isinstance(tables, list) else [None]
        uris = [row["uri"] for row in rows if isinstance(row, Mapping) and isinstance(row.get("uri"), str)]
        if len(uris) < len(rows):
            doubt = f"{path}: drones: has a drone without a uri"
        elif "schema" in content and (wrong := schema_problem(content["schema"], SCHEMA)) is not None:
            doubt = f"{path}: schema: {wrong}"  # which may have named drones elsewhere
    if doubt:
        uris += _in_text(text)
    if not uris:
        raise LabFileError(
            f"{doubt or f'{path}: drones: is empty'}; no address of a drone was found in it: "
            "add [[drones]] with uri, or give --drone"
        )
    return DroneAddresses(list(dict.fromkeys(uris)), doubt)


def _in_text(text: str) -> list[str]:
    """Whatever looks like an address of a drone, but for lines that are comments. A file of two bytes a
    character reads like one of one with zeros between."""
    return _ADDRESS.findall(_COMMENT.sub("", text.replace("\0", "")))
