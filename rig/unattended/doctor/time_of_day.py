"""The machine's clock: checks that UTC is plausible and synchronised, and whether local time changes during the run."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from rig.unattended.doctor.findings import Finding, ok, problem, warning

_BUILT = datetime(2025, 1, 1, tzinfo=UTC).timestamp()
_FAR = datetime(2100, 1, 1, tzinfo=UTC).timestamp()
_UNSYNCHRONISED = 0x40  # STA_UNSYNC of <sys/timex.h>
_STEP_S = 900.0  # clocks change only at quarters of an hour, everywhere on Earth


def check_clock(now_s: float, end_s: float | None, newest_s: float | None) -> Iterator[Finding]:
    """Findings about time.

    Args:
        now_s: UTC, seconds since 1970-01-01.
        end_s: expected end of the run, None if unknown.
        newest_s: UTC of the newest record of the run or the newest file, which cannot be later than now.

    """
    yield _sane(now_s, newest_s)
    yield _in_step()
    yield from _zone(now_s, end_s)
    if _rtc_is_local():
        advice = "timedatectl set-local-rtc 0: after a restart UTC may be off by hours, and gaps are measured by it"
        yield warning("clock: at power-on", "the machine's own clock keeps local time", advice)


def _sane(now_s: float, newest_s: float | None) -> Finding:
    text = f"{datetime.fromtimestamp(now_s, UTC):%Y-%m-%d %H:%M:%S} UTC"
    if not _BUILT < now_s < _FAR:
        return problem("clock: UTC", f"{text} cannot be", "set the clock: timedatectl set-ntp true")
    if newest_s is not None and now_s < newest_s - 60.0:
        newest = f"{datetime.fromtimestamp(newest_s, UTC):%Y-%m-%d %H:%M} UTC"
        return problem("clock: UTC", f"{text}, but there are records of {newest}", "set the clock")
    return ok("clock: UTC", text)


class _Timex(ctypes.Structure):
    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 512),
    )


def synchronised() -> bool | None:
    """Whether the kernel's clock is kept in step by a time service; None where the system does not say."""
    try:
        adjtimex = ctypes.CDLL(None, use_errno=True).adjtimex
    except (OSError, AttributeError):
        return None
    told = _Timex()
    state = adjtimex(ctypes.byref(told))
    return None if state < 0 else not told.status & _UNSYNCHRONISED


def _in_step() -> Finding:
    match synchronised():
        case True:
            return ok("clock: in step", "kept in step by a time service")
        case False:
            advice = "timedatectl set-ntp true (or chrony): durations do not need it, dates on certificates do"
            return warning("clock: in step", "no time service synchronises it", advice)
        case _:
            return ok("clock: in step", "cannot be told here")


def _zone(now_s: float, end_s: float | None) -> Iterator[Finding]:
    zone = datetime.fromtimestamp(now_s, UTC).astimezone().tzname() or "local time"
    if end_s is None:
        yield ok("clock: time zone", f"{zone}; the run itself knows UTC only")
        return
    changes = list(zone_changes(now_s, end_s))
    if not changes:
        yield ok("clock: time zone", f"{zone}; clocks do not change during the run")
    for change in changes:
        old = datetime.fromtimestamp(change - 1, UTC).astimezone().tzinfo
        before, after = datetime.fromtimestamp(change, old), datetime.fromtimestamp(change, UTC).astimezone()
        text = (
            f"clocks go from {before:%H:%M} {before.tzname()} to {after:%H:%M} {after.tzname()} on {before:%Y-%m-%d}, "
            f"during the run: harmless, for it counts seconds and dates in UTC"
        )
        yield ok("clock: time zone", text)


def zone_changes(start_s: float, end_s: float) -> Iterator[float]:
    """UTC seconds at which local time changes its offset."""
    at = start_s - start_s % _STEP_S
    offset = _offset(at)
    while at < min(end_s, start_s + 100 * 86400.0):
        at += _STEP_S
        if (now := _offset(at)) != offset:
            yield at
            offset = now


def _offset(utc_s: float) -> float:
    offset = datetime.fromtimestamp(utc_s, UTC).astimezone().utcoffset()
    return offset.total_seconds() if offset is not None else 0.0


def _rtc_is_local() -> bool:
    try:
        lines = Path("/etc/adjtime").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return False
    return len(lines) > 2 and lines[2].strip() == "LOCAL" and os.path.exists("/dev/rtc0")
