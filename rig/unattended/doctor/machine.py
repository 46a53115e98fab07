"""The machine: sleep, automatic restarts, battery; and its software."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
from collections.abc import Iterator
from pathlib import Path

from rig.unattended.doctor.findings import Finding, ok, problem, warning
from rig.version import versions


def check_power(root: Path = Path("/")) -> Iterator[Finding]:
    """Findings about sleep, battery and restarts, from system files; `root` is the folder of these files."""
    yield _sleep(root)
    yield from _battery(root)
    if _restarts_by_itself(root):
        advice = "a service continues the run (rig service); better, disable the restart: Automatic-Reboot false"
        yield warning("restarts", "automatic updates may restart the machine", advice)


def _sleep(root: Path) -> Finding:
    check = "sleep"
    states = _read(root / "sys/power/state").split()
    if not {"mem", "freeze", "standby", "disk"} & set(states):
        return ok(check, "this machine cannot sleep")
    target = root / "etc/systemd/system/sleep.target"
    if target.is_symlink() and os.readlink(target) == "/dev/null":
        return ok(check, "sleep is switched off (sleep.target is masked)")
    advice = (
        "sudo systemctl mask sleep.target; or start with: systemd-inhibit --what=sleep:idle:handle-lid-switch rig ..."
    )
    idle = re.search(r"(?m)^\s*IdleAction\s*=\s*(\w+)", _read(root / "etc/systemd/logind.conf"))
    if idle and idle[1] not in ("ignore", "lock"):
        return problem(check, f"when idle, the machine is told to {idle[1]} (logind.conf)", advice)
    if (root / "proc/acpi/button/lid").is_dir():
        return warning(check, "a laptop: closing the lid, or its desktop when idle, may put it to sleep", advice)
    return warning(check, "the machine can sleep, and its desktop may put it to sleep when idle", advice)


def _battery(root: Path) -> Iterator[Finding]:
    supplies = root / "sys/class/power_supply"
    for supply in sorted(supplies.glob("*")) if supplies.is_dir() else ():
        if _read(supply / "type").strip() == "Battery" and _read(supply / "scope").strip() != "Device":
            state = _read(supply / "status").strip()
            if state == "Discharging":
                charge = _read(supply / "capacity").strip()
                yield problem("power", f"on battery ({charge} %)", "connect mains power")
            else:
                yield ok("power", f"battery {state.lower()}, on mains power")


def _restarts_by_itself(root: Path) -> bool:
    folder = root / "etc/apt/apt.conf.d"
    texts = [_read(path) for path in sorted(folder.glob("*"))] if folder.is_dir() else []
    found = [m for text in texts for m in re.findall(r'(?m)^\s*Unattended-Upgrade::Automatic-Reboot\s+"(\w+)"', text)]
    return bool(found) and found[-1].lower() in ("true", "1", "yes")


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def check_software() -> Iterator[Finding]:
    """Findings about Python, SQLite and the numerical libraries."""
    known = versions()
    yield ok("python", f"{platform.python_version()} on {platform.system()} {platform.release()}")
    yield check_sqlite(known["sqlite"])
    parts = [f"calibration-rig {known['calibration-rig']}", f"numpy {known['numpy']}"]
    missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        yield problem("libraries", f"missing: {', '.join(missing)}", "pip install -c constraints.txt .")
    else:
        yield ok("libraries", ", ".join(parts))


_NEEDED = (
    "scipy",
    "pydantic",
    "serial",
    "pymodbus",
    "can",
    "canopen",
    "cantools",
    "transitions",
    "matplotlib",
    "jinja2",
)
_MENDED = {(3, 44): 6, (3, 50): 7, (3, 51): 3}
"""Release lines of SQLite and the release of each that corrected the WAL-reset bug; it is corrected in all from 3.52
on."""


def check_sqlite(version: str) -> Finding:
    """Whether the SQLite that ships with apsw has the WAL-reset bug (sqlite.org/wal.html#walresetbug)."""
    major, minor, patch = (int(part) for part in (*version.split("."), "0", "0")[:3])
    mended = (major, minor) >= (3, 52) or patch >= _MENDED.get((major, minor), 1 << 30)
    if mended:
        return ok("sqlite", version)
    return problem(
        "sqlite",
        f"{version} has the WAL-reset bug, which can lose committed records (3.7.0 to 3.51.2)",
        "pip install --upgrade apsw",
    )
