"""Simulated nights begin on a day that the register covers, or `rig plan` says so; equipment that nothing names."""

from __future__ import annotations

from datetime import UTC, date, datetime

import pytest
from certificate_lab import ISSUED, REGISTER, settled, stand
from command import rig
from general_lab import BENCH, PROCEDURE, WORLD, written

from rig.bench.config import parse_bench
from rig.register import absent, parse_register, unrecorded
from rig.simulated.calendar import dated
from rig.verbs.budget.evaluation import checked_run
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Refused, make
from rig.verbs.plan.result import plan

WITH_ASSETS = BENCH.replace('driver = "person"', 'driver = "person"\nasset = "W-1"').replace(
    "nplc = 1", 'nplc = 1\nasset = "DVM-1"'
)
LATER = REGISTER.replace("date = 2020-01-01\ndue = 2030-01-01", "date = 2026-06-01\ndue = 2027-06-01")
SPARE = '[equipment.SPARE-9]\nmaker = "Weights"\nmodel = "M2"\n'


def day(register: str, truth=None) -> date | None:
    found = dated(truth or {}, parse_bench(WITH_ASSETS, "bench.toml"), register).get("epoch")
    return found.date() if found else None


@pytest.mark.parametrize(
    ("register", "expected"),
    [
        (REGISTER, None),
        (LATER, date(2026, 6, 1)),
        (REGISTER.replace("due = 2030-01-01", "due = 2021-01-01"), date(2020, 1, 1)),
        (LATER.replace("date = 2020-01-01", "date = 2027-06-01"), None),
        (REGISTER.replace('condition = "clean"', 'condition = "clean"\nreceived = 2026-03-04'), date(2026, 3, 4)),
    ],
    ids=["covered", "later", "expired", "never together", "item received later"],
)
def test_the_usual_night_is_moved_to_a_day_that_the_register_covers(register, expected):
    assert day(register) == expected
    assert day(register, {"epoch": datetime(2026, 1, 1, tzinfo=UTC)}) == date(2026, 1, 1), "a world's own day stays"


def test_a_dry_run_of_a_register_of_later_date_has_no_expired_certificate(tmp_path):
    path = stand(tmp_path, register=LATER)
    assert checked_run(path).reasons == ()
    assert checked_run(path).of.table.provenance["began_utc"][:10] == "2026-06-01"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    (folder / "bench.toml").write_text(WITH_ASSETS)
    (folder / "procedure.toml").write_text(PROCEDURE)
    (folder / "world.toml").write_text(f"epoch = 2026-05-30T18:00:00Z\n{WORLD}")
    (folder / "equipment.toml").write_text(f"{LATER}{SPARE}")
    return folder


def test_plan_says_that_a_world_begins_before_the_register(files):
    found = plan(files / "procedure.toml", files / "bench.toml", world=files / "world.toml")
    (said,) = (one for one in found.overdue if "W-1" in one)
    assert said.endswith(
        "equipment.W-1.certificate.date = 2026-06-01, and this run would begin on 2026-05-30: name the one valid then"
    )
    text = str(list(found.blocks()))
    assert "a dry run in this world begins Saturday 2026-05-30 18:00 UTC" in text
    assert found.now == datetime(2026, 5, 30, 18, tzinfo=UTC)


def test_equipment_that_nothing_on_the_bench_names_is_a_note(files):
    found = plan(files / "procedure.toml", files / "bench.toml")
    assert found.to_json()["not_on_bench"] == ["SPARE-9"]
    assert "in the register and not on the bench: SPARE-9" in str(list(found.blocks()))


BARE = REGISTER.replace('model = "M1"', 'model = "M1"\nserial = "12"')
ABSENT = (
    "The register states no due date of DVM-1: whether a calibration expired is not known.",
    "The register states no serial number of DVM-1: known by the asset number alone.",
    "The register states no range of W-1 (force_kN): whether the certificate covers the settings is not known.",
    "The register states no conditions under which the certificates of DVM-1, W-1 hold: whether the surroundings were "
    "permitted is not known.",
    "No temperature of the room is recorded with the observations: the conditions of the calibration are not known.",
)


def test_what_the_register_does_not_state_is_said_by_plan_and_on_the_page(tmp_path):
    path = stand(tmp_path, register=BARE)
    (tmp_path / "bench.toml").write_text(WITH_ASSETS)
    (tmp_path / "procedure.toml").write_text(PROCEDURE)
    assert plan(tmp_path / "procedure.toml", tmp_path / "bench.toml").to_json()["not_stated"] == list(ABSENT)
    document = make(CertificateRequest((path,), date.fromisoformat(ISSUED), settings=settled(tmp_path))).document
    assert (*document.unstated, *document.unrecorded) == ABSENT
    assert not set(document.deviations) & set(ABSENT), "they are no deviations from the procedure"


def test_nothing_is_said_where_the_register_states_all_of_it():
    whole = BARE.replace("[equipment.DVM-1]\n", '[equipment.DVM-1]\nserial = "13"\n')
    whole = whole.replace(
        'date = 2020-01-01\nlaboratory = "voltage"', 'date = 2020-01-01\ndue = 2031-01-01\nlaboratory = "voltage"'
    )
    whole = whole.replace('behaves = "gain"\n', 'behaves = "gain"\nrange = [0, 10]\n')
    whole = whole.replace("[equipment.DVM-1.certificate]\n", "[equipment.DVM-1.certificate]\nholds_at = {}\n")
    whole = whole.replace("[equipment.W-1.certificate]\n", "[equipment.W-1.certificate]\nholds_at = {}\n")
    config = parse_bench(WITH_ASSETS, "bench.toml")
    register = parse_register(whole, "equipment.toml")
    assert list(absent(register, config)) == []
    assert list(unrecorded(config)) == [ABSENT[4]]
    assert list(unrecorded(config, {"room_degC": (20.0, 21.0)})) == [
        "No temperature of the room is recorded with the observations: the laboratory states that of the room."
    ]


def test_plan_says_everything_in_register_and_settings_that_stops_a_certificate(tmp_path):
    """A chamber without an error was not said by plan, nor a missing country, and the certificate was refused after the
    night.
    """
    without = REGISTER.replace('quantity = "force_kN"', 'quantity = "air_degC"')
    without = without.replace('serial = "77"', "").replace('customer = "Bridge builders"', "")
    path = stand(tmp_path, register=without)
    (tmp_path / "bench.toml").write_text(WITH_ASSETS)
    (tmp_path / "procedure.toml").write_text(PROCEDURE)
    planned = (tmp_path / "procedure.toml", tmp_path / "bench.toml")
    assert "there is no certificate.toml beside the bench file" in " ".join(
        plan(*planned).to_json()["stops_certificate"]
    )
    settings = settled(tmp_path)
    settings.write_text(settings.read_text().replace('country = "GB"', ""))
    assert settings.name == "certificate.toml"
    found = plan(*planned)
    told = found.to_json()["stops_certificate"]
    assert told == [
        "the serial number of cell is missing: add sensors.cell.serial in equipment.toml",
        "the customer is missing: add sensors.*.customer in equipment.toml",
        'the country of the laboratory is missing: add country = "GB" in certificate.toml',
        "if a result depends on it: force_kN: the register states no error of what reads or sets it; add what its "
        "certificate says. equipment.W-1.says.0 is not used: W-1 gives no air_degC, but force_kN; correct the quantity",
    ]
    shown = str(list(found.blocks()))
    assert shown.count("a certificate would be refused:") == 1
    assert all(f"    - {one.partition('[')[0]}" in shown for one in told)
    with pytest.raises(Refused) as refused:
        make(CertificateRequest((path,), date.fromisoformat(ISSUED), settings=settings))
    reasons = {one.replace(str(settings), settings.name) for one in refused.value.reasons}
    assert {one.removeprefix("if a result depends on it: ") for one in told} <= reasons


def test_errors_of_a_world_file_have_its_name_and_the_variables_there_are(tmp_path):
    """`rig run` and `rig doctor` said "world:" for whatever file was given."""
    files = written(tmp_path, world=WORLD.replace("noise", 'hidden = "0.1*valve_side"\nnoise'))
    files[2].rename(tmp_path / "night.toml")
    planned, world = ("procedure.toml", "--bench", "bench.toml"), ("--world", "night.toml")
    lines = ("run", *planned, "--dry"), ("plan", *planned), ("doctor", "--bench", "bench.toml", "--dry")
    for line in lines:
        done = rig(*line, *world, cwd=tmp_path)
        told = " ".join((done.stdout + done.stderr).split())
        assert "night.toml: sensors.cell.hidden: valve_side is not known here" in told, told
        assert "force_side" in told


@pytest.mark.parametrize(
    ("register", "bench", "stated"),
    [
        (REGISTER, WITH_ASSETS, True),
        (REGISTER.replace("due = 2030-01-01\n", ""), WITH_ASSETS, False),
        (REGISTER.replace("due = 2030-01-01\n", ""), WITH_ASSETS.replace("nplc", "due = 2040-01-01\nnplc"), True),
        (REGISTER.replace("W-1]", "W-9]").replace("W-1.", "W-9."), WITH_ASSETS.replace('"W-1"', '"DVM-1"'), False),
    ],
    ids=["in the register", "nowhere", "in the bench file", "of equipment that is not on the bench"],
)
def test_a_plan_says_that_calibrations_are_valid_only_if_a_date_is_stated(tmp_path, register, bench, stated):
    files = written(tmp_path, bench=bench)
    (tmp_path / "equipment.toml").write_text(register)
    said = str(list(plan(*files[:2]).blocks()))
    assert ("every calibration whose date is stated is valid until then" in said) is stated
    assert ("no due date of any calibration is stated" in said) is not stated
