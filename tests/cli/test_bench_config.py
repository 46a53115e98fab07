"""A wrong bench file is explained; addresses are locked against a second controller."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

import pytest

from rig.bench.bench_file import check_options
from rig.bench.config import InstrumentConfig, parse_bench, parse_toml
from rig.errors import BusyError, ConfigurationError
from rig.instruments.locks import locked_addresses

GOOD = """
name = "b"
[instruments.head]
driver = "newport-esp301"
address = "/dev/rig/head"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
[sensors.x]
axis = "x"
reader = "dvm"
"""


def test_the_good_file_is_good():
    assert parse_bench(GOOD, "bench.toml").sensors["x"].channel == "input"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("reader", "raeder"), "did you mean reader?"),
        (('reader = "dvm"', 'reader = "dmv"'), "'dmv' is not an instrument here (known: dvm, head)"),
        (('axis = "x"', 'axis = "w"'), "sensors.x.axis"),
        (('name = "b"', ""), "name is missing"),
        (("[sensors.x]", '[sensors.y]\naxis = "y"\nreader = "dvm"\n[sensors.x]'), "both on channel input of dvm"),
        (('name = "b"', 'name = "b"\nlimits = { pitch_deg = [5, -5] }'), "5 is not below -5"),
        (
            ("[sensors.x]", '[temperatures.t]\nreader = "dvm"\nchannel = "2"\n[sensors.x]'),
            "must end in its unit, _degC",
        ),
        (('address = "/dev/rig/dvm"', 'address = "/dev/rig/dvm"\ndue = "soon"'), "instruments.dvm.due"),
        (("[sensors.x]", "[sensors.x"), "not valid TOML"),
    ],
)
def test_a_wrong_bench_file_is_explained(change, says):
    with pytest.raises(ConfigurationError) as caught:
        parse_bench(GOOD.replace(*change), "bench.toml")
    assert says in str(caught.value)
    assert "bench.toml" in str(caught.value)


def instrument(address: str) -> InstrumentConfig:
    return InstrumentConfig(driver="d", address=address)


def test_an_address_serves_one_controller_at_a_time(tmp_path):
    device = tmp_path / "ttyS9"
    device.touch()
    link = tmp_path / "dvm"
    link.symlink_to(device)
    with locked_addresses({"a": instrument(str(device))}):
        with (
            pytest.raises(BusyError, match="in use by another controller"),
            locked_addresses({"b": instrument(str(link))}),
        ):
            pass
        with locked_addresses({"c": instrument("modbus-tcp://127.0.0.1:5502/1")}):
            pass
    with locked_addresses({"b": instrument(str(link))}):
        pass


def test_two_units_on_one_modbus_wire_are_one_lock_and_no_deadlock():
    units = {name: instrument(f"modbus-tcp://127.0.0.1:5503/{n}") for n, name in enumerate("ab", 1)}
    with (
        locked_addresses(units),
        pytest.raises(BusyError),
        locked_addresses({"c": instrument("modbus-tcp://127.0.0.1:5503/9")}),
    ):
        pass


def test_locks_are_one_for_a_machine_wherever_temporary_folders_are(tmp_path, monkeypatch):
    address = {"a": instrument("modbus-tcp://127.0.0.1:5504/1")}
    holding = (
        "from rig.instruments.locks import locked_addresses as l; from rig.bench.config import InstrumentConfig as I\n"
    )
    holding += f"with l({{'a': I(driver='d', address={address['a'].address!r})}}): print('held', flush=True); input()"
    elsewhere = {**os.environ, "TMPDIR": str(tmp_path)}
    other = subprocess.Popen([sys.executable, "-c", holding], stdin=-1, stdout=-1, text=True, env=elsewhere)
    try:
        assert other.stdout.readline() == "held\n"
        monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "another"))
        with pytest.raises(BusyError, match=rf"process {other.pid} of user {os.getuid()}, .*python"):
            locked_addresses(address).__enter__()
    finally:
        other.communicate("\n", timeout=30)
    with locked_addresses(address):
        pass


def test_a_link_that_somebody_left_in_the_temporary_folder_opens_nothing_to_everybody(tmp_path, monkeypatch):
    private = tmp_path / "private"
    private.mkdir(mode=0o700)
    (tmp_path / "calibration-rig-locks").symlink_to(private)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with locked_addresses({"a": instrument("modbus-tcp://127.0.0.1:5505/1")}):
        pass
    assert private.stat().st_mode & 0o7777 == 0o700
    assert list(private.iterdir()) == []


def test_a_factor_with_two_instruments_is_told_by_its_name():
    text = 'name = "b"\n[factors]\nforce_kN = "one"\nforce_kN = "two"\n'
    with pytest.raises(ConfigurationError, match="force_kN has a value already; give it one"):
        parse_toml(text, "bench.toml")


def test_a_sensor_whose_column_is_that_of_a_factor_is_refused():
    """Its readings stood in the table in place of the settings, and a fit of them was perfect."""
    text = GOOD.replace('axis = "x"', 'unit = "V"').replace("[sensors.x]", "[sensors.input]")
    source = '[instruments.source]\ndriver = "fluke-5520a"\naddress = "/dev/rig/source"\n'
    bench = parse_bench(f'{text}{source}[factors]\ninput_V = "source"\n', "bench.toml")
    with pytest.raises(ConfigurationError, match=r"recorded as input_V, which is factors\.input_V, too"):
        check_options(bench, "bench.toml")
    check_options(bench, "run file", strict=False)
