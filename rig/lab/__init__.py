"""A laboratory: its people, its log of changes, and what they approved.

The public face: `laboratory_of` a file, and the `Laboratory` with its people and its log.
"""

from rig.lab.laboratory import Laboratory, Log, differences, laboratory_in, laboratory_of
from rig.lab.masked import without_secrets
from rig.lab.people import (
    People,
    Person,
    WrongPassword,
    by_passkey,
    by_password,
    by_token,
    check_role,
    proven,
)

__all__ = [
    "Laboratory",
    "Log",
    "People",
    "Person",
    "WrongPassword",
    "by_passkey",
    "by_password",
    "by_token",
    "check_role",
    "differences",
    "laboratory_in",
    "laboratory_of",
    "proven",
    "without_secrets",
]
