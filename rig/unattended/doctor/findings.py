"""Findings of `rig doctor`: one per check, with the next step."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

Level = Literal["ok", "warning", "problem"]


@dataclass(frozen=True)
class Finding:
    """The outcome of one check.

    Attributes:
        level: "ok"; "warning": the run can start; "problem": repair it before the run.
        check: the subject of the check.
        found: the result.
        next_step: what to do, "" if nothing.
        exit_code: exit code of `rig doctor` if this is the most severe finding.

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
    """A finding of level "warning": the run can start."""
    return Finding("warning", check, found, next_step)


def problem(check: str, found: str, next_step: str, exit_code: int = 1) -> Finding:
    """A finding of level "problem": to be repaired before the run."""
    return Finding("problem", check, found, next_step, exit_code)
