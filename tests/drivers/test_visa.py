"""Instruments at VISA addresses: the wire on pyvisa-sim, dry runs without pyvisa, locks, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import pyvisa

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.bench.plugins import driver_class
from rig.drivers.clock import RealClock
from rig.drivers.errors import NoReply, Unreachable
from rig.drivers.wires import SerialSettings, Wires
from rig.drivers.wires.visa_address import VisaAddress
from rig.errors import ConfigurationError
from rig.instruments.locks import wire_of
from rig.instruments.opening import open_bench
from rig.simulated.dry_run import DryBench
from rig.unattended.doctor.addresses import check_addresses
from rig.unattended.systemd_unit import ServiceUnit

Keysight34401A = driver_class("keysight-34401a")

METERS = Path(__file__).parents[1] / "visa" / "meters.yaml"
BENCH = """
name = "lab"
[instruments.dvm]
driver = "keysight-34401a"
address = "{address}"
{more}
[sensors.x]
axis = "x"
reader = "dvm"
"""


class Tapped:
    """What went over the wire."""

    def __init__(self) -> None:
        self.sent: list[str] = []

    def __call__(self, _: str, direction: str, data: bytes) -> None:
        if direction == "tx":
            self.sent.append(data.decode().strip())


@pytest.fixture
def simulated(monkeypatch):
    """pyvisa-sim as the VISA library, with a device file."""

    def use(devices: str) -> Tapped:
        monkeypatch.setenv("PYVISA_LIBRARY", f"{devices}@sim")
        return Tapped()

    yield use
    for manager in list(pyvisa.ResourceManager("@sim").list_opened_resources()):
        manager.close()


def test_a_34401a_on_gpib_reads_without_any_change_to_its_driver(simulated):
    """pyvisa-sim has no SYST:REM for it; had it been sent, preparing would raise its error."""
    tap = simulated(str(METERS))
    dvm = Keysight34401A(
        "dvm", "visa://GPIB0::22::INSTR", Keysight34401A.Options(nplc=0.02), Wires(RealClock(), tap=tap), RealClock()
    )
    assert dvm.identify().model == "34401A"
    assert dvm.restarted()
    dvm.prepare()
    assert not dvm.restarted()
    dvm.start(2)
    assert dvm.fetch() == {"input": [1.25, 1.250001]}
    dvm.start(2)
    assert dvm.fetch() == {"input": [1.25, 1.250001]}
    assert "SYST:REM" not in tap.sent
    assert "\x03" not in tap.sent, "device clear is the bus's"
    dvm.make_safe()
    dvm.close()


def test_nothing_is_read_from_the_bus_before_something_was_asked(simulated, monkeypatch):
    simulated("")
    wires = Wires(RealClock())
    line = wires.serial("visa://GPIB0::9::INSTR", SerialSettings(9600), "source")
    read = []
    session = line._visa
    real = session._resource.visalib.read
    monkeypatch.setattr(session._resource.visalib, "read", lambda *a: read.append(a) or real(*a))
    line.write("*RST")
    line.drain()
    assert read == []
    assert line.query("*IDN?") == "SCPI,MOCK,VERSION_1.0"
    assert read
    wires.close()


def test_an_instrument_that_does_not_answer_is_asked_once_more_and_only_if_that_is_harmless(simulated):
    tap = simulated("")
    wires = Wires(RealClock(), tap=tap)
    line = wires.serial("visa://GPIB0::9::INSTR", SerialSettings(9600, timeout_s=0.05), "source")
    with pytest.raises(NoReply, match=r"source at visa://GPIB0::9::INSTR answered nothing to 'NONE\?' within 0.05 s"):
        line.query("NONE?")
    assert tap.sent == ["NONE?"] * 2
    with pytest.raises(NoReply):
        line.query("NONE?", repeat=False)
    assert tap.sent == ["NONE?"] * 3
    assert line.query("*IDN?", 2.0) == "SCPI,MOCK,VERSION_1.0"
    wires.close()


def test_an_address_that_nobody_has_is_unreachable(simulated):
    simulated("")
    with pytest.raises(Unreachable, match=r"dvm at visa://GPIB0::30::INSTR cannot be opened .*check power, cable"):
        Wires(RealClock()).serial("visa://GPIB0::30::INSTR", SerialSettings(9600), "dvm")


@pytest.mark.parametrize(
    ("address", "same", "other"),
    [
        ("visa://GPIB0::9::INSTR", "visa://gpib::9", "visa://GPIB1::9::INSTR"),
        ("visa://GPIB0::9::0::INSTR", "visa://GPIB::9::0", "visa://GPIB0::9::INSTR"),
        (
            "visa://USB0::0x2A8D::0x1301::MY1::INSTR",
            "visa://USB1::10893::4865::MY1::0::INSTR",
            "visa://USB0::0x2A8D::0x1301::MY2::INSTR",
        ),
        ("visa://TCPIP::dvm.lab::INSTR", "visa://TCPIP0::DVM.lab.::hislip0::INSTR", "visa://TCPIP::dvm2.lab::INSTR"),
        ("visa://TCPIP::dvm.lab::5025::SOCKET", "socket://dvm.lab:5025", "socket://dvm.lab:5026"),
    ],
)
def test_one_instrument_has_one_lock_whatever_its_name(address, same, other):
    assert wire_of(address) == wire_of(same) != wire_of(other)


def test_names_are_written_in_the_form_of_the_library():
    for address in ("visa://gpib::9::instr", "visa://usb::0x2a8d::4865::my1", "visa://tcpip::dvm.lab::5025::socket"):
        place = VisaAddress.parse(address).place
        assert str(pyvisa.rname.ResourceName.from_string(place)) == place


def test_a_dry_run_is_without_remote_control_as_gpib_is():
    config = parse_bench(BENCH.format(address="visa://GPIB0::22::INSTR", more=""), "bench.toml")
    tap = Tapped()
    dry = DryBench(config, {}, tap=tap)
    dvm = open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires).instruments["dvm"]
    dvm.identify()
    dvm.prepare()
    dvm.start(2)
    assert len(dvm.fetch()["input"]) == 2
    assert "SYST:REM" not in tap.sent
    dry.close()


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("baud = 9600", r"dvm\.baud is of a serial line, and visa://GPIB0::22::INSTR is none"),
        ('frame = "8N1"', r"dvm\.frame is of a serial line"),
        ('interface = "rs232"', r"dvm\.interface is of a serial line"),
        ('flow = "xonxoff"', r'dvm\.flow: flow = "xonxoff" has no meaning at a VISA address'),
    ],
)
def test_settings_of_a_serial_line_are_refused_with_the_bench_file(more, says):
    config = parse_bench(BENCH.format(address="visa://GPIB0::22::INSTR", more=more), "bench.toml")
    with pytest.raises(ConfigurationError, match=says):
        check_options(config, "bench.toml")


WITHOUT = """
import sys
sys.modules["pyvisa"] = sys.modules["pyvisa_py"] = None
from rig.instruments.opening import open_bench
from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.simulated.dry_run import DryBench
from rig.drivers.clock import RealClock
from rig.drivers.errors import Unreachable
from rig.drivers.wires import SerialSettings, Wires
config = parse_bench(sys.argv[1], "bench.toml")
check_options(config, "bench.toml")
dry = DryBench(config, {})
dvm = open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires).instruments["dvm"]
print(dvm.identify().model)
try:
    Wires(RealClock()).serial("visa://GPIB0::22::INSTR", SerialSettings(9600), "dvm")
except Unreachable as error:
    print(error)
"""


def test_without_pyvisa_all_but_opening_works_and_that_says_what_to_install():
    bench = BENCH.format(address="visa://GPIB0::22::INSTR", more="")
    done = subprocess.run([sys.executable, "-c", WITHOUT, bench], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    model, said = done.stdout.splitlines()
    assert model == "34401A"
    assert said.startswith("dvm at visa://GPIB0::22::INSTR needs a VISA library (")
    assert "pip install 'calibration-rig[visa]'" in said


def test_the_doctor_says_what_is_missing_before_a_night(monkeypatch):
    config = parse_bench(BENCH.format(address="visa://GPIB0::22::INSTR", more=""), "bench.toml")
    ((_, found),) = check_addresses(config.instruments)
    assert found.found == "visa://GPIB0::22::INSTR"
    monkeypatch.setattr("rig.unattended.doctor.addresses.find_spec", lambda name: None)
    ((_, found),) = check_addresses(config.instruments)
    assert "needs pyvisa, which is not installed" in found.found
    assert "calibration-rig[visa]" in found.next_step


def test_a_service_of_the_machine_may_open_the_buses_of_its_bench_and_no_others():
    addresses = ("visa://GPIB0::22::INSTR", "visa://TCPIP::dvm.lab::INSTR", "/dev/rig/dvm")
    run = Path("/data/runs/a.sqlite")
    for usb in ((), ("visa://USB0::0x2A8D::0x1301::MY1::INSTR",)):
        unit = ServiceUnit(run, "a", "volts", system=True, user="rig", addresses=(*addresses, *usb))
        allowed = [line for line in unit.text().splitlines() if line.startswith("DeviceAllow=")]
        assert allowed == [
            "DeviceAllow=/dev/rig/dvm rw",
            "DeviceAllow=char-gpib rw",
            *(["DeviceAllow=char-usb_device rw"] if usb else []),
        ]
