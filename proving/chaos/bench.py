"""The bench of a chaos campaign: twins in a process of their own, and cables that can be cut."""

from __future__ import annotations

import contextlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

PROJECT = Path(__file__).parents[2]

ATTITUDE = """
kind = "pitch-roll"
name = "chaos"
replications = 6
[design]
type = "D1"
pitch_max_deg = 90
pitch_count = 5
roll_count = 5
[order]
replications = "abba"
[settle]
dwell_s = 2
[measure]
readings = 4
[environment]
setpoint_degC = 23
tolerance_degC = 1.0
dwell_s = 120
[recovery]
max_gap_s = {gap}
"""

PRESSURE = """
kind = "whole-plot"
name = "chaos"
seed = {seed}
[design]
type = "list"
temperatures_degC = [[12, 18], [16, 24], [20, 20], [14, 26]]
pressures_psia = [0.12, 0.5, 1.0, 1.5]
repeated_psia = [0.5, 1.0]
[model]
formula = "1 + P"
[soak]
poll_s = 60
tolerance_degC = 1.0
sensor_tolerance_degC = 2.0
dwell_s = 120
drift_degC_per_h = 6
[settle]
dwell_s = 5
[measure]
readings = 3
[recovery]
continue_gap_s = {gap}
"""


@dataclass(frozen=True)
class Lab:
    """A laboratory at a speed.

    Attributes:
        gap_s: the gap of its procedure, after which what was prepared does not stand.
        sockets: addresses in its bench that are sockets here, so that they can be cut.

    """

    name: str
    speed: float
    gap_s: float
    procedure: str
    sockets: tuple[tuple[str, str], ...]

    @property
    def hole_s(self) -> float:
        """How long a silence is a hole, bench seconds."""
        return 10.0 + self.speed


LABS = {
    "attitude": Lab("attitude", 300.0, 900.0, ATTITUDE, (("/dev/rig/head", "socket://192.0.2.9:4001"),)),
    "pressure": Lab(
        "pressure",
        500.0,
        900.0,
        PRESSURE,
        (("/dev/rig/pace", "socket://192.0.2.9:5025"), ("/dev/rig/scanner", "socket://192.0.2.9:4002")),
    ),
}


class Relay:
    """A TCP cable between controller and instrument. Its near end keeps its address whatever becomes of the far one."""

    def __init__(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.target = 0
        self.cut = self.silent = False
        self._open: set[socket.socket] = set()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                try:
                    if self.cut:
                        raise OSError("cut")
                    far = socket.create_connection(("127.0.0.1", self.target), 1.0)
                except OSError:
                    near.close()
                    continue
                far.settimeout(None)
                for end in (near, far):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._open |= {near, far}
                for a, b in ((near, far), (far, near)):
                    threading.Thread(target=self._carry, args=(a, b), daemon=True).start()

    def _carry(self, source: socket.socket, to: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(4096):
                if not self.silent:
                    to.sendall(data)
        self._hang_up({source, to})

    def _hang_up(self, ends: set[socket.socket]) -> None:
        self._open -= ends
        for end in ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def break_off(self, *, silent: bool) -> None:
        """Cut it: bytes vanish, or the connection ends and none is accepted."""
        self.silent, self.cut = silent, not silent
        if self.cut:
            self._hang_up(set(self._open))

    def mend(self) -> None:
        """Put it back."""
        self.cut = self.silent = False

    def close(self) -> None:
        """End it for good."""
        with contextlib.suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._hang_up(set(self._open))


_TCP = re.compile(r'(address = "(?:socket|modbus-tcp)://127\.0\.0\.1:)(\d+)')


class ServedBench:
    """A bench served by a process of its own.

    Args:
        lab: which.
        folder: where its files go.

    Attributes:
        file: the bench file for controllers; the same name whichever server it is.
        tape: what all of them have written.

    """

    def __init__(self, lab: Lab, folder: Path) -> None:
        self._lab, self._folder = lab, folder
        self.file, self.tape = folder / "bench-live.toml", folder / "bench.tape"
        self.relays: list[Relay] = []
        self.starts = 0
        source = PROJECT / "examples" / f"{lab.name}-lab"
        text = (source / "bench.toml").read_text()
        for device, address in lab.sockets:
            text = text.replace(f'"{device}"', f'"{address}"')
        self._bench, self._world = folder / "bench.toml", source / "world.toml"
        self._bench.write_text(text)
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start a server; its instruments are new, whatever there was before."""
        self.starts += 1
        live = self._folder / f"live-{self.starts}.toml"
        words: list[object] = ["sim", self._bench, "--world", self._world, "--speed", self._lab.speed]
        words += ["--live", live, "--tape", self.tape, "--for", 1800]
        with (self._folder / "server.log").open("ab") as log:
            command = [sys.executable, "-m", "rig", *map(str, words)]
            self._process = subprocess.Popen(command, cwd=PROJECT, stdout=log, stderr=log)
        end = time.monotonic() + 60
        while not live.exists():
            if self._process.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"the simulated bench did not start; see {self._folder}/server.log")
            time.sleep(0.02)
        self._write(live.read_text())

    def _write(self, text: str) -> None:
        """The bench file as controllers see it: sockets go through the relays."""
        count = iter(range(100))

        def through(match: re.Match[str]) -> str:
            n = next(count)
            if n == len(self.relays):
                self.relays.append(Relay())
            self.relays[n].target = int(match[2])
            return f"{match[1]}{self.relays[n].port}"

        part = self.file.with_suffix(".part")
        part.write_text(_TCP.sub(through, text))
        part.replace(self.file)

    def moved_utc(self, seconds: float) -> Path:
        """A bench file by which UTC is another."""
        text = re.sub(
            r"epoch_utc = ([\d.e+]+)", lambda m: f"epoch_utc = {float(m[1]) + seconds!r}", self.file.read_text()
        )
        other = self._folder / "bench-other-utc.toml"
        other.write_text(text)
        return other

    def send(self, number: signal.Signals) -> None:
        """A signal to the server."""
        assert self._process is not None
        self._process.send_signal(number)

    def kill(self) -> None:
        """SIGKILL."""
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """End it all."""
        for relay in self.relays:
            relay.close()
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGCONT)
            self.kill()


class Disk:
    """A small disk of its own, where one may be mounted; a folder otherwise.

    Args:
        folder: made, and taken away by `close`.

    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", "size=32m", "chaos", str(folder)]
        self.own = (
            shutil.which("mount") is not None and not subprocess.run(mount, capture_output=True, check=False).returncode
        )

    def fill(self) -> Path:
        """Leave no room at all; returns the file that takes it."""
        ballast = self.folder / "ballast"
        with contextlib.suppress(OSError), ballast.open("wb", buffering=0) as file:
            for size in (1 << 20, 1 << 12, 1):
                with contextlib.suppress(OSError):
                    while file.write(bytes(size)) == size:
                        pass
        return ballast

    def close(self) -> None:
        """Unmount."""
        if self.own:
            subprocess.run(["umount", "-l", str(self.folder)], capture_output=True, check=False)
