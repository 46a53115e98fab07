"""A systemd unit that continues a run after failures, and gives up if only a person can help."""

from __future__ import annotations

import getpass
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

from rig.bench.bench_file import check_options
from rig.bench.config import BenchConfig
from rig.drivers.wires.addresses import CanAddress, parse_address
from rig.drivers.wires.visa_address import VisaAddress
from rig.errors import ExitCode, UsageError
from rig.units.of_instruments import ATMOSPHERE_PSIA

WATCHDOG_S = 900.0
"""Seconds without a sign of life after which the controller counts as hanging. Its longest normal silence is while a
pressure line is vented to the atmosphere: from 15 psi at 0.2 psi/s about four minutes."""

_VENT_S = 120.0

FINAL = (
    ExitCode.DONE,
    ExitCode.USAGE,
    ExitCode.OUTSIDE_ACCEPTANCE,
    ExitCode.STOPPED,
    ExitCode.UNSAFE,
    ExitCode.INTERRUPTED,
    ExitCode.CONFIGURATION,
)
"""Exit codes after which another attempt would be wrong or useless. The unit starts again after a fault with the
bench safe (1), a signal, the watchdog, or a crash of the machine."""

GOOD = (ExitCode.OUTSIDE_ACCEPTANCE, ExitCode.STOPPED, ExitCode.INTERRUPTED)
"""Exit codes besides 0 that are not a failure of the service."""


@dataclass(frozen=True)
class ServiceUnit:
    """A unit for one run.

    Attributes:
        run: the run file, absolute.
        run_id: its name.
        about: procedure and bench, for people.
        system: whether it is a unit of the machine; otherwise of the user, who must be allowed to linger.
        user: user of a system unit.
        watchdog_s: see `WATCHDOG_S`.
        bench: another bench file for `rig resume`, absolute.
        also_write: further writable folders besides the run's.
        addresses: addresses of the bench's instruments; a system unit has access to no other devices.

    """

    run: Path
    run_id: str
    about: str
    system: bool
    user: str
    watchdog_s: float = WATCHDOG_S
    bench: Path | None = None
    also_write: tuple[Path, ...] = ()
    addresses: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The unit's file name."""
        return "rig-" + re.sub(r"[^A-Za-z0-9_.-]", "-", self.run_id) + ".service"

    @property
    def path(self) -> Path:
        """Path for its installation."""
        if self.system:
            return Path("/etc/systemd/system") / self.name
        home = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
        return home / "systemd" / "user" / self.name

    @property
    def command(self) -> tuple[str, ...]:
        """Its command. -P prevents that a file rig.py in the run's folder is taken for this program."""
        bench = () if self.bench is None else ("--bench", str(self.bench))
        return (sys.executable, "-P", "-m", "rig", "resume", str(self.run), "--unless-stopped", *bench)

    def check_paths(self) -> None:
        """Raise `UsageError` for a path that cannot be written in a unit: systemd would refuse the whole unit."""
        for path in (self.run, self.bench, *self.also_write):
            if path is not None and re.search(r"[\x00-\x1f\x7f\ud800-\udfff]", str(path)):
                raise UsageError(
                    f"{str(path)!r} has a control character in it, such as a newline, or bytes that are no text; "
                    "systemd takes neither in a path: rename it, or move the run to another folder"
                )
        for path in (self.run, self.run.parent):
            if str(path).endswith("\\"):
                raise UsageError(
                    f"{path} ends with a backslash, which systemd takes to join the next line: rename it, or move the "
                    "run to another folder"
                )

    def text(self) -> str:
        """The unit file."""
        folder = self.run.parent
        writable = " ".join(_quoted(str(path)) for path in (folder, *self.also_write))
        network = "Wants=network-online.target\nAfter=network-online.target time-sync.target\n" if self.system else ""
        return _UNIT.format(
            description=f"Calibration run {_plain(self.run_id)} ({_plain(self.about)})",
            run=_plain(str(self.run)),
            mounts=_quoted(str(folder)),
            network=network,
            command=" ".join(_quoted(part).replace("$", "$$") for part in self.command),
            folder=_plain(str(folder)),
            user=f"User={_plain(self.user)}\n" if self.system else "",
            watchdog=f"{self.watchdog_s:g}",
            final_words=", ".join(f"{int(code)} {code.name.lower().replace('_', ' ')}" for code in FINAL),
            final=" ".join(str(int(code)) for code in FINAL),
            good=" ".join(str(int(code)) for code in GOOD),
            hardening=self._confined(writable) if self.system else "",
            target="multi-user" if self.system else "default",
        )

    def _confined(self, writable: str) -> str:
        """Restrictions of a unit of the machine; a user's unit may not set them."""
        reached = [parse_address(address) for address in self.addresses]
        families = " AF_CAN" if any(isinstance(one, CanAddress) for one in reached) else ""
        devices = sorted({_device_class(one.device) for one in reached if one.device is not None})
        buses = {one.kind for one in reached if isinstance(one, VisaAddress)}
        devices += [_VISA_DEVICES[bus] for bus in sorted(buses & _VISA_DEVICES.keys())]
        allowed = "".join(f"DeviceAllow={device} rw\n" for device in devices)
        return _SYSTEM_HARDENING.format(families=families) + f"{allowed}ReadWritePaths={writable}\n"

    def next_steps(self) -> list[str]:
        """Commands that install it, and commands that show its state."""
        control = "systemctl" if self.system else "systemctl --user"
        journal = f"journalctl {'' if self.system else '--user '}-u {self.name}"
        linger = [] if self.system else [f"loginctl enable-linger {getpass.getuser()}   # lives on after you log out"]
        return [*linger, f"{control} daemon-reload", f"{control} enable --now {self.name}", f"{journal} -f"]


_UNIT = """\
[Unit]
Description={description}
ConditionPathExists={run}
RequiresMountsFor={mounts}
{network}# A crash loop ends: five starts in six hours, then a person is needed.
StartLimitIntervalSec=6h
StartLimitBurst=5

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
WorkingDirectory={folder}
Environment=PYTHONUNBUFFERED=1 OPENBLAS_NUM_THREADS=1
# Secrets that notify.toml names, as NAME=VALUE lines; a missing file is no error.
EnvironmentFile=-%E/calibration-rig/environment
{user}
# Ready when every instrument has answered; alive as long as the sequencer itself says so.
TimeoutStartSec=15min
WatchdogSec={watchdog}

# Again after a fault (bench safe), a crash, a hang. Not after exit codes that are final:
# {final_words}
Restart=on-failure
RestartSec=60
RestartPreventExitStatus={final}
SuccessExitStatus={good}

# SIGTERM to the controller alone: it stops motion, and has time to bring the bench to its
# safe state and to tell people. What it has started ends with it.
KillSignal=SIGTERM
KillMode=mixed
TimeoutStopSec={watchdog}
LimitCORE=0

# On purpose not used: PrivateDevices and ProtectClock (both close /dev), MemoryDenyWriteExecute (numerical
# libraries), ProcSubset (the name of this boot is read there).
NoNewPrivileges=yes
UMask=0027
LockPersonality=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
SystemCallArchitectures=native
{hardening}
[Install]
WantedBy={target}.target
"""


def _device_class(device: str) -> str:
    """Kind of an address's device, as systemd's permission: a port that is connected again may have another number.

    A name without a device at the moment, or with a device of unknown kind, is permitted by itself.
    """
    name = os.path.basename(os.path.realpath(device))
    kind = next((kind for kind in _DEVICE_KINDS if re.fullmatch(rf"{kind}[0-9]+", name)), None)
    return device if kind is None else f"char-{kind}"


_VISA_DEVICES = {"gpib": "char-gpib", "usb": "char-usb_device"}
"""Devices behind VISA addresses, as systemd's permissions: GPIB adapters with the kernel's driver, and USB."""

_DEVICE_KINDS = ("ttyUSB", "ttyACM", "ttyS", "ttyAMA", "rfcomm")

_SYSTEM_HARDENING = """\
CapabilityBoundingSet=
AmbientCapabilities=
SystemCallFilter=@system-service
SystemCallFilter=~@privileged
SystemCallErrorNumber=EPERM
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK{families}
RestrictNamespaces=yes
KeyringMode=private
PrivateTmp=yes
PrivateMounts=yes
RemoveIPC=yes
ProtectKernelLogs=yes
ProtectProc=invisible
DevicePolicy=closed
# Where a run goes on if its own folder is taken away.
StateDirectory=calibration-rig
StateDirectoryMode=0750
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectControlGroups=yes
ProtectHostname=yes
OOMScoreAdjust=-500
ProtectSystem=strict
ProtectHome=read-only
"""


def patience_s(config: BenchConfig) -> float:
    """The watchdog's time for a bench, seconds: twice the longest venting time of its pressure lines, if that is
    more.
    """
    longest = 0.0
    for options in check_options(config, "bench").values():
        slew, high = getattr(options, "vent_psi_per_s", None), getattr(options, "high_psia", None)
        if slew and high is not None:
            way = max(ATMOSPHERE_PSIA, abs(high - ATMOSPHERE_PSIA))
            longest = max(longest, 1.5 * way / slew + _VENT_S)
    return max(WATCHDOG_S, 2.0 * longest)


def _plain(text: str) -> str:
    """A value that is one text or one path: without quotes, specifiers doubled."""
    return re.sub(r"[\x00-\x1f\x7f\ud800-\udfff]+", " ", text).replace("%", "%%").strip()


def _quoted(text: str) -> str:
    """A word of a list: in quotes if needed, specifiers doubled."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    return f'"{escaped}"' if re.search(r"[^A-Za-z0-9_./:=@+,$%-]", text) else escaped
