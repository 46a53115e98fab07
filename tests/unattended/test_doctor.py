"""The doctor: every check finds what it is there for, says what to do, and touches nothing."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import pty
import socketserver
import threading
import time
from datetime import UTC, date, datetime
from types import SimpleNamespace

import pytest
from command import rig
from dry import LAB
from fake_lines import answering, serving
from foreign_instruments import BENCH, Foreign
from small_run import write_small
from test_notify import Hook

from rig.bench.config import BenchConfig
from rig.drivers.wires.addresses import parse_address
from rig.instruments.locks import locked_addresses
from rig.unattended.doctor import addresses, disk, time_of_day
from rig.unattended.doctor.disk import check_disk, mounted
from rig.unattended.doctor.instruments import check_due, check_instruments
from rig.unattended.doctor.machine import check_power, check_sqlite
from rig.unattended.doctor.time_of_day import check_clock

NOW = datetime(2026, 3, 28, 18, 0, tzinfo=UTC).timestamp()


def found(findings, check):
    return next(f for f in findings if f.check == check)


@pytest.fixture
def quiet(tmp_path):
    """A home without a notify.toml."""
    return {"XDG_CONFIG_HOME": str(tmp_path / "config"), "RIG_NOTIFY": ""}


@pytest.mark.parametrize("lab", ["attitude-lab", "pressure-lab"])
def test_a_dry_bench_is_ready_and_every_instrument_is_named(tmp_path, quiet, lab):
    bench = LAB.parent / lab / "bench.toml"
    done = rig("doctor", "--bench", bench, "--dry", "--json", "--out", tmp_path, env=quiet)
    assert done.returncode == 0, done.stdout
    said = json.loads(done.stdout)
    assert said["ready"] is True
    checks = {f["check"]: f for f in said["findings"]}
    names = BenchConfig.model_validate(instruments_of(bench)).instruments
    assert all(checks[name]["level"] == "ok" for name in names)
    assert checks.keys() >= {"disk: room", "disk: syncing", "disk: locks", "clock: UTC", "sleep", "sqlite", "python"}
    assert checks["notifications"]["level"] == "warning"
    assert all(f["next_step"] for f in said["findings"] if f["level"] != "ok")
    assert list(tmp_path.iterdir()) == []


def instruments_of(path):
    import tomllib  # noqa: PLC0415

    return tomllib.loads(path.read_text())


def test_a_bench_that_is_not_there_is_a_problem_and_the_other_checks_go_on(tmp_path, quiet):
    done = rig("doctor", "--bench", tmp_path / "no.toml", "--out", tmp_path, env=quiet)
    assert done.returncode == 78, "what rig plan and rig run would end with"
    assert "does not exist" in done.stdout
    assert "disk: syncing" in done.stdout
    assert "not ready for the night" in done.stderr


def test_a_run_that_is_to_go_on_is_verified_and_its_instruments_are_compared(tmp_path, quiet):
    bench = tmp_path / "bench.toml"
    bench.write_text((LAB / "bench.toml").read_text())
    procedure = write_small(tmp_path)
    made = rig("run", procedure, "-b", bench, "--dry", "--create-only", "--out", tmp_path)
    path = made.stdout.strip()
    ready = rig("doctor", "--run", path, "--json", env=quiet)
    assert ready.returncode == 0, ready.stdout
    findings = {f["check"]: f["found"] for f in json.loads(ready.stdout)["findings"]}
    assert "0 of 12 points" in findings["run file"]
    assert findings["forecast"].startswith("12 points, about ")
    assert rig("resume", path).returncode == 0
    over = rig("doctor", "--run", path, env=quiet)
    assert over.returncode == 1
    assert "nothing to resume" in over.stdout
    assert rig("doctor", "--run", path, "--procedure", procedure).returncode == 2


# --- addresses --------------------------------------------------------------------------------------------------------


def bench(**addresses_by_name):
    drivers = dict.fromkeys(addresses_by_name, "keysight-34401a")
    return BenchConfig.model_validate(
        {
            "name": "lab",
            "instruments": {n: {"driver": drivers[n], "address": a} for n, a in addresses_by_name.items()},
            "sensors": {"x": {"axis": "x", "reader": next(iter(addresses_by_name))}},
        }
    )


@pytest.mark.parametrize(
    ("address", "device"),
    [
        ("/dev/rig/dvm", "/dev/rig/dvm"),
        ("modbus-rtu:///dev/ttyUSB1/1", "/dev/ttyUSB1"),
        ("can:slcan//dev/ttyACM0", "/dev/ttyACM0"),
        ("can:slcan//dev/ttyACM0@115200", "/dev/ttyACM0"),
        ("can:socketcan/can0", None),
        ("socket://host:5025", None),
        ("modbus-tcp://host:502/1", None),
    ],
)
def test_the_device_behind_an_address(address, device):
    assert parse_address(address).device == device


def test_addresses_that_cannot_work_say_why_and_what_to_do(tmp_path):
    plain = tmp_path / "file"
    plain.write_text("")
    config = bench(a="/dev/rig/nothing", b=str(plain), c="can:socketcan/nocan7", d="socket://no-such-host.invalid:1")
    said = dict(addresses.check_addresses(config.instruments))
    assert all(f.level == "problem" for f in said.values())
    assert "/dev/rig/nothing does not exist" in said["a"].found
    assert "udev rule" in said["a"].next_step
    assert "is not a device" in said["b"].found
    assert "ip link set nocan7 up" in said["c"].next_step
    assert "no-such-host.invalid is not known" in said["d"].found


def test_a_port_that_may_not_be_opened_names_the_group_to_join(monkeypatch):
    group = SimpleNamespace(gr_name="dialout", gr_gid=20_020, gr_mem=[])
    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setattr(addresses.grp, "getgrgid", lambda _: group)
    _, finding = next(addresses.check_addresses(bench(dvm="/dev/tty").instruments))
    assert finding.level == "problem"
    assert "usermod -aG dialout" in finding.next_step
    group.gr_mem.append(addresses._me())
    _, finding = next(addresses.check_addresses(bench(dvm="/dev/tty").instruments))
    assert "log out and in again" in finding.next_step


def test_a_port_that_another_program_has_open_names_it(monkeypatch):
    master, slave = pty.openpty()
    with contextlib.closing(os.fdopen(master, "wb")), contextlib.closing(os.fdopen(slave, "wb")):
        port = os.ttyname(slave)
        monkeypatch.setattr(addresses, "_holders", lambda: {port: "minicom (process 17)"})
        _, finding = next(addresses.check_addresses(bench(dvm=port).instruments))
        assert "is open in minicom (process 17)" in finding.found
        monkeypatch.setattr(addresses, "_holders", dict)
        _, finding = next(addresses.check_addresses(bench(dvm=port).instruments))
        assert finding.level == "ok"


# --- who answers ------------------------------------------------------------------------------------------------------


class Meter(socketserver.StreamRequestHandler):
    """A 34401A on a socket, as far as asking who it is goes; remembers everything it was told."""

    told: list[bytes] = []  # noqa: RUF012

    def handle(self):
        for line in self.rfile:
            self.told.append(line.strip(b"\x03\r\n"))
            if line.strip(b"\x03\r\n") == b"*IDN?":
                self.wfile.write(b"HEWLETT-PACKARD,34401A,0,11-5-2\r\n")


@pytest.fixture
def meter():
    Meter.told = []
    with answering(Meter) as port:
        yield f"socket://127.0.0.1:{port}"


def test_every_instrument_is_asked_who_it_is_and_told_nothing_else(meter):
    findings = list(check_instruments(bench(dvm=meter, gone="/dev/rig/nothing"), {}, None))
    answer = found(findings, "dvm")
    assert answer.level == "warning"  # a 34401A does not tell its serial number and has no asset number here
    assert answer.found == "HEWLETT-PACKARD 34401A, does not report its serial number"
    assert set(Meter.told) <= {b"", b"SYST:REM", b"*IDN?"}
    assert [f.check for f in findings if f.level == "problem"] == ["address of gone"]


def test_another_instrument_than_before_is_a_problem(meter):
    before = {"dvm": {"maker": "HEWLETT-PACKARD", "model": "34401A", "serial": "0", "asset": "DVM-1"}}
    findings = list(check_instruments(bench(dvm=meter), before, None))
    assert found(findings, "dvm").level == "problem"
    assert "--accept dvm" in found(findings, "dvm").next_step


def test_a_bench_in_use_is_not_asked_anything(meter):
    config = bench(dvm=meter)
    with locked_addresses(config.instruments):
        findings = list(check_instruments(config, {}, None))
    assert found(findings, "locks").level == "problem"
    assert Meter.told == []


def test_calibrations_overdue_or_due_during_the_run_are_problems():
    def level(due):
        config = bench(dvm="/dev/tty")
        dated = config.instruments["dvm"].model_copy(update={"due": due})
        config = config.model_copy(update={"instruments": {"dvm": dated}})
        return next(check_due(config, NOW, NOW + 30 * 3600)).level

    assert level(date(2026, 3, 27)) == "problem"
    assert level(date(2026, 3, 29)) == "problem"
    assert level(date(2026, 4, 10)) == "warning"
    assert level(date(2027, 4, 10)) == "ok"
    assert level(None) == "ok"


def test_instruments_of_one_asset_have_one_due_date():
    """Three units of one machine; what has no asset number is told one by one."""
    one = bench(dvm="/dev/tty").instruments["dvm"].model_copy(update={"due": None, "asset": "M-1"})
    two = {"a": one, "b": one, "c": one.model_copy(update={"asset": ""}), "d": one.model_copy(update={"asset": ""})}
    config = bench(dvm="/dev/tty").model_copy(update={"instruments": two})
    found = [(one.check, one.found) for one in check_due(config, NOW, NOW)]
    none = "no due date in the bench file"
    assert found == [("calibration of a, b", none), ("calibration of c", none), ("calibration of d", none)]
    dated = two | {"b": one.model_copy(update={"due": date(2028, 1, 1)})}
    config = config.model_copy(update={"instruments": dated})
    assert [one.check for one in check_due(config, NOW, NOW)] == [
        "calibration of b",
        "calibration of c",
        "calibration of d",
    ]


# --- disk, clock, machine ---------------------------------------------------------------------------------------------


def test_a_disk_without_room_or_rights_is_a_problem(tmp_path, monkeypatch):
    of_the_place = {"disk: room", "disk: file system", "disk: syncing"}  # the tests may be run in memory
    few = list(check_disk(tmp_path / "runs" / "not" / "yet", 10))
    assert all(f.level == "ok" for f in few if f.check not in of_the_place)
    monkeypatch.setattr(disk.shutil, "disk_usage", lambda _: SimpleNamespace(free=30_000_000))
    assert found(check_disk(tmp_path, 2886), "disk: room").level == "warning"
    assert found(check_disk(tmp_path, 5000), "disk: room").level == "problem"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "options", "level"),
    [
        ("ext4", {"rw"}, "ok"),
        ("tmpfs", {"rw"}, "warning"),
        ("nfs4", {"rw"}, "warning"),
        ("ext4", {"rw", "nobarrier"}, "warning"),
        ("xfs", {"ro"}, "problem"),
        ("", set(), "warning"),
    ],
)
def test_file_systems_that_lose_data_are_told(tmp_path, monkeypatch, kind, options, level):
    monkeypatch.setattr(disk, "mounted", lambda _: (kind, options))
    assert found(check_disk(tmp_path, 10), "disk: file system").level == level


def test_the_file_system_of_a_folder_is_the_one_it_is_on():
    assert mounted(disk.Path("/proc"))[0] == "proc"


@pytest.mark.parametrize(("seconds", "level"), [(1e-6, "warning"), (2e-3, "ok"), (0.5, "warning")])
def test_a_disk_that_does_not_sync_or_takes_long_is_told(tmp_path, monkeypatch, seconds, level):
    monkeypatch.setattr(disk, "sync_s", lambda _: seconds)
    assert found(check_disk(tmp_path, 10), "disk: syncing").level == level


def test_locks_that_do_not_exclude_each_other_are_a_problem(tmp_path, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", lambda *_: None)
    assert found(check_disk(tmp_path, 10), "disk: locks").level == "problem"


@pytest.fixture
def berlin(monkeypatch):
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def test_a_change_of_local_time_during_the_run_is_named_and_said_to_be_harmless(berlin):
    findings = list(check_clock(NOW, NOW + 14 * 3600, None))
    zone = found(findings, "clock: time zone")
    assert zone.level == "ok"
    assert zone.found.startswith("clocks go from 02:00 CET to 03:00 CEST on 2026-03-29, during the run: harmless")
    calm = found(check_clock(NOW, NOW + 3 * 3600, None), "clock: time zone")
    assert "do not change during the run" in calm.found


def test_a_clock_that_cannot_be_right_is_a_problem():
    assert found(check_clock(86400.0, None, None), "clock: UTC").level == "problem"
    assert found(check_clock(NOW, None, NOW + 3600.0), "clock: UTC").level == "problem"
    assert found(check_clock(NOW, None, NOW - 3600.0), "clock: UTC").level == "ok"


@pytest.mark.parametrize(("answer", "level"), [(True, "ok"), (False, "warning"), (None, "ok")])
def test_a_clock_that_nobody_keeps_in_step_is_told(monkeypatch, answer, level):
    assert time_of_day.synchronised() in (True, False, None)
    monkeypatch.setattr(time_of_day, "synchronised", lambda: answer)
    assert found(check_clock(NOW, None, None), "clock: in step").level == level


@pytest.mark.parametrize(
    ("version", "level"),
    [
        ("3.40.1", "problem"), ("3.44.6", "ok"), ("3.50.6", "problem"), ("3.50.7", "ok"), ("3.51.2", "problem"),
        ("3.51.3", "ok"), ("3.53.0", "ok"),
    ],
)  # fmt: skip
def test_versions_of_sqlite_with_the_wal_reset_bug(version, level):
    assert check_sqlite(version).level == level


def test_sleep_battery_and_automatic_restarts(tmp_path):
    def write(path, text):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)

    assert [f.level for f in check_power(tmp_path)] == ["ok"]
    write("sys/power/state", "freeze mem disk\n")
    assert found(check_power(tmp_path), "sleep").level == "warning"
    write("etc/systemd/logind.conf", "[Login]\n#IdleAction=ignore\nIdleAction=suspend\n")
    assert found(check_power(tmp_path), "sleep").level == "problem"
    (tmp_path / "etc/systemd/system").mkdir()
    (tmp_path / "etc/systemd/system/sleep.target").symlink_to("/dev/null")
    assert found(check_power(tmp_path), "sleep").level == "ok"
    write("sys/class/power_supply/BAT0/type", "Battery\n")
    write("sys/class/power_supply/BAT0/status", "Discharging\n")
    assert found(check_power(tmp_path), "power").level == "problem"
    write("etc/apt/apt.conf.d/50unattended-upgrades", 'Unattended-Upgrade::Automatic-Reboot "true";\n')
    assert found(check_power(tmp_path), "restarts").level == "warning"


# --- people -----------------------------------------------------------------------------------------------------------


def test_a_test_message_is_sent_over_every_channel_on_request_only(tmp_path, quiet):
    settings = tmp_path / "notify.toml"
    secret = tmp_path / "hook"
    with serving(Hook()) as hook:
        secret.write_text(hook.url())
        secret.chmod(0o644)
        settings.write_text(
            f'[[channel]]\nkind = "webhook"\nurl_file = "{secret}"\n[[channel]]\nkind = "command"\nargv = ["false"]\n'
        )
        arguments = ("doctor", "--notify-file", settings, "--out", tmp_path, "--json")
        asked = json.loads(rig(*arguments, env=quiet).stdout)
        assert hook.received == []
        tried = rig(*arguments, "--notify", env=quiet)
    assert found_json(asked, "notifications")["level"] == "ok"
    assert "may be read by others" in found_json(asked, "notifications: secrets")["found"]
    assert tried.returncode == 1
    said = json.loads(tried.stdout)
    assert found_json(said, "notifications: webhook")["level"] == "ok"
    assert found_json(said, "notifications: command")["level"] == "problem"
    assert hook.received[0].content["event"] == "test"


def found_json(said, check):
    return next(f for f in said["findings"] if f["check"] == check)


def test_no_check_waits_for_a_person_or_starts_a_thread(tmp_path, quiet):
    before = threading.active_count()
    rig("doctor", "--out", tmp_path, env=quiet)
    assert threading.active_count() == before


def test_a_due_date_that_the_register_states_is_found_there(tmp_path):
    """The bench file has none; the weights' is over, the voltmeter's is not, and of the lamp nobody states one."""
    text = '[instruments.x]\ndriver = "keysight-34401a"\naddress = "/dev/x"\nasset = "M-1"\n'
    for name, asset in (("operator", "W-1"), ("lamp", "L-1")):
        text += f'[instruments.{name}]\ndriver = "person"\nasset = "{asset}"\n'
    (tmp_path / "bench.toml").write_text(f'name = "b"\n{text}[sensors.s]\nreader = "x"\n')
    certificate = '[equipment.{0}.certificate]\nnumber = "n"\nlaboratory = "l"\ndate = 2020-01-01\ndue = {1}\n'
    certificates = certificate.format("M-1", "2999-01-01") + certificate.format("W-1", "2020-06-01")
    (tmp_path / "equipment.toml").write_text(f'name = "r"\n[laboratory]\nname = "l"\naddress = "a"\n{certificates}')
    done = rig("doctor", "--bench", tmp_path / "bench.toml", "--dry", "--json")
    told = {
        one["check"]: one["found"] for one in json.loads(done.stdout)["findings"] if "calibration of" in one["check"]
    }
    assert told["calibration of x"] == "is due on 2999-01-01"
    assert told["calibration of operator"].startswith("was due on 2020-06-01")
    assert told["calibration of lamp"] == "no due date in the bench file or its register of equipment"


def test_an_instrument_that_is_not_the_one_of_the_register_is_told_before_the_night(tmp_path):
    """It was found when the certificate was refused, after the night."""
    it = Foreign()
    try:
        text = BENCH.format(ports=it.ports, meter='asset = "D-1"', source="")
        (tmp_path / "bench.toml").write_text(text)
        entry = '[equipment.D-1]\nmodel = "3458A"\n'
        (tmp_path / "equipment.toml").write_text(f'name = "r"\n[laboratory]\nname = "l"\naddress = "a"\n{entry}')
        done = rig("doctor", "--bench", tmp_path / "bench.toml", "--json")
        (tmp_path / "equipment.toml").write_text((tmp_path / "equipment.toml").read_text().replace("3458A", "DAQ-34"))
        right = rig("doctor", "--bench", tmp_path / "bench.toml", "--json")
    finally:
        it.close()
    found = [one["found"] for one in json.loads(done.stdout)["findings"] if one["check"] == "daq"]
    assert found[1] == "its model is DAQ 34; the register says 3458A of D-1"
    assert done.returncode != 0
    assert len([one for one in json.loads(right.stdout)["findings"] if one["check"] == "daq"]) == 1
