"""Whether two vehicles are the same in all that they say in numbers."""

import hashlib
import json
import tomllib
from typing import Any


def fingerprint(vehicle_toml: str) -> str:
    """SHA-256 of the names, numbers and units of a vehicle: another description or source does not count."""
    text = json.dumps(_without_words(tomllib.loads(vehicle_toml)), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _without_words(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_words(v) for key, v in value.items() if key not in ("source", "description")}
    return [_without_words(item) for item in value] if isinstance(value, list) else value
