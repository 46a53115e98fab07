"""What the doctor says: one finding a check, with what to do next."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

Level = Literal["ok", "warning", "problem"]


@dataclass(frozen=True)
class Finding:
    """The outcome of one check.

    Attributes:
        level: "ok"; "warning": the night can go on, but; "problem": mend it before the night.
        check: what was looked at.
        found: what was found.
        next_step: what to do, "" if nothing.
        exit_code: what `rig doctor` ends with if this is the worst it finds.

    """

    level: Level
    check: str
    found: str
    next_step: str = ""
    exit_code: int = 0

    def as_json(self) -> dict[str, str]:
        """The finding as a plain table."""
        return {key: str(value) for key, value in asdict(self).items() if key != "exit_code"}


def ok(check: str, found: str) -> Finding:
    """All is well."""
    return Finding("ok", check, found)


def warning(check: str, found: str, next_step: str) -> Finding:
    """The night can go on, but."""
    return Finding("warning", check, found, next_step)


def problem(check: str, found: str, next_step: str, exit_code: int = 1) -> Finding:
    """To be mended before the night."""
    return Finding("problem", check, found, next_step, exit_code)
