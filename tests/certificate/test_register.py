"""The register of equipment: read, held against its bench, and kept in the run file."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

import pytest

from rig.bench.config import parse_bench
from rig.errors import ConfigurationError, UsageError
from rig.register import DOCUMENT, check_register, check_validity, parse_register, register_of
from rig.register.equipment_file import Certificate, Constant, Equipment, Laboratory, Register, SensorItem, Statement
from rig.register.needed import needed, stopping
from rig.runs.plans import load_plan
from rig.units.differences import factor

ROOT = Path(__file__).parents[2]
GOOD = re.findall(r"```toml register\n(.*?)```", (ROOT / "docs" / "how_to" / "register.md").read_text(), re.DOTALL)[0]
BENCH = """
name = "b"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
asset = "DVM-0102"
serial = "MY44000001"
due = 2027-01-31
[sensors.x]
axis = "x"
reader = "dvm"
"""


def test_the_register_of_the_document_is_read():
    register = parse_register(GOOD, "equipment.toml")
    said = register.equipment["DVM-0102"].says[0]
    assert (said.behaves, said.expanded, said.k, said.drift) == ("gain", 12.0, 2.0, 20.0)
    assert register.sensors["x"].serial == "1701"
    check_register(register, parse_bench(BENCH, "bench.toml"), "equipment.toml", "bench.toml")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("expanded = 12\nk = 2\nprobability = 0.95\n", ""), "says.0: the uncertainty is missing: add `expanded`"),
        (("expanded = 12", "expanded = -12"), "says.0.expanded: should be greater than or equal to 0 (it is -12)"),
        (("expanded = 12", "expanded = [1, -2]"), "says.0.expanded.1: should be greater than or equal to 0 (it is -2)"),
        (("expanded = 12", 'expanded = "12"'), "says.0.expanded: should be a number, without quotes, or a list in"),
        (("drift = 20", "drift = [[0, 0]]"), "says.0.drift: should have at least 2 entries, not 1"),
        (("probability = 0.95\n", ""), "k = 2 without a probability: add probability"),
        (("k = 2\n", ""), "needs its coverage factor: add k"),
        (("expanded = 12", "expanded = 12\nstandard = 6"), "give the uncertainty twice"),
        (("expanded = 12\nk = 2\nprobability = 0.95", "standard = 6\nk = 2"), "k and probability belong to `expanded`"),
        (('behaves = "gain"\nunit = "ppm"', 'unit = "degC"'), "'degC' does not convert to V, the unit of V"),
        (('unit = "ppm"', 'unit = "uV"'), "a gain is relative, and uV is not"),
        (('unit = "m/s2"', 'unit = "m"'), "place.gravity: unit = 'm' does not convert to m/s2"),
        (("due = 2027-01-31", "due = 2025-01-31"), "due = 2025-01-31 is not after date = 2026-01-31"),
        (("drift = 20", "drfit = 20"), "did you mean drift?"),
        (('behaves = "gain"', 'behaves = "gian"'), "did you mean 'gain'?"),
        (("drift = 20", "table = [[0, 0, 1], [0, 0, 1]]"), "has to increase from row to row"),
        (("drift = 20", "drift = [[0, 0], [90, 1], [60, 2]]"), "drift: days have to increase from row to row"),
        (('serial = "1701"', "drift = [[0, 0], [90, 1]]"), "drift and drift_unit belong together"),
        (("drift = 20", "range = [5, 1]"), "5 is not below 1"),
        (("drift = 20", 'distribution = "triangular"'), "belongs to `half_width`"),
    ],
)
def test_a_wrong_register_is_explained_with_file_and_key(change, says):
    assert change[0] in GOOD
    with pytest.raises(ConfigurationError) as caught:
        parse_register(GOOD.replace(*change), "equipment.toml")
    assert says in str(caught.value)
    assert str(caught.value).count("\n") == 0
    assert re.match(r"equipment\.toml: (equipment\.DVM-0102|place|sensors\.x)", str(caught.value))


def test_percent_of_a_quantity_in_percent_is_refused_unless_it_is_a_gain():
    """0.5 % of 20 % relative humidity is 0.1 of it, or 0.5: a certificate means the latter, the register the former."""
    says = 'quantity = "rh_pct"\nbehaves = "offset"\nunit = "%"\nstandard = 0.5\n'
    text = '[equipment.A]\n[equipment.A.certificate]\nnumber = "1"\ndate = 2026-01-31\nlaboratory = "L"\n'
    text += f"[[equipment.A.says]]\n{says}"
    with pytest.raises(
        ConfigurationError, match=r"equipment\.A\.says\.0: .*two ways: write 'pct' for points of rh_pct"
    ):
        parse_register(text, "equipment.toml")
    for unit, behaves in (("pct", "offset"), ("1", "offset"), ("%", "gain")):
        parse_register(text.replace('"%"', f'"{unit}"').replace('"offset"', f'"{behaves}"'), "equipment.toml")


@pytest.mark.parametrize("model", [Register, Laboratory, SensorItem, Constant, Equipment, Certificate, Statement])
def test_every_key_of_the_register_is_in_its_document(model):
    document = (ROOT / "docs" / "how_to" / "register.md").read_text()
    assert [name for name in model.model_fields if not re.search(rf"(?<![a-z_]){name}(?![a-z_])", document)] == []


def test_statements_without_a_certificate_are_refused():
    text = '[equipment.A]\n[[equipment.A.says]]\nquantity = "V"\nunit = "uV"\nstandard = 1\n'
    with pytest.raises(ConfigurationError, match=r"equipment\.A: .*has no certificate"):
        parse_register(text, "equipment.toml")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('asset = "DVM-0102"', 'asset = "DVM-0103"'), r"equipment\.DVM-0103 is missing, and bench\.toml names it"),
        (('serial = "MY44000001"', 'serial = "MY44000002"'), r"serial = 'MY44000001', and bench\.toml has"),
        (("due = 2027-01-31", "due = 2027-02-28"), r"certificate\.due = 2027-01-31, and bench\.toml has"),
    ],
)
def test_a_register_that_contradicts_the_bench_is_refused(change, says):
    config = parse_bench(BENCH.replace(*change), "bench.toml")
    with pytest.raises(ConfigurationError, match=says):
        check_register(parse_register(GOOD, "equipment.toml"), config, "equipment.toml", "bench.toml")


def test_two_pieces_of_equipment_with_one_serial_number_are_refused():
    other = GOOD.partition("[equipment.DVM-0102]")[2].partition("[equipment.DVM-0102.certificate]")[0]
    second = '[instruments.other]\ndriver = "keysight-34401a"\naddress = "/dev/rig/other"\nasset = "DVM-2"\n'
    register = parse_register(f"{GOOD}\n[equipment.DVM-2]{other}", "equipment.toml")
    with pytest.raises(ConfigurationError, match=r"DVM-0102\.serial and equipment\.DVM-2\.serial are both 'MY4"):
        check_register(register, parse_bench(BENCH + second, "bench.toml"), "equipment.toml", "bench.toml")


@pytest.mark.parametrize(
    ("first", "last", "says"),
    [
        (date(2026, 6, 1), date(2027, 1, 31), ""),
        (date(2027, 1, 31), date(2027, 2, 1), "and the run ended on 2027-02-01: it had expired"),
        (date(2026, 1, 30), date(2026, 1, 31), "and the run began on 2026-01-30"),
    ],
)
def test_a_certificate_has_to_be_valid_during_the_run(first, last, says):
    register, config = parse_register(GOOD, "equipment.toml"), parse_bench(BENCH, "bench.toml")
    if not says:
        check_validity(register, config, "equipment.toml", first, last)
        return
    with pytest.raises(ConfigurationError, match=f"^equipment.toml: equipment.DVM-0102.certificate.*{says}"):
        check_validity(register, config, "equipment.toml", first, last)


def test_that_a_date_is_simulated_is_said_once_of_all_equipment():
    """It stood behind every line."""
    register, config = parse_register(GOOD, "equipment.toml"), parse_bench(BENCH, "bench.toml")
    with pytest.raises(ConfigurationError) as found:
        check_validity(register, config, "equipment.toml", date(2025, 1, 1), date(2031, 1, 1), simulated=True)
    due, begun, why = str(found.value).splitlines()
    assert due.endswith("the run ended on 2031-01-01: it had expired")
    assert begun.endswith("the run began on 2025-01-01")
    assert why == "the date is simulated: make the dry run again with this register"


@pytest.mark.parametrize(
    ("of", "to", "number"),
    [
        ("arcsec", "deg", 1 / 3600),
        ("uV", "mV", 1e-3),
        ("mK", "degC", 1e-3),
        ("psia", "Pa", 6894.757293168),  # NIST SP 811, B.8
        ("mGal", "m/s2", 1e-5),
        ("kN", "lbf", 224.8089431),  # NIST SP 811: 1 lbf = 4.448222 N
        ("V", "degC", None),
        ("parts", "parts", 1.0),
    ],
)
def test_units_of_differences_convert(of, to, number):
    assert factor(of, to) == (number if number is None else pytest.approx(number, rel=1e-9))


@pytest.mark.parametrize("named", [True, False])
def test_a_run_keeps_the_register_of_its_bench(tmp_path, named):
    folder = ROOT / "examples" / "attitude-lab"
    bench = (folder / "bench.toml").read_text()
    head = 'equipment = "ours.toml"\n' if named else ""
    (tmp_path / "bench.toml").write_text(head + bench)
    name = "ours.toml" if named else "equipment.toml"
    assets = re.findall(r'asset = "(.*?)"', bench)
    (tmp_path / name).write_text("".join(f"[equipment.{asset}]\n" for asset in assets))
    plan = load_plan(folder / "procedure.toml", tmp_path / "bench.toml", dry=True)
    assert set(register_of(plan.documents).equipment) == set(assets)
    (tmp_path / name).write_text("[equipment.other]\n")
    with pytest.raises(ConfigurationError, match=r"equipment\.HD-0417 is missing"):
        load_plan(folder / "procedure.toml", tmp_path / "bench.toml", dry=True)
    (tmp_path / name).unlink()
    if named:
        with pytest.raises(ConfigurationError, match=r"ours\.toml does not exist"):
            load_plan(folder / "procedure.toml", tmp_path / "bench.toml", dry=True)
    else:
        assert DOCUMENT not in load_plan(folder / "procedure.toml", tmp_path / "bench.toml", dry=True).documents


def test_a_run_without_a_register_says_how_to_give_one():
    with pytest.raises(UsageError, match="--equipment FILE"):
        register_of({})


def test_what_several_items_lack_is_one_sentence():
    """Four new sensors made sixteen lines of a first plan."""
    register = parse_register(
        '[sensors.a]\nmaker = "M"\n[sensors.b]\n[sensors.c]\nserial = "1"\nmaker = "M"\n', "r.toml"
    )
    told = list(needed(register, dict.fromkeys("abc"), "r.toml"))
    assert [one for one in told if " of " in one and "sensors" in one] == [
        "model, condition as received of a, b, c are missing: add model, condition to [sensors.NAME] of a, b, c in "
        "r.toml",
        "serial number of a, b is missing: add serial to [sensors.NAME] of a, b in r.toml",
        "the maker of b is missing: add sensors.b.maker in r.toml",
    ]
    assert list(stopping(["x_V", "y_V", "t_degC"], ["x_V", "y_V"], ["t_degC"], ["t_degC is odd"])) == [
        "x_V, y_V: the register states no error of what reads or sets each; add what its certificate says",
        "t_degC: the register states no error of what reads or sets it; add what its certificate says. t_degC is odd",
    ]
