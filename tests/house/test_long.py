"""The list of tests that `make test` leaves to `make test-all`. `conftest.py` asks that its lines name tests."""

from __future__ import annotations

import re
from pathlib import Path

HERE = Path(__file__).parents[1]
LISTED = [line for line in (HERE / "long.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def test_every_file_keeps_a_quick_test() -> None:
    """Or it is listed as a whole, which somebody did who saw that others of the same thing are quick."""
    files = {one.split("::")[0] for one in LISTED if "::" in one}
    alone = [name for name in files if not _quick(HERE.parent / name)]
    assert alone == []


def _quick(path: Path) -> bool:
    at = f"tests/{path.parent.name}/{path.name}::"
    listed = {one.removeprefix(at) for one in LISTED if one.startswith(at) and "[" not in one}
    return bool(set(re.findall(r"^def (test_\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)) - listed)
