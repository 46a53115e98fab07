"""Conditions under which certificates of equipment hold: what tells of them, and that a run outside is refused."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from certificate_lab import ISSUED, REGISTER, settled, stand
from command import rig
from general_lab import BENCH, CHAMBER, PROCEDURE, WORLD, written

from rig.bench.config import parse_bench
from rig.dcc.read_dcc import parsed
from rig.errors import ConfigurationError, ExitCode
from rig.register import KnownConditions, check_register, check_surroundings, holds_of, parse_register
from rig.runs.plans import load_plan
from rig.verbs.budget.evaluation import checked_run
from rig.verbs.budget.found import Found
from rig.verbs.certificate.as_dcc import dcc
from rig.verbs.certificate.document import Document
from rig.verbs.certificate.layout import sections
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Refused, make
from rig.verbs.certificate.runs import read_run
from rig.verbs.certificate.typeset import plain
from rig.verbs.plan import foreseen
from rig.verbs.plan.result import plan
from rig.watch.feed import _temperatures

pytest.importorskip("typst")
TWO_PLACES = f"""{BENCH}
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
channels = {{ "101" = "rtd-4w-385", "102" = "rtd-4w-385" }}
[temperatures.room_degC]
reader = "scanner"
channel = "101"
place = "lab"
[temperatures.box_degC]
reader = "scanner"
channel = "102"
place = "package"
"""
ASSETS = TWO_PLACES.replace('driver = "person"', 'driver = "person"\nasset = "W-1"').replace(
    "nplc = 1", 'nplc = 1\nasset = "DVM-1"'
)
HYGROMETER = """
[[by_hand]]
before_replication = 1
say = "read the hygrometer"
change = "hygrometer"
value = "humidity_pct"
[[by_hand]]
before_replication = 3
say = "read the hygrometer"
change = "hygrometer"
value = "humidity_pct"
"""
DAMP_WORLD = f"{WORLD}states = 42\n"


def holding(conditions: str, more: str = "") -> str:
    """The register, with conditions of the voltmeter's certificate."""
    text = REGISTER.replace('laboratory = "voltage"', f'laboratory = "voltage"\nholds_at = {conditions}')
    return text.replace("[equipment.DVM-1]\n", f"[equipment.DVM-1]\n{more}")


def told_of(
    conditions: str,
    columns: dict[str, list[float]],
    told: KnownConditions | None = None,
    more: str = "",
    bench: str = ASSETS,
) -> str:
    """What is refused of readings; "" for nothing."""
    register, config = parse_register(holding(conditions, more), "equipment.toml"), parse_bench(bench, "bench.toml")
    arrays = {name: np.array(values) for name, values in columns.items()}
    try:
        check_surroundings(register, config, arrays, told or KnownConditions(), "equipment.toml")
    except ConfigurationError as error:
        return str(error)
    return ""


ROOM = "{ temperature_degC = [18, 28] }"


@pytest.mark.parametrize(
    ("columns", "outside"),
    [
        ({"room_degC": [18.0, 28.0]}, False),
        ({"room_degC": [18.0, 28.009]}, False),  # a thousandth of the range, as for ranges of certificates
        ({"room_degC": [20.0, 28.02, 29.0]}, True),
        ({"room_degC": [20.0, float("nan"), 17.0]}, True),
        ({"room_degC": [float("nan")]}, False),
        ({"room_degC": [20.0], "box_degC": [-40.0]}, False),  # in the box stands the item, not the voltmeter
    ],
)
def test_the_thermometers_of_the_room_tell_of_what_stands_in_it(columns, outside):
    said = told_of(ROOM, columns)
    assert bool(said) is outside
    assert not outside or said.startswith("equipment.toml: equipment.DVM-1.certificate.holds_at: the certificate holds")


def test_a_refusal_says_what_was_when_and_what_to_do():
    assert told_of(ROOM, {"room_degC": [20.0, 28.02, 29.0]}).endswith(
        "the certificate holds at temperature 18 to 28 degC, and by room_degC it goes from 20 to 29, outside in 2 of 3 "
        "observations: name a certificate that holds there, or measure again within it"
    )


def test_the_register_says_where_a_standard_stands():
    inside = 'stands_in = "package"\n'
    assert told_of(ROOM, {"room_degC": [20.0], "box_degC": [-40.0]}, more=inside)
    assert not told_of(ROOM, {"room_degC": [50.0], "box_degC": [20.0]}, more=inside)
    by_column = 'stands_in = "box_degC"\n'
    assert told_of(ROOM, {"room_degC": [20.0], "box_degC": [-40.0]}, more=by_column)


AIR = """
[instruments.hygro]
driver = "scpi-meter"
address = "socket://192.0.2.9:5025"
maker = "HYGRO"
model = "H1"
unit = "pct"
reading_s = 0.3
[instruments.baro]
driver = "scpi-meter"
address = "socket://192.0.2.8:5025"
maker = "BARO"
model = "B1"
unit = "hPa"
reading_s = 0.3
[temperatures.rh_pct]
reader = "hygro"
channel = "input"
place = "lab"
[temperatures.air_hPa]
reader = "baro"
channel = "input"
place = "lab"
"""


def test_only_the_same_quantity_tells():
    damp = "{ humidity_percent = [20, 80], air_pressure_kPa = [95, 105] }"

    def said(**columns: float) -> str:
        return told_of(damp, {name: [value] for name, value in columns.items()}, bench=ASSETS + AIR)

    assert not said(room_degC=90.0, rh_pct=50.0, air_hPa=1013.0)
    assert "air pressure 95 to 105 kPa, and by air_hPa it goes from 89 to 89" in said(rh_pct=50.0, air_hPa=890.0)
    assert "by rh_pct it goes from 90" in said(rh_pct=90.0)


def test_a_hygrometer_and_a_barometer_are_recorded_with_the_observations(tmp_path):
    damp = holding("{ humidity_pct = [20, 80], pressure_kPa = [95, 105] }")
    world = f"{WORLD}[lab]\nhumidity_pct = 61\npressure_hPa = 987\n"
    path = stand(tmp_path, register=damp, bench=BENCH + AIR, world=world)
    document = certificate(path, tmp_path)
    assert [(one.label, one.found, one.by) for one in document.holdings] == [
        ("humidity", "61.00 to 61.00", "rh"),
        ("pressure", "98.70 to 98.70", "air"),
    ]
    assert [(one.label, one.mean, one.unit) for one in document.conditions] == [
        ("rh", "61.00", "%"),
        ("air", "987.00", "hPa"),
    ]
    (said,) = (one for one in document.unrecorded if "No temperature of the room is recorded" in one)
    assert "not known" in said
    named = [one.name for one in document.equipment]
    assert "instrument for rh" in named, "it is no thermometer"
    assert not any("thermometer" in one for one in named)


def test_the_live_chart_of_temperatures_has_no_humidity():
    seen = SimpleNamespace(temperatures={"room_degC": (20.0, 0.0, 1), "rh_pct": (45.0, 0.0, 1)}, environment={})
    seen.elapsed_s = 1.0
    told = _temperatures([seen])
    assert "room" in str(told["series"])
    assert "rh" not in str(told["series"])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('channel = "input"\nplace = "lab"', 'channel = "input"'), 'such as humidity_pct, and has place = "lab"'),
        (("temperatures.rh_pct", "temperatures.humid"), "must end in its unit"),
        (
            ("temperatures.rh_pct", "temperatures.force_kN"),
            "temperatures.force_kN is of the room, and factors.force_kN",
        ),
    ],
)
def test_a_hygrometer_is_of_the_room(change, says):
    assert change[0] in AIR
    with pytest.raises(ConfigurationError) as refused:
        parse_bench((BENCH + AIR).replace(*change), "bench.toml")
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("told", "by"),
    [
        (KnownConditions(by_hand={"humidity_pct": (50.0, 85.0)}), "by a person in the run it goes from 50 to 85"),
        (
            KnownConditions(stated={"humidity_pct": (50.0, 85.0)}),
            "by the laboratory's own record it goes from 50 to 85",
        ),
        (KnownConditions(by_hand={"valve_pct": (99.0,)}), ""),
    ],
)
def test_what_no_column_has_may_be_stated(told, by):
    damp = "{ humidity_pct = [20, 80] }"
    assert by in told_of(damp, {}, told)
    assert bool(by) is bool(told_of(damp, {}, told))
    assert not told_of(damp, {}, told, more='stands_in = "package"\n'), "it is of the room"


@pytest.mark.parametrize(
    ("conditions", "says"),
    [
        ("{ temperature = [18, 28] }", "holds_at: 'temperature' has no unit at its end"),
        ("{ temperature_K = [291, 301] }", "holds_at: temperature_K: state a temperature in degC, as temperature_degC"),
        ("{ humidity_pct = [80, 20] }", "holds_at: humidity_pct: 80 is not below 20"),
    ],
)
def test_wrong_conditions_are_refused(conditions, says):
    with pytest.raises(ConfigurationError) as refused:
        parse_register(holding(conditions), "equipment.toml")
    assert says in str(refused.value)


def test_a_place_that_the_bench_does_not_have_is_refused():
    register = parse_register(holding(ROOM, 'stands_in = "oven"\n'), "equipment.toml")
    with pytest.raises(ConfigurationError, match=r"DVM-1\.stands_in = 'oven' is no place of bench\.toml, which has"):
        check_register(register, parse_bench(ASSETS, "bench.toml"), "equipment.toml", "bench.toml")


def test_a_certificate_that_names_no_conditions_is_not_one_of_which_they_are_unknown():
    config = parse_bench(ASSETS, "bench.toml")
    for conditions in ("{}", ROOM):
        register = parse_register(holding(conditions), "equipment.toml")
        assert len(list(holds_of(register, config))) == (conditions == ROOM)


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A stand with two thermometers, whose operator states the humidity."""
    folder = tmp_path_factory.mktemp("stand")
    damp = "{ temperature_degC = [18, 28], humidity_pct = [20, 80], air_pressure_hPa = [900, 1100] }"
    return stand(folder, register=holding(damp), bench=TWO_PLACES, procedure_more=HYGROMETER, world=DAMP_WORLD)


@pytest.fixture(autouse=True)
def no_trace(monkeypatch):
    """No effect is looked for: none is in this world."""
    monkeypatch.setitem(read_run.__globals__, "found_in", lambda *_, **__: Found(()))


def certificate(run: Path, folder: Path, register: str = "", **more: object) -> Document:
    equipment = None
    if register:
        equipment = folder / "other.toml"
        equipment.write_text(register)
    asked = CertificateRequest((run,), date.fromisoformat(ISSUED), settings=settled(folder), equipment=equipment)
    return make(replace(asked, **more)).document  # type: ignore[arg-type]


def page(document: Document) -> str:
    return plain(str([block for section in sections(document) for block in section.blocks]))


def test_the_page_says_what_each_condition_was_and_by_what(files, tmp_path):
    document = certificate(files, tmp_path)
    found = {one.label: (one.limits, one.unit, one.found, one.by) for one in document.holdings}
    table = checked_run(files).of.table.columns["room_degC"]
    assert found == {
        "temperature": ("18 to 28", "°C", f"{table.min():.2f} to {table.max():.2f}", "room"),
        "humidity": ("20 to 80", "%", "42 to 42", "a person in the run"),
        "air pressure": ("900 to 1100", "hPa", "", ""),
    }
    assert not any("not recorded" in one for one in document.deviations), "the table of conditions says it"
    assert "The register states no conditions under which the certificates of W-1 hold" in str(document.unstated)
    assert "not recorded" in page(document)
    told = "".join(parsed(dcc(document), "made.xml").statements)
    assert f"holds at temperature 18 to 28 °C; it was {found['temperature'][2]} °C, by room." in told
    assert "holds at air pressure 900 to 1100 hPa; not recorded." in told


def test_what_the_laboratory_states_of_the_room_stands_with_its_source(files, tmp_path):
    document = certificate(files, tmp_path, room={"air_pressure_hPa": (1001.0, 1009.0)})
    (one,) = (one for one in document.holdings if one.label == "air pressure")
    assert (one.found, one.by) == ("1001 to 1009", "the laboratory's own record")
    assert "not recorded" not in page(document).replace("the run did not record it", "")
    assert "The laboratory states air pressure by its own record; the run did not record it." in page(document)
    (stated,) = (one for one in document.conditions if not one.name)
    assert (stated.minimum, stated.mean, stated.maximum, stated.unit) == ("1001", "", "1009", "hPa")
    assert b"by its own record" in dcc(document)


@pytest.mark.parametrize(
    ("register", "room", "says"),
    [
        (
            holding("{ temperature_degC = [25, 28] }"),
            {},
            "temperature 25 to 28 degC, and by room_degC it goes",
        ),
        (holding("{ humidity_pct = [45, 80] }"), {}, "and by a person in the run it goes from 42 to 42"),
        ("", {"air_pressure_hPa": (850.0, 1009.0)}, "and by the laboratory's own record it goes from 850 to 1009"),
    ],
)
def test_a_run_outside_is_refused_as_beyond_a_range(files, tmp_path, register, room, says):
    with pytest.raises(Refused, match=says):
        certificate(files, tmp_path, register, room=room)
    if register:
        assert says in " ".join(checked_run(files, tmp_path / "other.toml").reasons), "a budget is refused, too"


def test_the_plan_says_what_will_tell_and_what_nothing_records(files):
    told = plan(files.parent / "procedure.toml", files.parent / "bench.toml").to_json()
    assert told["surroundings"] == [
        "certificate of DVM-1 holds at temperature 18 to 28 degC: room_degC will tell, after the run",
        "certificate of DVM-1 holds at humidity 20 to 80 pct: a person states humidity_pct in the run",
    ]
    missing = "Conditions of the certificate of DVM-1, air pressure 900 to 1100 hPa: not recorded in this run."
    assert missing in told["not_stated"]


@pytest.mark.parametrize(("setpoint", "refused"), [(23, False), (35, True)])
def test_the_plan_refuses_what_it_sets_outside(tmp_path, setpoint, refused):
    """A voltmeter in a bath whose temperature the plan sets."""
    bench = TWO_PLACES.replace("[factors]", '[instruments.bath]\ndriver = "person"\n[factors]\nbath_degC = "bath"')
    for name, text in (
        ("bench.toml", bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"')),
        ("procedure.toml", PROCEDURE.replace("[settle]", f"[factors.bath_degC]\nlevels = [20, {setpoint}]\n[settle]")),
        ("equipment.toml", holding(ROOM, 'stands_in = "bath_degC"\n')),
    ):
        (tmp_path / name).write_text(text)
    done = rig("plan", tmp_path / "procedure.toml", "--bench", tmp_path / "bench.toml")
    assert done.returncode == (ExitCode.CONFIGURATION if refused else 0), done.stderr
    said = " ".join((done.stdout + done.stderr).split())
    set_in = "28 degC: bath_degC, which the plan sets within it"
    assert ("and by bath_degC it goes from 20 to 35" if refused else set_in) in said


@pytest.mark.parametrize(("setpoint", "refused"), [(23, False), (35, True)])
def test_the_plan_knows_the_temperature_that_it_keeps_in_the_enclosure(tmp_path, setpoint, refused):
    bench = ASSETS.replace('asset = "W-1"', "") + CHAMBER
    environment = f"[environment]\nsetpoint_degC = {setpoint}\ntolerance_degC = 1\ndwell_s = 60\n"
    files = written(tmp_path, PROCEDURE.replace("[settle]", f"{environment}[settle]"), bench)
    plan_of = load_plan(files[0], files[1])
    register = parse_register(holding(ROOM, 'stands_in = "package"\n'), "equipment.toml")
    set_to = foreseen.settled(plan_of)
    assert set_to == {"box_degC": np.array([setpoint])}
    with pytest.raises(ConfigurationError, match="by box_degC it goes from 35") if refused else nullcontext():
        check_surroundings(register, plan_of.bench, set_to, KnownConditions(), "equipment.toml")


def test_a_person_may_read_the_hygrometer_at_each_point(tmp_path):
    bench = BENCH.replace('driver = "person"', 'driver = "person"\nreads = { dial = "pct" }\nresolution = { dial = 1 }')
    bench += '[temperatures.humidity_pct]\nreader = "operator"\nchannel = "dial"\nplace = "lab"\n'
    path = stand(tmp_path, register=holding("{ humidity_pct = [20, 44] }"), bench=bench)
    (reason,) = checked_run(path).reasons
    assert "by humidity_pct it goes from 45 to 45, outside in 28 of 28 observations" in reason


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("humidity=3..4", "say a quantity with its unit and two numbers"),
        ("humidity_pct=4..3", "say a quantity with its unit and two numbers"),
        ("humidity_pct=wet", "say a quantity with its unit and two numbers"),
        ("humidity_pct=nan..3", "say a quantity with its unit and two numbers"),
        ("temperature_K=293..294", "state a temperature in degC"),
    ],
)
def test_a_wrong_room_is_refused(files, tmp_path, given, says):
    done = rig("certificate", files, "--settings", settled(tmp_path), "--out", tmp_path, "--room", given)
    assert done.returncode == 2
    assert says in " ".join(done.stderr.split())
