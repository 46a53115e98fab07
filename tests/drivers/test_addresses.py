"""Addresses: what may be opened, and what every command says of anything else before it opens anything."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import serial
from command import rig
from dry import LAB, write_short

from rig.bench.bench_file import check_options
from rig.bench.config import ADDRESSES, parse_bench
from rig.drivers.errors import Unreachable, WrongAddress
from rig.drivers.roles import Reader
from rig.drivers.wires import SerialOptions, SerialSettings, Wires
from rig.drivers.wires.addresses import CanAddress, ModbusAddress, SerialAddress, Wire, parse_address
from rig.drivers.wires.visa_address import VisaAddress
from rig.errors import ConfigurationError
from rig.instruments.opening import open_bench
from rig.sims.world import World
from rig.simulated.dry_run import DryBench

ALLOWED: list[tuple[Wire, str]] = [
    ("serial", "/dev/ttyUSB0"),
    ("serial", "/dev/serial/by-id/usb-FTDI_FT232R_A9001-if00-port0"),
    ("serial", "COM4"),
    ("serial", "socket://192.0.2.7:5025"),
    ("serial", "socket://[2001:db8::7]:5025"),
    ("serial", "rfc2217://serial-server.lab:4001"),
    ("serial", "rfc2217://serial-server.lab:4001?ign_set_control&timeout=5"),
    ("modbus", "modbus-tcp://oven.lab/1"),
    ("modbus", "modbus-tcp://192.0.2.10:502/255"),
    ("modbus", "modbus-rtu:///dev/rig/chambers/2?baud=38400"),
    ("modbus", "modbus-rtu://socket://192.0.2.10:4001/1"),
    ("serial", "/dev/pts/3"),
    ("serial", "visa://GPIB0::9::INSTR"),
    ("serial", "visa://USB0::0x2A8D::0x1301::MY12345678::INSTR"),
    ("serial", "visa://TCPIP::dvm.lab::INSTR"),
    ("serial", "visa://TCPIP0::192.0.2.7::hislip0,4880::INSTR"),
    ("serial", "visa://TCPIP::192.0.2.7::5025::SOCKET"),
    ("serial", "/dev/ttyS0"),
    ("serial", "/dev/rig/watchdog.reader"),
    ("can", "can:udp_multicast/239.0.0.9"),
    ("can", "can:udp_multicast/ff15:7079:7468:6f6e:6465:6d6f:6d63:6173"),
    ("can", "can:socketcan/can0"),
    ("can", "can:slcan//dev/ttyACM0?bitrate=250000"),
    ("can", "can:slcan//dev/ttyACM0@115200"),
]

REFUSED: list[tuple[Wire, str, str]] = [
    ("serial", "GPIB0::9::INSTR", "a VISA name is written visa://GPIB0::9::INSTR"),
    ("serial", "TCPIP::192.0.2.7::5025::SOCKET", "written visa://TCPIP::192.0.2.7::5025::SOCKET"),
    ("serial", "TCPIP0::192.0.2.7::inst0::INSTR", "written visa://TCPIP0::192.0.2.7::inst0::INSTR"),
    ("serial", "ASRL/dev/ttyUSB0::INSTR", "use /dev/ttyUSB0"),
    ("serial", "ASRL3::INSTR", "COM3"),
    ("serial", "USB0::0x2A8D::0x0101::MY1::INSTR", "written visa://USB0::0x2A8D::0x0101::MY1::INSTR"),
    ("serial", "PXI0::1::INSTR", "only those of GPIB, USB and TCPIP instruments"),
    ("serial", "visa://ASRL3::INSTR", "a serial port is opened without VISA"),
    ("serial", "visa://GPIB0::31::INSTR", "GPIB addresses are 0 to 30"),
    ("serial", "visa://GPIB0::INTFC", "is not a resource name of this kind"),
    ("serial", "visa://USB0::0x12345::0x0101::MY1::INSTR", "is not a resource name"),
    ("serial", "visa://USB0::70000::1::MY1::INSTR", "have 16 bits"),
    ("serial", "visa://TCPIP::256.1.1.1::INSTR", "is not an IPv4 address"),
    ("serial", "visa://TCPIP::host::70000::SOCKET", "port 70000 is not 1 to 65535"),
    ("serial", "visa://TCPIP::host::rm -rf::INSTR", "is not a resource name"),
    ("serial", "visa://", "is not a resource name"),
    ("serial", "spy:///dev/ttyUSB0?file=/tmp/x", "spy: is not a wire of this driver, or is not permitted"),
    ("serial", "loop://", "loop: is not"),
    ("serial", "alt:///dev/ttyUSB0?class=PosixPollSerial", "alt: is not"),
    ("serial", "hwgrep://USB", "hwgrep: is not"),
    ("serial", "cp2110://0", "cp2110: is not"),
    ("serial", "socket://host:5025?logging=debug", "takes no options"),
    ("serial", "socket://host", "it names no port"),
    ("serial", "socket://host:70000", "port 70000 is not 1 to 65535"),
    ("serial", "socket://host:0", "port 0 is not"),
    ("serial", "socket://:5025", "is not HOST:PORT"),
    ("serial", "socket://me@host:5025", "is not HOST:PORT"),
    ("serial", "socket://host:5025/1", "is not HOST:PORT"),
    ("serial", "rfc2217://host:4001?logging=debug", "not 'logging'"),
    ("serial", "rfc2217://host:4001?timeout=forever", "not 'timeout'"),
    ("serial", "/dev/ttyUSB0?baud=9600", "a path has no spaces and no options"),
    ("serial", "ttyUSB0", "give the absolute path of a device"),
    ("serial", "/dev/x://spy", "is not"),
    ("serial", "modbus-tcp://host:502/1", "modbus-tcp: is not a wire of this driver"),
    ("serial", "sim://w", "sim:// is for simulated benches"),
    ("modbus", "modbus-tcp://host:502", "does not end in the device's unit"),
    ("modbus", "modbus-tcp://host:x/1", "is not HOST:PORT"),
    ("modbus", "modbus-tcp://host:502/1?baud=9600", "takes no options"),
    ("modbus", "modbus-rtu:///dev/ttyUSB1/300", "unit 300 is not 1 to 247"),
    ("modbus", "modbus-rtu:///dev/ttyUSB1/1?baud=9601", "baud=9601 is not one of"),
    ("modbus", "modbus-rtu:///dev/ttyUSB1/1?", "its options are baud and frame"),
    ("modbus", "modbus-rtu://spy:///dev/ttyUSB1/1", "is not a serial device"),
    ("modbus", "modbus-rtu://socket://host:4001/1?baud=9600", "set at the serial server"),
    ("modbus", "modbus-rtu://socket://host/1", "it names no port"),
    ("modbus", "socket://host:4001", "socket: is not a wire of this driver"),
    ("modbus", "TCPIP::192.0.2.10::502::SOCKET", "for an instrument that takes text"),
    ("modbus", "visa://TCPIP::192.0.2.10::502::SOCKET", "VISA is for instruments that take text"),
    ("can", "can:serial/loop://", "adapters are"),
    ("can", "can:slcan/spy:///dev/ttyACM0", "is not a channel of slcan"),
    ("can", "can:socketcan/can0?interface=virtual", "its only option is bitrate"),
    ("can", "can:socketcan/can0?bitrate=fast", "bitrate=fast is not"),
    ("can", "/dev/ttyACM0", "is not a CAN address"),
    ("can", "visa://GPIB0::9::INSTR", "VISA is for instruments that take text"),
    ("can", "can:udp_multicast/239.0.0.999", "is not a channel of udp_multicast"),
    ("can", "can:udp_multicast/ff15:", "is not a channel of udp_multicast"),
]  # fmt: skip

NO_PORTS = (
    "/dev/null", "/dev/zero", "/dev/stdin",
    "/proc/sysrq-trigger", "/sys/power/state", "/dev/./null", "/dev/../dev/null",
    "/dev/pts/../null", "/dev/..", "/dev/watchdog", "/dev/watchdog0", "/dev/ptmx", "/dev/pts/ptmx", "/dev/port",
    "/dev/kmsg", "/dev/sda", "/dev/sda1", "/dev/nvme0n1p2", "/dev/mapper/root", "/dev/disk/by-id/x",
    "/dev/" + "a" * 300,
)  # fmt: skip
REFUSED += [
    *(("serial", place, "it is not a serial port") for place in NO_PORTS),
    *(("modbus", f"modbus-rtu://{place}/1", "is not a serial device") for place in NO_PORTS),
    *(("can", f"can:slcan/{place}", "is not a channel of slcan") for place in NO_PORTS),
    ("can", "can:slcan//dev/null@115200", "is not a channel of slcan"),
]


@pytest.mark.parametrize(("wire", "address"), ALLOWED)
def test_what_may_be_opened(wire: Wire, address: str) -> None:
    kinds = {"serial": SerialAddress | VisaAddress, "modbus": ModbusAddress, "can": CanAddress}
    found = parse_address(address, wire)
    assert isinstance(found, kinds[wire])
    assert parse_address(address) == found, "a plug-in that does not say what it speaks over gets the same"


@pytest.mark.parametrize(("wire", "address", "why"), REFUSED)
def test_anything_else_is_refused_with_one_sentence_that_says_what_to_write(wire: Wire, address: str, why: str) -> None:
    with pytest.raises(WrongAddress) as refused:
        parse_address(address, wire)
    assert why in str(refused.value)
    assert str(refused.value).startswith(f"{address} is not a")
    assert "; write " in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("address", [a for wire, a, _ in REFUSED if wire == "serial"])
def test_nothing_unknown_reaches_pyserial(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "serial_for_url", lambda *_, **__: pytest.fail("it was opened"))
    with pytest.raises(WrongAddress):
        Wires(World()).serial(address, SerialSettings(9600), "dvm")


@pytest.mark.parametrize("command", ["plan", "run", "doctor"])
@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        ("/dev/rig/scanner", "GPIB0::9::INSTR", "instruments.scanner.address: GPIB0::9::INSTR is not"),
        ("modbus-tcp://192.0.2.10:502/1", "modbus-tcp://192.0.2.10:502", "instruments.enclosure.address: modbus-tcp"),
    ],
)
def test_every_command_that_reads_a_bench_refuses_a_wrong_address(
    tmp_path: Path, command: str, before: str, after: str, sentence: str
) -> None:
    text = (LAB / "bench.toml").read_text()
    assert before in text
    bench = tmp_path / "bench.toml"
    bench.write_text(text.replace(before, after))
    procedure = write_short(tmp_path)
    arguments = {
        "plan": ("plan", procedure, "--bench", bench),
        "run": ("run", procedure, "--bench", bench, "--dry", "--out", tmp_path / "runs"),
        "doctor": ("doctor", "--procedure", procedure, "--bench", bench, "--dry", "--out", tmp_path, "--json"),
    }
    done = rig(*arguments[command])
    assert done.returncode == 78, done.stdout + done.stderr
    said = json.loads(done.stdout)["findings"][0]["found"] if command == "doctor" else done.stderr
    assert sentence in " ".join(said.split())
    assert not (tmp_path / "runs").exists()


def seconds_of_a_reading(address: str, baud: int) -> tuple[float, list[bytes]]:
    """What passed on a dry bench's wire to read a voltmeter five times, and how long that took."""
    config = parse_bench(DVM.format(address=address, baud=baud), "bench.toml")
    heard: list[bytes] = []
    dry = DryBench(config, {}, tap=lambda _, way, data: heard.append(data))
    dvm = open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires).instruments["dvm"]
    assert isinstance(dvm, Reader)
    began = dry.world.now()
    dvm.identify()
    dvm.prepare()
    dvm.start(5)
    dvm.fetch()
    took = dry.world.now() - began
    dry.close()
    return took, heard


DVM = """
name = "lab"
[instruments.dvm]
driver = "keysight-34401a"
address = "{address}"
baud = {baud}
frame = "8N1"
[sensors.x]
axis = "x"
reader = "dvm"
"""


def test_over_tcp_baud_plays_no_part_in_a_dry_run() -> None:
    slow, fast = (seconds_of_a_reading("socket://192.0.2.7:5025", baud) for baud in (300, 9600))
    assert slow == fast
    assert seconds_of_a_reading("/dev/rig/dvm", 300)[0] > seconds_of_a_reading("/dev/rig/dvm", 9600)[0] + 1.0
    assert seconds_of_a_reading("/dev/rig/dvm", 9600)[0] > fast[0]


def test_a_twins_address_in_a_real_bench_file_is_refused() -> None:
    config = parse_bench(DVM.format(address="sim://dry1/dvm", baud=9600), "bench.toml")
    with pytest.raises(ConfigurationError, match=r"instruments\.dvm\.address: sim://dry1/dvm belongs to a twin"):
        check_options(config, "bench.toml")


@pytest.mark.parametrize("flow", ["rtscts", "xonxoff", "dsrdtr"])
def test_flow_control_over_plain_tcp_is_refused_with_the_bench_file(flow: str) -> None:
    def check(address: str, given: str) -> None:
        bench = DVM.format(address=address, baud=9600).replace('frame = "8N1"', f'frame = "8N1"\nflow = "{given}"')
        check_options(parse_bench(bench, "bench.toml"), "bench.toml")

    with pytest.raises(ConfigurationError, match=rf'instruments\.dvm\.flow: flow = "{flow}" cannot be set over TCP'):
        check("socket://192.0.2.7:4001", flow)
    check("socket://192.0.2.7:4001", "none")
    check("rfc2217://192.0.2.7:4001", flow)
    check("/dev/rig/dvm", flow)


def test_a_scanners_own_flow_control_is_no_obstacle_over_tcp() -> None:
    bench = DVM.format(address="socket://192.0.2.7:4001", baud=9600).replace("34401a", "34970a")
    bench = bench.replace('reader = "dvm"', 'reader = "dvm"\nchannel = "101"').replace(
        'frame = "8N1"', 'frame = "8N1"\nchannels = { "101" = "volts" }'
    )
    options = check_options(parse_bench(bench, "bench.toml"), "bench.toml")["dvm"]
    assert isinstance(options, SerialOptions)
    assert (options.flow, options.flow_at("socket://192.0.2.7:4001")) == ("xonxoff", "none")
    assert options.flow_at("/dev/rig/dvm") == "xonxoff"


@pytest.mark.parametrize(
    "address",
    [
        f"socket://{'a' * 70}:4001",
        f"socket://{'a.' * 130}b:4001",
        "socket://256.1.1.1:4001",
        "socket://[127.0.0.1]:4001",
        "can:udp_multicast/127.0.0.1",
        "can:gs_usb/x",
        "can:vector/x",
        "can:kvaser/x",
        "can:ixxat/-1",
        "/dev/null",
        "/dev/zero",
        "/dev/fd/0",
        "/dev",
        "COM0",
        f"/dev/{'x' * 5000}",
        "modbus-rtu:///dev/x/1?baud=9600&baud=19200",
    ],
)
def test_what_cannot_work_is_refused_before_anything_opens(address):
    with pytest.raises(WrongAddress):
        parse_address(address)


@pytest.mark.parametrize(
    "address",
    [
        "socket://[fe80::1]:4001",
        "socket://meter.lab.example:5025",
        "socket://10.0.0.7:5025",
        "can:udp_multicast/239.74.163.2",
        "can:udp_multicast/ff15:7079:7468:6f6e:6465:6d6f:6d63:6173",
        "can:pcan/PCAN_USBBUS1",
        "can:kvaser/0",
        "/dev/ttyUSB0",
    ],
)
def test_what_can_work_is_not_refused(address):
    parse_address(address)


def test_an_adapter_whose_driver_is_not_installed_cannot_be_opened():
    with pytest.raises(Unreachable, match="kvaser 0"):
        Wires(World()).can("can:kvaser/0", "daq")


def test_the_reference_of_files_has_every_form_of_address():
    for wire in ("serial", "modbus", "can"):
        with pytest.raises(WrongAddress) as refused:
            parse_address("nowhere", wire)
        forms = re.findall(r"(?:[a-z0-9-]+:|/dev)/?/?[^ ,]+", str(refused.value).replace("'nowhere'", ""))
        assert len(forms) >= 3
        assert [one for one in forms if one not in ADDRESSES] == []
