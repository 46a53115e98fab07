"""One controller per bench: a lock for every address, under any of its names.

A lock is a name in the kernel (an abstract Unix socket), not a file. It is one for all users of the machine; no folder
or link can interfere; it disappears with its process in any case; and the kernel reports its holder
(docs/decisions/0012-locks.md). The lock is on the wire: two units on one Modbus line are one wire, and a device is one
device under all its names.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import ipaddress
import os
import re
import socket
import stat
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from rig.errors import BusyError

_COM = re.compile(r"COM\d+", re.IGNORECASE)
_THIS = "127.0.0.1"
_LOOPBACK = {"localhost", "localhost.localdomain"}


class Addressed(Protocol):
    """Objects with an address, such as instruments of a bench file."""

    @property
    def address(self) -> str:
        """The address in the bench file."""
        ...


@contextlib.contextmanager
def locked_addresses(instruments: Mapping[str, Addressed]) -> Iterator[None]:
    """Hold a lock for every address of a bench. Raises `BusyError` if another controller has one."""
    with contextlib.ExitStack() as held:
        for wire, (name, address) in sorted(_wires(instruments).items()):
            held.enter_context(_lock(wire, name, address))
        yield


def holders(instruments: Mapping[str, Addressed]) -> dict[str, str]:
    """Present holders of a bench's addresses, by instrument name; {} if none. Takes no lock and sends nothing.

    A command that uses the instruments must still take `locked_addresses`: this is only for display.
    """
    told = {name: _holder(wire) for wire, (name, _) in _wires(instruments).items()}
    return {name: holder for name, holder in told.items() if holder}


def _wires(instruments: Mapping[str, Addressed]) -> dict[str, tuple[str, str]]:
    """Each wire once, with its first instrument and its address."""
    found: dict[str, tuple[str, str]] = {}
    for name, instrument in instruments.items():
        if not instrument.address:  # a person
            continue
        found.setdefault(wire_of(instrument.address), (name, instrument.address))
    return found


def wire_of(address: str) -> str:
    """Name of the lock of an address: the same text for every name of the same wire."""
    from rig.drivers.errors import WrongAddress  # noqa: PLC0415 - imports the wires, which few commands need
    from rig.drivers.wires.addresses import CanAddress, parse_address  # noqa: PLC0415
    from rig.drivers.wires.visa_address import VisaAddress  # noqa: PLC0415

    try:
        found = parse_address(address)
    except WrongAddress:  # nothing opens it
        return address
    if found.device is not None:
        return _device(found.device)
    if isinstance(found, CanAddress):
        return f"can:{found.interface}/{found.channel}"
    if isinstance(found, VisaAddress) and found.messages:
        return found.lock
    if found.host is None:
        return address
    # A host and port is one instrument, for every protocol.
    return f"tcp:{_host(found.host.host)}:{found.host.port}"


def _host(name: str) -> str:
    """A host by one name: this machine has several. Nothing is sent, and no name server is asked."""
    host = name.lower().strip("[]").rstrip(".")
    own = socket.gethostname().lower()
    if host in _LOOPBACK or host in (own, own.partition(".")[0]) or host.endswith(".localhost"):
        return _THIS
    try:
        address = ipaddress.ip_address(_hosts().get(host, host))
    except ValueError:
        return host
    return _THIS if address.is_loopback or address.is_unspecified or _is_ours(address) else str(address)


def _is_ours(address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
    """Whether an interface of this machine has this address: only then a socket can be bound to it."""
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as asking:
            asking.bind((str(address), 0))
    except OSError:
        return False
    return True


def _hosts() -> dict[str, str]:
    """Addresses of the names in the machine's own list."""
    found: dict[str, str] = {}
    with contextlib.suppress(OSError, UnicodeDecodeError):
        for line in Path("/etc/hosts").read_text(encoding="utf-8").splitlines():
            address, *names = line.partition("#")[0].lower().split() or [""]
            for name in names:
                found.setdefault(name, address)
    return found


def _device(path: str) -> str:
    """A device file by its numbers, which are the same under all its names; a missing one by its path."""
    if _COM.fullmatch(path):
        return path.upper()
    real = os.path.realpath(path)
    with contextlib.suppress(OSError):
        status = os.stat(real)
        if stat.S_ISCHR(status.st_mode):
            return f"device:{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}"
    return real


_NAME = "\0calibration-rig/"
"""Prefix of our names: Linux keeps one list for all users of a machine (of a network namespace)."""
_ASKED = 128
"""Maximum number of pending questions about the holder of a lock; more get no answer."""


def _name(wire: str) -> str:
    return _NAME + hashlib.sha256(wire.encode()).hexdigest()[:32]


def _lock(wire: str, name: str, address: str) -> socket.socket:
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        lock.bind(_name(wire))
        lock.listen(_ASKED)
    except OSError as error:
        lock.close()
        if error.errno != errno.EADDRINUSE:
            raise BusyError(
                f"{name}: {address} cannot be locked against a second controller ({error}); nothing was sent. Unix "
                f"sockets have to be allowed here: check the restrictions of this process (systemd, container)"
            ) from error
        raise BusyError(
            f"{name}: {address} is in use by another controller of this machine ({_holder(wire)}); nothing was sent. "
            f"Stop that one first: `rig stop RUN`, or end the process"
        ) from None
    return lock


def _holder(wire: str) -> str:
    """Holder of a wire, by the kernel; "" if there is none."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.setblocking(False)
        try:
            asking.connect(_name(wire))
        except BlockingIOError:
            return "it does not say which process it is"
        except OSError:
            return ""
        told = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    pid, uid, _ = struct.unpack("3i", told)
    command = ""
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_bytes()[:500].split(b"\0")
        command = " ".join(word.decode(errors="replace") for word in words).strip()
    command = "".join(c if c.isprintable() else "?" for c in command)
    return f"process {pid} of user {uid}" + (f", {command}" if command else "")
