"""The list of tests that `make test` leaves to `make test-all`."""

from __future__ import annotations

import re
from pathlib import Path

HERE = Path(__file__).parents[1]
LISTED = [line for line in (HERE / "long.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def test_every_listed_test_exists() -> None:
    gone = [
        one
        for one in LISTED
        if (match := re.fullmatch(r"tests/(\S+\.py)::(\w+)(\[.*\])?", one)) is None
        or f"def {match[2]}(" not in (HERE / match[1]).read_text(encoding="utf-8")
    ]
    assert gone == []


def test_every_file_keeps_a_quick_test() -> None:
    """A room without any quick test would be changed without a word of warning."""
    files = {one.split("::")[0] for one in LISTED}
    alone = [name for name in files if not _quick(HERE.parent / name)]
    assert alone == []


def _quick(path: Path) -> bool:
    listed = {one.split("::")[1].split("[")[0] for one in LISTED if one.startswith(f"{path.parent.name}/{path.name}::")}
    return bool(set(re.findall(r"^def (test_\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)) - listed)
