"""Hashes of the content of a calibration file, for each of its keys: what was changed since it was written is named."""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

KEY = "sha256"
NOT_CHECKED = (
    "the calibration file has no hash of its content (it is from an older version, or was not written by `rig fit "
    "--out`): whether it was changed since is not checked"
)


def with_hashes(told: Mapping[str, Any]) -> dict[str, Any]:
    """JSON values of a calibration with the hash of each of them, under `KEY`."""
    plain = {name: value for name, value in told.items() if name != KEY}
    return {**plain, KEY: _hashes(json.loads(json.dumps(plain)))}


def changed(given: Mapping[str, Any]) -> list[str]:
    """Keys that are not as they were written, or are missing, or new; [] if there are none, or no hashes."""
    known, now = given.get(KEY), _hashes(given)
    if known is None:
        return []
    if not isinstance(known, Mapping):
        return [KEY]
    return [name for name in dict.fromkeys([*known, *now]) if known.get(name) != now.get(name)]


def _hashes(told: Mapping[str, Any]) -> dict[str, str]:
    return {name: _hash(value) for name, value in told.items() if name != KEY}


def _hash(value: Any) -> str:
    canonical = json.dumps(value, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return sha256(canonical.encode()).hexdigest()
