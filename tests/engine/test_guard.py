"""The guard: commands checked at the driver whoever gives them, interlocks, rates, the safe state, one controller."""

from __future__ import annotations

import os
import socket
from dataclasses import replace

import ideal_pressure_bench as pressure
import pytest
from ideal_bench import CONFIG, PROCEDURE, ideal_bench, new_run, run_session
from ideal_pressure_bench import PressureBench

from rig.bench.bench_file import check_options
from rig.bench.config import InstrumentConfig, parse_bench
from rig.bench.protection import InterlockConfig, SafetyConfig
from rig.drivers.errors import NoReply
from rig.drivers.roles import Chamber, Head, PressureController, Reader, Referenced, Restartable
from rig.engine.guard import Guard
from rig.engine.safe_state import make_safe
from rig.engine.session import Outcome
from rig.errors import BenchFault, BusyError, ConfigurationError
from rig.examples import example
from rig.instruments.guarded import Refused, guarded
from rig.instruments.locks import holders, locked_addresses, wire_of
from rig.instruments.opening import driver_class, open_bench
from rig.run_file.read.reader import RunReader
from rig.run_file.write.writer import RunWriter
from rig.sims.world import World
from rig.simulated.dry_run import DryBench

ROLES = (Head, Reader, Chamber, PressureController, Restartable, Referenced)


def events(path, status):
    with RunReader.open(path) as reader:
        return [r for r in reader.records("event") if r.status == status]


def opened(lab):
    config = parse_bench((example(lab) / "bench.toml").read_text(), "bench.toml")
    dry = DryBench(config, {})
    return dry, open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires)


# --- commands -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [95.1, -95.1, 1e9, float("nan"), float("inf")])
def test_a_command_beyond_the_limits_never_reaches_the_driver(value):
    world = World(0.0)
    bench, head, _ = ideal_bench(world)
    with pytest.raises(Refused, match=r"pitch_deg = .* was commanded to head, outside -95 to 95"):
        bench.head.move({"roll": 0.0, "pitch": value})
    assert head.sent == []
    bench.head.move({"pitch": 95.0})
    assert head.sent == [{"pitch": 95.0}]


@pytest.mark.parametrize(
    ("name", "role", "command", "good", "bad"),
    [
        ("supply", PressureController, "set_pressure", 5.0, 15.6),
        ("cold_box", Chamber, "set_temperature", -60.0, -141.0),
        ("hot_box", Chamber, "set_temperature", 20.0, 61.0),
    ],
)
def test_pressures_and_temperatures_too(name, role, command, good, bad):
    bench = PressureBench()
    instrument = bench.open(World(0.0)).instruments[name]
    assert isinstance(instrument, role)
    getattr(instrument, command)(good)
    with pytest.raises(Refused):
        getattr(instrument, command)(bad)
    assert getattr(bench, name).sent == [good]


@pytest.mark.parametrize("lab", ["attitude-lab", "pressure-lab"])
def test_a_guarded_driver_plays_the_same_roles(lab):
    dry, bench = opened(lab)
    for name, instrument in bench.instruments.items():
        driver = driver_class(bench.config.instruments[name].driver)
        assert [isinstance(instrument, r) for r in ROLES] == [issubclass(driver, r) for r in ROLES], name
        commanded = issubclass(driver, (Head, Chamber, PressureController))
        assert (type(instrument) is not driver) == commanded
        assert guarded(name, instrument, {}) is instrument, "once is enough"
    bench.close()
    dry.close()


def test_a_program_that_forgets_its_own_check_is_stopped_at_the_driver(tmp_path, monkeypatch):
    """A planted bug: legs that go too far, and a check that says nothing."""
    monkeypatch.setattr(Guard, "check_command", lambda *_: None)
    monkeypatch.setattr("rig.engine.at_point.recovery_legs", lambda *_: [{"pitch": 120.0, "roll": 0.0}])
    path = new_run(tmp_path)
    outcome, _, head, message = run_session(path)
    assert outcome is Outcome.FAULT
    assert "pitch_deg = 120 was commanded to head" in message
    assert head.sent == []
    assert head.safe == 1


# --- interlocks and rates -------------------------------------------------------------------------------------


def with_protection(monkeypatch, interlocks=None, safety=None, limits=None):
    rules = {name: InterlockConfig.model_validate(rule) for name, rule in (interlocks or {}).items()}
    config = pressure.CONFIG.model_copy(
        update={
            "interlocks": rules,
            "safety": SafetyConfig.model_validate(safety or {}),
            "limits": {**pressure.CONFIG.limits, **(limits or {})},
        }
    )
    monkeypatch.setattr(pressure, "CONFIG", config)


def running_into(path, bench, disturb, mend=lambda: None):
    """A session in which something happens after seven points, and what it does about it."""
    done = []

    def on_progress(news):
        if news.done == 7 and not done:
            done.append(True)
            disturb()
        elif news.state == "holding":
            mend()

    return pressure.run_session(path, bench, on_progress=on_progress)


@pytest.mark.parametrize(
    ("rule", "disturb", "says"),
    [
        (
            {"watch": "hot_box.running", "must_be": True, "why": "look at its door switch"},
            lambda b: setattr(b.hot_box, "on", False),
            "interlock it: hot_box.running is false, and must be true; look at its door switch, then resume",
        ),
        (
            {"watch": "cold_box.temperature_degC", "within": [-70, 30]},
            lambda b: setattr(b.cold_box, "offset", -30.0),
            "cold_box.temperature_degC is -",
        ),
        (
            {"watch": "pressure_psia", "within": [0, 4.9]},
            lambda b: None,
            "interlock it: pressure_psia is ",
        ),
        (
            {"watch": "sensor_temperature_degC", "within": [-80, 40]},
            lambda b: setattr(b.dvm, "open_thermometer", True),
            "sensor_temperature_degC cannot be read",
        ),
    ],
)
def test_an_interlock_ends_in_the_safe_state_and_says_where_to_look(tmp_path, monkeypatch, rule, disturb, says):
    with_protection(monkeypatch, {"it": rule})
    path, bench = pressure.new_run(tmp_path), PressureBench()
    outcome, _, message = running_into(path, bench, lambda: disturb(bench))
    assert outcome is Outcome.FAULT, message
    assert says in message
    assert "safe after" in message
    assert bench.supply.safe == 1
    assert bench.supply.value() == pytest.approx(14.7)


def test_an_interlock_may_hold_for_a_person_instead(tmp_path, monkeypatch):
    rule = {"watch": "hot_box.alarms", "then": "hold", "why": "top up the liquid nitrogen"}
    with_protection(monkeypatch, {"nitrogen": rule})
    procedure = pressure.PROCEDURE
    short = procedure.model_copy(update={"recovery": procedure.recovery.model_copy(update={"hold_max_s": 3.0})})
    monkeypatch.setattr(pressure, "PROCEDURE", short)
    path, bench = pressure.new_run(tmp_path), PressureBench()
    held = []

    def on_progress(news):
        bench.hot_box.alarms = ("low level",) if news.done == 7 else ()
        held.extend([news.message] if news.state == "holding" else [])

    outcome, _, message = pressure.run_session(path, bench, procedure=short, on_progress=on_progress)
    assert outcome is Outcome.FAULT
    assert "nobody released it" in message
    assert any("interlock nitrogen: hot_box.alarms says low level; top up the liquid nitrogen" in h for h in held)
    assert not any("alarm" in r.data.get("message", "") for r in events(path, "safe"))


@pytest.mark.parametrize(("for_s", "outcome"), [(3600.0, Outcome.COMPLETE), (0.0, Outcome.FAULT)])
def test_an_interlock_may_bear_a_violation_for_a_while(tmp_path, monkeypatch, for_s, outcome):
    """The cold box begins at 20 degC and is there for minutes."""
    with_protection(monkeypatch, {"it": {"watch": "cold_box.temperature_degC", "within": [-70, 10], "for_s": for_s}})
    found, _, message = pressure.run_session(pressure.new_run(tmp_path), PressureBench())
    assert found is outcome, message


@pytest.mark.parametrize(
    ("limit", "rate", "outcome"),
    [
        ({"pressure_psi_per_s": (-0.6, 0.6)}, 0.5, Outcome.COMPLETE),
        ({"pressure_psi_per_s": (-0.2, 0.2)}, 0.5, Outcome.FAULT),
        ({"cold_box_degC_per_min": (-4, 4)}, 0.05, Outcome.COMPLETE),
        ({"cold_box_degC_per_min": (-1, 1)}, 0.05, Outcome.FAULT),
    ],
)
def test_what_changes_faster_than_the_bench_allows_is_noticed_by_its_readback(
    tmp_path, monkeypatch, limit, rate, outcome
):
    with_protection(monkeypatch, limits=limit)
    path, bench = pressure.new_run(tmp_path), PressureBench()
    found, _, message = pressure.run_session(path, bench)
    assert found is outcome, message
    assert outcome is Outcome.COMPLETE or "faster than" in message
    assert rate in (bench.supply.rate, bench.cold_box.rate)


LAB = (example("pressure-lab") / "bench.toml").read_text()


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('[interlocks.a]\nwatch = "sensor_chamber.alarm"', "needs within"),
        ('[interlocks.a]\nwatch = "sensor_chamber.door"\nwithin = [0, 1]', "which is not read"),
        ('[interlocks.a]\nwatch = "pressure_psi"\nwithin = [0, 1]', "did you mean pressure_psia?"),
        ('[interlocks.a]\nwatch = "sse_chamber.running"', "needs must_be = true or false"),
        ('[interlocks.a]\nwatch = "sse_chamber.alarms"\nwithin = [0, 1]', "does not use within"),
        ('[interlocks.a]\nwatch = "pressure_psia"\nwithin = [1, 0]', "1 is not below 0"),
        (
            "[safety]\nambient_degC = [15, 20]",
            "sensor_chamber.safe_degC = 23 is outside safety.ambient_degC (15 to 20)",
        ),
        ("[safety]\nwithin = 5", "did you mean within_s?"),
        ("[safety]\nambient_psia = [15, 14]", "15 is not below 14"),
    ],
)
def test_a_protection_that_would_protect_nothing_is_explained(more, says):
    with pytest.raises(ConfigurationError) as caught:
        check_options(parse_bench(f"{LAB}\n{more}\n", "bench.toml"), "bench.toml")
    assert says in str(caught.value)


def test_a_driver_that_is_told_to_go_faster_than_the_bench_allows_is_refused():
    text = LAB.replace("[limits]\n", "[limits]\npressure_psi_per_s = [-0.1, 0.1]\n")
    with pytest.raises(ConfigurationError, match=r"supply.vent_psi_per_s = 0.2 is faster than limits.pressure_psi_per"):
        check_options(parse_bench(text, "bench.toml"), "bench.toml")
    text = LAB.replace("[limits]\n", "[limits]\nsse_chamber_degC_per_min = [-1, 1]\n")
    with pytest.raises(ConfigurationError, match=r"sse_chamber.ramp_degC_per_min = 2 is faster"):
        check_options(parse_bench(text, "bench.toml"), "bench.toml")


# --- the safe state -------------------------------------------------------------------------------------------


def safe_of(spoil=lambda _: None, **safety):
    """The safe state of the pressure bench from 5 psia and its chambers at extremes."""
    bench, world = PressureBench(), World(0.0)
    config = pressure.CONFIG.model_copy(update={"safety": SafetyConfig.model_validate(safety)})
    opened_bench = replace(bench.open(world), config=config)
    bench.supply.command(5.0)
    bench.cold_box.command(-60.0)
    bench.hot_box.command(50.0)
    world.sleep(3600.0)
    spoil(bench)
    return bench, make_safe(opened_bench, world), world


def refuses(instrument, times, method="make_safe", error=NoReply):
    def spoil(bench):
        target, left = getattr(bench, instrument), [times]
        do = getattr(target, method)

        def sometimes(*arguments):
            left[0] -= 1
            if left[0] >= 0:
                raise error(f"{instrument} does not answer")
            return do(*arguments)

        setattr(target, method, sometimes)

    return spoil


def test_the_safe_state_is_read_back_and_timed():
    bench, safe, _ = safe_of()
    assert safe.unsafe == ()
    assert safe.words.startswith("safe after ")
    assert 19.0 < safe.seconds < 40.0, "the way to the atmosphere at 0.5 psi/s, and little more"
    assert safe.found["supply"]["pressure_psia"] == pytest.approx(14.7)
    assert safe.found["supply"]["fastest_psi_per_s"] == pytest.approx(0.5, rel=0.1)
    assert [safe.found[box]["setpoint_degC"] for box in ("cold_box", "hot_box")] == [23.0, 23.0]
    assert not bench.supply.on


@pytest.mark.parametrize("instrument", ["supply", "cold_box", "hot_box", "dvm"])
@pytest.mark.parametrize("times", [1, 5])
@pytest.mark.parametrize("error", [NoReply, MemoryError])
def test_what_fails_on_the_way_to_the_safe_state_is_tried_again_and_the_others_do_not_wait(instrument, times, error):
    bench, safe, _ = safe_of(refuses(instrument, times, error=error))
    assert safe.unsafe == ()
    assert all(getattr(bench, name).safe for name in ("supply", "cold_box", "hot_box", "dvm"))


def test_every_instrument_is_tried_however_many_fail():
    def all_fail(bench):
        for name in ("supply", "cold_box", "dvm"):
            refuses(name, 10_000)(bench)
        refuses("supply", 10_000, "vent")(bench)
        refuses("cold_box", 10_000, "read")(bench)

    bench, safe, world = safe_of(all_fail, within_s=60.0)
    assert bench.hot_box.sent[-1] == 23.0
    assert [line.split(":")[0] for line in safe.unsafe] == ["supply", "cold_box"]
    assert safe.silent == ("dvm: dvm does not answer",), "it can do no harm"
    assert 60.0 <= safe.seconds < 75.0
    assert "NOT everything could be brought to its safe state" in safe.words
    assert world.now() == pytest.approx(3600.0 + safe.seconds)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda b: setattr(b.supply, "value", lambda: 5.0), "supply: the line is still at 5.000 psia, not vented"),
        (
            lambda b: setattr(b.cold_box, "command", lambda _: None),
            "cold_box: its setpoint reads -60 degC, not ambient",
        ),
    ],
)
def test_an_instrument_that_says_yes_and_does_nothing_is_not_believed(spoil, says):
    _, safe, _ = safe_of(spoil, within_s=30.0)
    assert safe.unsafe[0].startswith(says)


def test_the_druck_and_the_watlows_are_safe_in_their_stated_time_at_the_slew_they_were_told():
    dry, bench = opened("pressure-lab")
    for instrument in bench.instruments.values():
        instrument.prepare()
    supply = bench.setting("pressure_psia", PressureController)[1]
    supply.set_pressure(5.0)
    for chamber in bench.chambers.values():
        chamber.set_temperature(-50.0)
    dry.world.sleep(300.0)
    safe = make_safe(bench, dry.world)
    assert safe.unsafe == ()
    assert safe.seconds < bench.config.safety.within_s
    assert safe.found["supply"]["fastest_psi_per_s"] < 0.22
    assert [safe.found[name]["setpoint_degC"] for name in bench.chambers] == pytest.approx([23.0, 23.0], abs=1e-4)
    bench.close()
    dry.close()


def test_every_way_out_of_a_run_records_how_the_bench_was_made_safe(tmp_path):
    path = new_run(tmp_path)
    run_session(path)
    (safe,) = events(path, "safe")
    assert safe.data["unsafe"] == []
    assert safe.data["within_s"] == CONFIG.safety.within_s
    assert PROCEDURE.recovery.hold_max_s > 0


# --- one controller -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("modbus-tcp://127.0.0.1:502/1", "modbus-tcp://localhost/7"),
        ("modbus-tcp://LAB-PC:502/1", "modbus-tcp://lab-pc:502/2"),
        ("socket://host:5025", "socket://HOST:5025"),
        ("rfc2217://host:4001", "socket://host:4001"),
        ("COM4", "com4"),
        ("can:socketcan/can0", "can:SocketCAN/can0"),
        ("/dev/tty", "modbus-rtu:///dev/tty/1"),
        ("modbus-rtu:///dev/tty/1", "modbus-rtu:///dev/tty/2"),
        ("can:slcan//dev/tty", "/dev/tty"),
        ("modbus-rtu://socket://host:4001/1", "rfc2217://host:4001"),
    ],
)
def test_one_wire_is_one_lock_under_all_its_names(one, other):
    assert wire_of(one) == wire_of(other)


def test_this_machine_is_one_host_under_all_its_names(monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "Lab-PC.example.org")
    names = ["localhost", "lab-pc", "LAB-PC.example.org", "127.0.0.1", "127.0.1.1", "[::1]", "0.0.0.0", "a.localhost"]
    assert {wire_of(f"socket://{name}:5025") for name in names} == {"tcp:127.0.0.1:5025"}
    assert wire_of("socket://lab-pc2:5025") == "tcp:lab-pc2:5025"
    assert wire_of("socket://192.0.2.7:5025") == "tcp:192.0.2.7:5025"


def test_an_address_of_an_interface_of_this_machine_is_this_machine():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.connect(("192.0.2.1", 9))  # sends nothing; the kernel chooses an interface
        own = asking.getsockname()[0]
    assert wire_of(f"socket://{own}:5025") == "tcp:127.0.0.1:5025"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("modbus-tcp://127.0.0.1:502/1", "modbus-tcp://127.0.0.1:503/1"),
        ("socket://a:5025", "socket://b:5025"),
        ("can:socketcan/can0", "can:socketcan/can1"),
        ("can:socketcan/can0", "can:kvaser/can0"),
        ("/dev/tty", "/dev/ptmx"),
        ("COM4", "COM5"),
    ],
)
def test_two_wires_are_two_locks(one, other):
    assert wire_of(one) != wire_of(other)


def test_a_device_is_one_device_under_a_symbolic_link_whatever_is_spoken_on_it(tmp_path):
    master, slave = os.openpty()
    link = tmp_path / "chambers"
    link.symlink_to(os.ttyname(slave))
    address = [os.ttyname(slave), str(link), f"modbus-rtu://{link}/1", f"can:slcan/{link}"]
    assert len({wire_of(a) for a in address}) == 1
    instruments = {"box": InstrumentConfig(driver="d", address=address[0])}
    others = {"other": InstrumentConfig(driver="d", address=address[2])}
    assert holders(others) == {}
    with locked_addresses(instruments):
        told = holders(others)
        assert f"process {os.getpid()}" in told["other"]
        with pytest.raises(BusyError, match=rf"other: modbus-rtu.* in use .*process {os.getpid()}.*nothing was sent"):
            locked_addresses(others).__enter__()
    assert holders(others) == {}
    os.close(master)
    os.close(slave)


def test_a_lock_that_was_left_by_a_killed_process_is_no_lock():
    instruments = {"a": InstrumentConfig(driver="d", address="socket://lock-of-a-dead-process:5025")}
    child = os.fork()
    if not child:
        locked_addresses(instruments).__enter__()
        os._exit(0)
    os.waitpid(child, 0)
    assert holders(instruments) == {}
    with locked_addresses(instruments):
        assert set(holders(instruments)) == {"a"}


def test_a_run_file_has_one_controller_under_all_its_names(tmp_path):
    path = new_run(tmp_path)
    link, hard = tmp_path / "link.sqlite", tmp_path / "hard.sqlite"
    link.symlink_to(path)
    os.link(path, hard)
    with RunWriter.open(path):
        for other in (path, link, hard):
            with pytest.raises(BusyError, match="in use by another controller"):
                RunWriter.open(other)


def test_limits_are_the_boundarys_own_and_a_fault_of_the_bench():
    assert issubclass(Refused, BenchFault)


FLOW = """name = "flow"
[instruments.valve]
driver = "bronkhorst-modbus"
address = "modbus-tcp://192.0.2.9/1"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
[sensors.x]
reader = "dvm"
[factors]
flow_pct = "valve"
[limits]
flow_pct = [LOW, 90]
"""


def test_a_safe_value_outside_the_limits_of_its_factor_is_refused():
    check_options(parse_bench(FLOW.replace("LOW", "0"), "bench.toml"), "bench.toml")
    with pytest.raises(ConfigurationError, match=r"flow_pct = 10 to 90 does not include the safe_value of valve, 0,"):
        check_options(parse_bench(FLOW.replace("LOW", "10"), "bench.toml"), "bench.toml")
