"""Texts for the states and error codes of a CiA 402 drive."""

from __future__ import annotations

_STATES = {
    "not ready": (0x4F, 0x00),
    "disabled": (0x4F, 0x40),
    "ready": (0x6F, 0x21),
    "switched on": (0x6F, 0x23),
    "enabled": (0x6F, 0x27),
    "quick stop": (0x6F, 0x07),
    "stopping for a fault": (0x4F, 0x0F),
    "fault": (0x4F, 0x08),
}
"""State by (mask, value) of the statusword."""

_ERRORS = {
    0x2310: "continuous overcurrent",
    0x3210: "DC link overvoltage",
    0x3220: "DC link undervoltage",
    0x4310: "drive overtemperature",
    0x7305: "encoder signal",
    0x8130: "heartbeat lost",
    0x8611: "following error",
}


def state_of(status: int) -> str:
    """The state in a statusword."""
    return next((name for name, (mask, value) in _STATES.items() if status & mask == value), f"unknown ({status:04X}h)")


def error_text(code: int) -> str:
    """An error code (603Fh) as text."""
    return f"{_ERRORS.get(code, 'see the drive manual')} (error {code:04X}h)"
