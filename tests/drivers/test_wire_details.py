"""Wires of foreign instruments: check bytes that end no line, UTF-8, a shared address, logs of Modbus ASCII."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench
from fake_lines import served

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.contracts.declared.instrument import parse
from rig.contracts.declared.sums import Checksum, Frame
from rig.contracts.declared.units import same_unit
from rig.drivers.clock import RealClock
from rig.drivers.declared import driver_of
from rig.drivers.errors import BadReply
from rig.drivers.wires import Wires
from rig.drivers.wires.modbus_rtu import framed
from rig.drivers.wires.modbus_transport import as_ascii
from rig.errors import ConfigurationError
from rig.instruments.opening import open_bench


class TestCheckBytes:
    """A flow controller whose CRC has 00 and 0D increased by one, as 0D ends its lines."""

    KIND = Checksum.model_validate({"kind": "crc16 ccitt", "as": "binary", "never": [0, 13]})

    def test_the_example_of_its_manual(self):
        assert Frame("{line}{checksum}", self.KIND, {}).write("Sinv2.000") == "Sinv2.000\x8f\x55"

    def test_no_line_has_an_end_within_its_check_bytes(self):
        plain = Checksum.model_validate({"kind": "crc16 ccitt", "as": "binary"})
        frame, changed = Frame("{line}{checksum}", self.KIND, {}), 0
        for n in range(3000):
            line = f"Setr{n / 100:.3f}"
            written, before = frame.write(line), Frame("{line}{checksum}", plain, {}).write(line)
            assert not set(written[-2:]) & set("\0\r")
            assert frame.read(written) == (line, "")
            changed += written != before
        assert changed > 10

    def test_a_setting_with_such_a_sum_is_set(self):
        text = r"""
        maker = "ACME"
        model = "F1"
        [wire]
        send_end = "\r"
        request = "{line}{checksum}"
        reply = "{line}{checksum}"
        checksum = { kind = "crc16 ccitt", as = "binary", never = [0, 13] }
        [identity]
        ask = "?Vern"
        answer = "Vern{firmware}"
        [source]
        unit = "L_per_min"
        low = 0
        high = 50
        set = { tell = "!Setr{value:.3}", answer = "Setr{value:.3}" }
        setpoint = { ask = "?Setr", answer = "Setr{value:.3}" }
        safe_value = 0
        """
        frame = Frame("{line}{checksum}", Checksum.model_validate({"kind": "crc16 ccitt", "as": "binary"}), {})
        value = next(n / 1000 for n in range(50_000) if "\r" in frame.write(f"!Setr{n / 1000:.3f}"))
        it = DeclaredBench(text)
        try:
            it.it.identify()
            it.it.prepare()
            it.it.set(value)
            assert it.it.read().setpoint == value
        finally:
            it.close()


THERMOMETER = """
maker = "ACME"
model = "U1"
WIRE
[identity]
ask = "ID?"
answer = "ACME {model}"
[reader]
unit = "degC"
reading = { ask = "T?", answer = "{value:.1} {unit}" }
"""


def reads(text: str, says: bytes, unit: str = "degC") -> float:
    with served({"ID?": b"ACME U1\n", "T?": says}.get) as address:
        driver, clock = driver_of(text.replace('unit = "degC"', f'unit = "{unit}"')), RealClock()
        it = driver("it", address, driver.Options(), Wires(clock), clock)
        try:
            it.identify()
            it.start(1)
            return it.fetch()["input"][0]
        finally:
            it.close()


class TestUtf8:
    @pytest.mark.parametrize(
        ("unit", "said"), [("degC", "23.4 °C"), ("uV", "23.4 µV"), ("uV", "23.4 μV"), ("kohm", "23.4 kΩ")]
    )
    def test_units_beyond_ascii_are_read(self, unit, said):
        text = THERMOMETER.replace("WIRE", '[wire]\nencoding = "utf-8"')
        assert reads(text, f"{said}\n".encode(), unit) == 23.4

    def test_without_it_the_message_says_what_to_write(self):
        """It said that the baud rate might be wrong."""
        with pytest.raises(BadReply, match=r'it may be UTF-8: encoding = "utf-8" at \[wire\]'):
            reads(THERMOMETER.replace("WIRE", ""), "23.4 °C\n".encode())

    def test_bytes_that_are_none_are_refused(self):
        with pytest.raises(BadReply, match="expected text"):
            reads(THERMOMETER.replace("WIRE", '[wire]\nencoding = "utf-8"'), b"23.4 \xb0C\n")

    def test_a_checksum_is_over_its_bytes(self):
        wire = (
            '[wire]\nencoding = "utf-8"\nsend_end = ""\nrequest = "#{line}{checksum};"\nreply = "={line}{checksum};"\n'
        )
        text = THERMOMETER.replace("WIRE", wire + 'checksum = "sum"').replace("{value:.1} {unit}", "{value:.1} °C")
        it = DeclaredBench(text)
        try:
            it.it.identify()
            it.it.start(1)
            assert len(it.it.fetch()["input"]) == 1
            heard = b"".join(data for way, data in it.wire if way == "rx")
            body = heard.split(b";")[1][:-2]
            assert body.endswith(" °C".encode())
            assert heard.split(b";")[1][-2:] == f"{sum(body) & 0xFF:02X}".encode()
        finally:
            it.close()

    def test_signs_of_units(self):
        assert same_unit("MΩ", "Mohm")
        assert not same_unit("mΩ", "Mohm")


CHAMBER = r"""
maker = "ACME"
model = "KF"
[wire]
shared = true
[identity]
ask = "ID?"
answer = "{maker} {model}"
[source]
unit = "UNIT"
low = 0
high = 98
set = { tell = "SET N {value:.1}", answer = "OK" }
setpoint = "SP N?"
read = "PV N?"
safe_value = 20
"""


def test_two_quantities_of_one_chamber_are_two_files_at_one_address(tmp_path):
    """Two files at one socket were refused: "each needs its own"."""
    state = {"1": "20.0", "2": "50.0"}

    def answer(line: str) -> bytes:
        word, _, rest = line.partition(" ")
        if word == "SET":
            number, _, state[number] = rest.partition(" ")
            return b"OK\n"
        return b"ACME KF\n" if word == "ID?" else f"{state[rest[:1]]}\n".encode()

    with served(answer) as address:
        bench = 'name = "b"\n'
        for name in ("air", "humidity"):
            bench += f'[instruments.{name}]\ndriver = "{name}.toml"\naddress = "{address}"\n'
        bench += '[instruments.p]\ndriver = "person"\nreads = { dial = "V" }\nresolution = { dial = 1 }\n'
        bench += '[sensors.x]\nreader = "p"\nchannel = "dial"\n'
        bench += '[factors]\nair_degC = "air"\nhumidity_pct = "humidity"\n'
        config = parse_bench(bench, "bench.toml")
        texts = {
            "air": CHAMBER.replace("UNIT", "degC").replace(" N", " 1"),
            "humidity": CHAMBER.replace("UNIT", "pct").replace(" N", " 2"),
        }

        def with_files(files: dict[str, str]):
            own = {name: config.instruments[name].model_copy(update={"driver": files[name]}) for name in files}
            return config.model_copy(update={"instruments": {**config.instruments, **own}})

        alone = with_files({name: text.replace("shared = true", "") for name, text in texts.items()})
        with pytest.raises(ConfigurationError, match=r"each needs its own.* shared = true"):
            check_options(alone, "bench.toml")
        clock, both = RealClock(), with_files(texts)
        opened = open_bench(both, check_options(both, "bench.toml"), clock, Wires(clock))
        air, humidity = opened.instruments["air"], opened.instruments["humidity"]
        for one in (air, humidity):
            one.identify()
            one.prepare()
        air.set(60.0)
        humidity.set(80.0)
        assert (air.read().setpoint, humidity.read().setpoint) == (60.0, 80.0)
        opened.close()


def test_a_log_of_modbus_ascii_shows_the_characters_on_the_wire():
    """It showed frames of RTU, which were never there."""
    assert as_ascii(framed(1, bytes.fromhex("0310000002"))) == b":010310000002EA\r\n"
    assert as_ascii(b"noise") == b"noise"
    text = """
    maker = "ACME"
    model = "D1"
    [wire]
    protocol = "modbus"
    [identity]
    register = 4096
    is = 241
    [reader]
    unit = "degC"
    reading = { register = 4096, scale = 0.1 }
    """
    heard = []
    with served({":010310000001EB\r": b":01030200F109\r\n"}.get) as address:
        driver, clock = driver_of(text), RealClock()
        wires = Wires(clock, tap=lambda name, way, data: heard.append((way, bytes(data))))
        it = driver("it", f"modbus-ascii://{address}/1", driver.Options(), wires, clock)
        assert it.identify().model == "D1"
        it.close()
    assert heard[:2] == [("tx", b":010310000001EB\r\n"), ("rx", b":01030200F109\r\n")]


def test_keys_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="encoding"):
        parse(THERMOMETER.replace("WIRE", '[wire]\nencoding = "utf-16"'))
