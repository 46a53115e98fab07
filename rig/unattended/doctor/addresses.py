"""Addresses of a bench: checks that each device exists, may be opened, and is free."""

from __future__ import annotations

import grp
import os
import pwd
import re
import socket
import stat
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path

from rig.bench.config import InstrumentConfig
from rig.drivers.errors import WrongAddress
from rig.drivers.wires.addresses import CanAddress, parse_address
from rig.drivers.wires.visa_address import VisaAddress
from rig.unattended.doctor.findings import Finding, ok, problem, warning

_RAW_NAME = re.compile(r"/dev/tty(USB|ACM)\d+$")


def check_addresses(instruments: Mapping[str, InstrumentConfig]) -> Iterator[tuple[str, Finding]]:
    """Pairs (name, finding) for every instrument; nothing is opened."""
    holders = _holders()
    for name, instrument in instruments.items():
        if instrument.address:
            yield name, _check(f"address of {name}", instrument.address, holders)


def _check(check: str, address: str, holders: Mapping[str, str]) -> Finding:
    try:
        found = parse_address(address)
    except WrongAddress as error:
        return problem(check, str(error), "correct the address in the bench file")
    if found.device is not None:
        return _check_device(check, Path(found.device), holders)
    if isinstance(found, CanAddress) and found.interface == "socketcan":
        return _check_can(check, found.channel)
    if isinstance(found, VisaAddress) and not all(map(find_spec, ("pyvisa", "pyvisa_py"))):
        return _check_visa(check, address)
    if found.host is not None:
        return _check_host(check, address, found.host.host)
    return ok(check, address)


def _check_device(check: str, device: Path, holders: Mapping[str, str]) -> Finding:
    try:
        found = device.stat()
    except FileNotFoundError:
        return problem(check, f"{device} does not exist", _where_else(device))
    except OSError as error:
        return problem(check, f"{device}: {error.strerror}", "ask the administrator of this machine")
    if not stat.S_ISCHR(found.st_mode):
        return problem(check, f"{device} is not a device", "correct the address in the bench file")
    if not os.access(device, os.R_OK | os.W_OK):
        return problem(check, f"{device} may not be opened by {_me()}", _how_to_be_let_in(found))
    holder = holders.get(os.path.realpath(device))
    if holder is not None:
        return problem(check, f"{device} is open in {holder}", "end that program before the run")
    if _RAW_NAME.search(str(device)):
        next_step = f"name it by {_by_id(device)}, or by a udev rule (docs/how_to/unattended.md)"
        return warning(check, f"{device} exists; its number changes when cables are moved", next_step)
    real = os.path.realpath(device)
    return ok(check, str(device) if real == str(device) else f"{device} -> {real}")


def serial_ports() -> list[str]:
    """Serial ports that are present, by names that stay if there are any; nothing is opened."""
    links = sorted(Path("/dev/serial/by-id").glob("*")) if Path("/dev/serial/by-id").is_dir() else []
    return [str(p) for p in links] or sorted(str(p) for p in Path("/dev").glob("tty[UA][SC][BM]*"))


def _where_else(device: Path) -> str:
    ports = serial_ports()
    present = f"serial ports present: {', '.join(ports[:6])}" if ports else "no USB serial port is present"
    rule = "; a udev rule makes the name (docs/how_to/unattended.md)" if str(device).startswith("/dev/rig/") else ""
    return f"switch it on and connect it, or correct the address; {present}{rule}"


def _how_to_be_let_in(found: os.stat_result) -> str:
    try:
        group = grp.getgrgid(found.st_gid)
    except KeyError:
        return f"it belongs to group {found.st_gid}, which has no name here: give it one, or set it by a udev rule"
    if group.gr_gid in os.getgroups() or not found.st_mode & stat.S_IWGRP:
        return 'give its group the right to read and write: udev rule MODE="0660"'
    if _me() in group.gr_mem:
        return f"{_me()} is in group {group.gr_name} since the last login: log out and in again"
    if group.gr_gid == 0:
        return 'a udev rule with GROUP="dialout", MODE="0660" (docs/how_to/unattended.md)'
    return f"sudo usermod -aG {group.gr_name} {_me()}; then log out and in again"


def _me() -> str:
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return str(os.geteuid())


def _by_id(device: Path) -> str:
    folder = Path("/dev/serial/by-id")
    if folder.is_dir():
        for link in folder.iterdir():
            if os.path.realpath(link) == os.path.realpath(device):
                return str(link)
    return "/dev/serial/by-id/..."


def _check_can(check: str, interface: str) -> Finding:
    folder = Path("/sys/class/net") / interface
    up = f"sudo ip link set {interface} up type can bitrate 500000 (the bus's own bit rate)"
    if not folder.is_dir():
        return problem(check, f"there is no CAN interface {interface}", f"connect the adapter; {up}")
    try:
        flags = int((folder / "flags").read_text(encoding="ascii"), 16)
    except (OSError, ValueError):
        return warning(check, f"the state of {interface} cannot be read", "ip -details link")
    return ok(check, f"{interface} is up") if flags & 1 else problem(check, f"{interface} is down", up)


def _check_visa(check: str, address: str) -> Finding:
    """Check the libraries that a VISA address needs."""
    extra = "pip install 'calibration-rig[visa]'"
    if find_spec("pyvisa") is None:
        return problem(check, f"{address} needs pyvisa, which is not installed", extra)
    return ok(check, f"{address}, through a maker's VISA library if there is one: pyvisa-py is not installed ({extra})")


def _check_host(check: str, address: str, host: str) -> Finding:
    try:
        found = {str(info[4][0]) for info in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)}
    except OSError as error:
        return problem(check, f"{host} is not known: {error.strerror}", "correct the name, or check the network")
    known = host if host in found else f"{host} is {', '.join(sorted(found))}"
    return ok(check, f"{address} ({known})" if known != host else address)


def _holders() -> dict[str, str]:
    """Open device files of processes, as far as this user may see them, with the process's name and number."""
    held: dict[str, str] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        if folder.name == str(os.getpid()):
            continue
        try:
            links = [os.readlink(link) for link in (folder / "fd").iterdir()]
            devices = [link for link in links if link.startswith("/dev/tty")]
            if devices:
                command = (folder / "comm").read_text(encoding="utf-8", errors="replace").strip()
                held |= dict.fromkeys(devices, f"{command} (process {folder.name})")
        except OSError:
            continue
    return held
