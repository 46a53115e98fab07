"""The service: its unit, what systemd is told, what it leaves alone; and `rig status` for scripts."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import socket
import subprocess
import threading
from pathlib import Path

import pytest
from command import rig
from dry import LAB
from ideal_bench import new_run, run_session
from small_run import write_small

from rig.bench.config import parse_bench
from rig.cli.unattended import facts_of
from rig.engine.session import Outcome, Progress, Signals
from rig.errors import ExitCode
from rig.run_file.live import replace_json, request_path
from rig.unattended import Kind, Listeners, ServiceManager
from rig.unattended.systemd_unit import FINAL, ServiceUnit, patience_s


class Manager:
    """The other end of NOTIFY_SOCKET; listens all the time, since only a few messages may wait there."""

    def __init__(self, address):
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(address)
        self._address = address
        self._lines = []
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self):
        while (message := self._socket.recv(4096)) != b"END":
            if message == b"SYNC":
                self._asked.set()
            else:
                self._lines += message.decode().splitlines()

    def _post(self, message):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
            wire.sendto(message, self._address)

    def heard(self):
        """Every line since the last time."""
        self._asked.clear()
        self._post(b"SYNC")
        assert self._asked.wait(10)
        lines, self._lines = self._lines, []
        return lines

    def close(self):
        self._post(b"END")
        self._thread.join()
        self._socket.close()


@pytest.fixture(params=["path", "abstract"])
def manager(request, tmp_path):
    name = str(tmp_path / "notify") if request.param == "path" else f"\0rig-test-{os.getpid()}"
    found = Manager(name)
    found.name = name.replace("\0", "@")
    yield found
    found.close()


class Watch:
    seconds = 1000.0

    def now(self):
        return self.seconds


def news(state="settling", done=3):
    return Progress(state, done, 12, 60.0, 120.0, "")


def test_ready_when_every_instrument_has_answered_then_alive_then_stopping(tmp_path, manager):
    made = rig("run", write_small(tmp_path), "-b", LAB / "bench.toml", "--dry", "--create-only", "--out", tmp_path)
    path = Path(made.stdout.strip())
    told = {"NOTIFY_SOCKET": manager.name, "WATCHDOG_USEC": "2000", "WATCHDOG_PID": str(os.getpid())}
    done = rig("resume", path, "--unless-stopped", env=told)
    assert done.returncode == 0, done.stderr
    heard = manager.heard()
    assert heard.count("READY=1") == 1
    assert heard.count("WATCHDOG=1") > 3
    status = [line.partition("=")[2] for line in heard if line.startswith("STATUS=")]
    assert status[-1] == "complete, 12 of 12 points in " + status[-1].partition(" in ")[2]
    assert heard.index("READY=1") < heard.index("STOPPING=1")
    again = rig("resume", path, "--unless-stopped", env=told)  # as after a restart of the machine
    assert again.returncode == 0
    assert manager.heard()[0] == "READY=1"


def test_alive_only_as_long_as_the_sequencer_says_so_and_at_half_the_watchdogs_time(manager):
    clock = Watch()
    env = {"NOTIFY_SOCKET": manager.name, "WATCHDOG_USEC": "10000000", "WATCHDOG_PID": str(os.getpid())}
    service = ServiceManager(env, clock)
    service.progress(news())
    assert manager.heard() == ["WATCHDOG=1", "STATUS=settling: 3 of 12 points, 2 min left"]
    clock.seconds += 4.9
    service.progress(news())
    assert manager.heard() == []
    clock.seconds += 0.1
    service.progress(news())
    assert manager.heard() == ["WATCHDOG=1"]
    clock.seconds += 3600.0  # a driver call hangs: no news
    assert manager.heard() == []
    service.progress(news("parking", 12))
    assert manager.heard()[-1] == "STOPPING=1"
    lasting = ServiceManager(env, clock)
    lasting.lasts = True  # a loop, which goes on after a run has parked
    lasting.progress(news("parking", 12))
    assert "STOPPING=1" not in manager.heard()
    for other in ({**env, "WATCHDOG_PID": "1"}, {**env, "WATCHDOG_USEC": "soon"}):
        ServiceManager(other, clock).progress(news())
        assert "WATCHDOG=1" not in manager.heard()


def test_a_manager_that_does_not_listen_changes_nothing(tmp_path):
    service = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "nobody"), "WATCHDOG_USEC": "1000"})
    service.progress(news())
    service.ended("done")
    assert not ServiceManager({}).present
    assert not ServiceManager({"NOTIFY_SOCKET": "vsock:2:1234"}).present


# --- the unit ---------------------------------------------------------------------------------------------------------


def unit(folder, *, system):
    run = folder / "20260115T180000-night-1a2b.sqlite"
    addresses = ("/dev/ttyUSB7", "can:slcan//dev/rig/adapter?bitrate=500000", "socket://scanner:5025")
    return ServiceUnit(run, run.stem, 'night "100 %" on lab', system=system, user="rig", addresses=addresses)


@pytest.mark.parametrize("system", [True, False])
@pytest.mark.parametrize("folder", ["runs", 'a b%c$d"e\\f'])
def test_systemd_takes_the_unit(tmp_path, folder, system):
    verify = shutil.which("systemd-analyze")
    if verify is None:
        pytest.skip("there is no systemd-analyze here")
    made = unit(tmp_path / folder, system=system)
    made.run.parent.mkdir()
    (tmp_path / made.name).write_text(made.text())
    command = [verify, *([] if system else ["--user"]), "verify", str(tmp_path / made.name)]
    env = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=env)
    said = [line for line in done.stderr.splitlines() if not line.startswith("/usr/lib/")]  # units of other packages
    assert (done.returncode, said) == (0, [])


def test_the_unit_restarts_after_crashes_and_faults_but_not_after_what_is_final():
    text = unit(Path("/data/runs"), system=True).text()
    lines = dict(line.split("=", 1) for line in text.splitlines() if "=" in line and not line.startswith("#"))
    assert lines["Type"] == "notify"
    assert lines["Restart"] == "on-failure"
    assert lines["ExecStart"].endswith(" -m rig resume /data/runs/20260115T180000-night-1a2b.sqlite --unless-stopped")
    never = {int(code) for code in lines["RestartPreventExitStatus"].split()}
    assert never == set(FINAL)
    assert set(ExitCode) - never == {ExitCode.FAULT, ExitCode.RUNNING}
    assert lines["KillSignal"] == "SIGTERM"
    assert int(lines["StartLimitBurst"]) == 5
    for closes_all_ports in ("PrivateDevices", "ProtectClock"):
        assert closes_all_ports not in lines
    allowed = [line for line in text.splitlines() if line.startswith("DeviceAllow=")]
    assert allowed == ["DeviceAllow=/dev/rig/adapter rw", "DeviceAllow=char-ttyUSB rw"]  # of the bench, and no others
    assert lines["RestrictAddressFamilies"].endswith(" AF_CAN")


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd-analyze here")
def test_a_unit_of_the_machine_is_confined(tmp_path):
    made = unit(Path("/data/runs"), system=True)
    (tmp_path / made.name).write_text(made.text())
    command = ["systemd-analyze", "security", "--offline=yes", str(tmp_path / made.name)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert float(re.search(r"exposure level for \S+: ([\d.]+)", said)[1]) < 3.0


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may ask for it")
def test_a_controller_does_not_run_as_root(tmp_path):
    path = new_run(tmp_path)
    refused = rig("service", path, "--system", "--run-as", "root")
    assert (refused.returncode, "does not need root" in refused.stderr) == (2, True)
    assert "User=nobody" in rig("service", path, "--system", "--run-as", "nobody").stdout


@pytest.mark.parametrize("user", ["a b", "-x", "x\\", "nosuchuser", "x\nExecStartPre=y", "9" * 30, "99999"])
@pytest.mark.parametrize("more", ["--system", "--user"])
def test_a_service_runs_as_nobody_who_is_not_there(tmp_path, user, more):
    done = rig("service", new_run(tmp_path), more, f"--run-as={user}")
    assert (done.returncode, done.stdout) == (2, "")
    assert "there is no such user on this machine" in done.stderr


def test_a_folder_that_would_join_the_next_line_of_the_unit_is_refused(tmp_path):
    folder = tmp_path / "back\\"
    folder.mkdir()
    done = rig("service", new_run(folder), "--user")
    assert (done.returncode, done.stdout) == (2, "")
    assert "ends with a backslash, which systemd takes to join the next line" in done.stderr


def test_the_watchdog_waits_for_a_pressure_line_that_is_slow_to_vent():
    text = (LAB.parent / "pressure-lab" / "bench.toml").read_text()
    assert patience_s(parse_bench(text, "bench")) == 900.0
    slow = text.replace('driver = "druck-pace"', 'driver = "druck-pace"\nvent_psi_per_s = 0.02')
    assert patience_s(parse_bench(slow, "bench")) == 2 * (1.5 * 14.7 / 0.02 + 120.0)


def test_the_unit_is_printed_installed_and_removed(tmp_path):
    path = new_run(tmp_path)
    env = {"XDG_CONFIG_HOME": str(tmp_path / "config")}
    printed = rig("service", path, "--user", env=env)
    assert printed.stdout.startswith("[Unit]\n")
    installed = rig("service", path, "--user", "--install", env=env)
    target = tmp_path / "config/systemd/user/rig-small.service"
    assert installed.stdout == f"{target}\n"
    assert target.read_text() == printed.stdout
    assert "systemctl --user enable --now rig-small.service" in installed.stderr
    assert "enable-linger" in installed.stderr
    assert rig("service", path, "--user", "--remove", env=env).returncode == 0
    assert not target.exists()
    assert rig("service", path, "--user", "--remove", env=env).returncode == 2


# --- what a session before has left -----------------------------------------------------------------------------------


class Cut(BaseException):
    """The power is gone."""


def interrupted(path, how):
    """A session that ends like that."""
    signals = Signals()

    def progress(told):
        if told.done == 3 and how == "crash":
            raise Cut
        if told.done == 3 and how == "stop":
            replace_json(request_path(path), {"id": "1", "session": 1, "verb": "stop"})
        if told.done == 3 and how == "signal":
            signals.interrupt = "SIGTERM"

    def spoil(bench, head, _reader):
        if how == "fault":
            head.move = lambda _targets: (_ for _ in ()).throw(LimitErrorOf())

    try:
        return run_session(path, on_progress=progress, signals=signals, spoil=spoil)[0]
    except Cut:
        return None


def LimitErrorOf():
    from rig.drivers.errors import LimitError  # noqa: PLC0415

    return LimitError("head: refused")


@pytest.mark.parametrize(
    ("how", "outcome", "crash", "code"),
    [
        ("crash", None, True, 75),
        ("signal", Outcome.INTERRUPTED, False, 75),
        ("stop", Outcome.STOPPED, False, 4),
        ("fault", Outcome.FAULT, False, 1),
        ("nothing", Outcome.COMPLETE, False, 0),
        ("", None, False, 75),
    ],
)
def test_status_tells_scripts_how_it_is_and_a_crash_is_known_as_one(tmp_path, monkeypatch, how, outcome, crash, code):
    path, ticks = new_run(tmp_path), itertools.count()
    monkeypatch.setattr("rig.sims.world.World.stopwatch", lambda _self: float(next(ticks)))  # requests are seen at once
    if how:
        assert interrupted(path, how) is outcome
    assert facts_of(path).after_crash is crash
    checked = rig("status", path, "--check", "--json")
    assert checked.returncode == code, checked.stdout
    assert rig("status", path).returncode == 0
    if how == "stop":
        left = rig("resume", path, "--unless-stopped")
        assert left.returncode == 4
        assert "was stopped by a person" in left.stderr


def test_a_session_after_a_crash_says_so(tmp_path):
    path = new_run(tmp_path)
    interrupted(path, "crash")
    seen = []
    listeners = Listeners(facts_of(path))
    listeners._log = seen.append
    from rig.run_file.write.writer import RunWriter  # noqa: PLC0415

    run_session(path)
    with RunWriter.open(path) as run:
        for record in run.records("session"):
            listeners.recorded(record)
    assert [h.kind for h in seen] == [Kind.START, Kind.CRASH]
    assert "ended without a record" in seen[1].text


def test_status_of_a_folder_lists_its_runs_newest_first_damaged_ones_too(tmp_path):
    old, new = new_run(tmp_path), tmp_path / "b.sqlite"
    run_session(old)
    new.write_bytes(old.read_bytes()[:5000])
    os.utime(old, (1e9, 1e9))
    listed = json.loads(rig("status", tmp_path, "--json").stdout)
    assert [(Path(row["run_file"]).name, row["state"]) for row in listed] == [
        ("b.sqlite", "unreadable"),
        ("small.sqlite", "complete"),
    ]
    shown = rig("status", tmp_path)
    assert shown.returncode == 0
    line = next(line for line in shown.stdout.splitlines() if "small.sqlite" in line)
    assert line.split()[1:4] == ["SIM", "complete", f"{listed[1]['done']}/{listed[1]['points']}"]
    assert rig("status", tmp_path, "--check").returncode == 1
    empty = tmp_path / "empty"
    empty.mkdir()
    assert rig("status", empty).returncode == 2
