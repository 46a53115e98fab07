"""One controller a bench: a lock for every address, whatever it is called.

The locks are files named after the address in a folder all users of the machine share, since the address itself may
be a host and port, and a lock taken on a device file would not be seen by network users of it. What is locked is the
wire: two units on one Modbus line are one wire, and a device is one device under all its names.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Protocol

from rig.errors import BusyError

_COM = re.compile(r"COM\d+", re.IGNORECASE)
_LOOPBACK = {"localhost": "127.0.0.1", "::1": "127.0.0.1", "localhost.localdomain": "127.0.0.1"}


class Addressed(Protocol):
    """What has an address, as the instruments of a bench file."""

    @property
    def address(self) -> str:
        """As in the bench file."""
        ...


@contextlib.contextmanager
def locked_addresses(instruments: Mapping[str, Addressed]) -> Iterator[None]:
    """Hold a lock for every address of a bench; raises `BusyError` if another controller has one."""
    held: list[int] = []
    try:
        for wire, (name, address) in sorted(_wires(instruments).items()):
            held.append(_lock(_path(wire), name, address))
        yield
    finally:
        for descriptor in held:
            os.close(descriptor)


def holders(instruments: Mapping[str, Addressed]) -> dict[str, str]:
    """Who has a bench's addresses at this moment, by instrument name; {} if nobody. Takes no lock and asks nothing.

    Whoever wants to talk to the instruments takes `locked_addresses` all the same: this is for telling.
    """
    found = {}
    for wire, (name, _) in _wires(instruments).items():
        path = _path(wire)
        with contextlib.suppress(OSError):
            descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except OSError:
                found[name] = _told(descriptor)
            finally:
                os.close(descriptor)
    return found


def _wires(instruments: Mapping[str, Addressed]) -> dict[str, tuple[str, str]]:
    """Each wire once, with the first instrument on it and its address."""
    found: dict[str, tuple[str, str]] = {}
    for name, instrument in instruments.items():
        found.setdefault(wire_of(instrument.address), (name, instrument.address))
    return found


def wire_of(address: str) -> str:
    """What is locked for an address: the same text for every name of the same wire."""
    from drivers.errors import WrongAddress  # noqa: PLC0415 - brings the wires, which few commands need
    from drivers.wires.addresses import CanAddress, parse_address  # noqa: PLC0415

    try:
        found = parse_address(address)
    except WrongAddress:  # nothing opens it
        return address
    if found.device is not None:
        return _device(found.device)
    if isinstance(found, CanAddress):
        return f"can:{found.interface}/{found.channel}"
    if found.host is None:
        return address
    host = found.host.host.lower().rstrip(".")
    # A host and port is one instrument, whichever protocol it is spoken to in.
    return f"tcp:{_LOOPBACK.get(host, host)}:{found.host.port}"


def _device(path: str) -> str:
    """A device file by its numbers, which all its names share; one that is not there by its path."""
    if _COM.fullmatch(path):
        return path.upper()
    real = os.path.realpath(path)
    with contextlib.suppress(OSError):
        status = os.stat(real)
        if stat.S_ISCHR(status.st_mode):
            return f"device:{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}"
    return real


def _path(wire: str) -> Path:
    folder = Path(tempfile.gettempdir()) / "calibration-rig-locks"
    folder.mkdir(mode=0o1777, exist_ok=True)
    with contextlib.suppress(PermissionError):  # made by another user, who has already opened it to all
        folder.chmod(0o1777)
    return folder / hashlib.sha256(wire.encode()).hexdigest()[:32]


def _lock(path: Path, name: str, address: str) -> int:
    descriptor = _opened(path)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        who = _told(descriptor)
        os.close(descriptor)
        raise BusyError(
            f"{name}: {address} is in use by another controller of this machine ({who}); nothing was sent. Stop that "
            f"one first: `rig stop RUN`, or end the process"
        ) from None
    with contextlib.suppress(OSError):
        os.fchmod(descriptor, 0o666)  # the creating user's umask must not shut others out
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"process {os.getpid()}, {_command(sys.argv)}".encode()[:500], 0)
    return descriptor


def _opened(path: Path) -> int:
    """Open a lock's file; one that another user has made may be opened and not created, where the folder is shared."""
    with contextlib.suppress(FileNotFoundError):
        return os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)


def _command(arguments: Iterable[str]) -> str:
    first, *others = [*arguments] or ["?"]
    return " ".join([Path(first).name, *others])


def _told(descriptor: int) -> str:
    """What the holder of a lock has said about itself."""
    with contextlib.suppress(OSError):
        text = os.pread(descriptor, 500, 0).decode(errors="replace").strip()
        if text:
            return "".join(c if c.isprintable() else "?" for c in text)
    return "it does not say which process it is"
