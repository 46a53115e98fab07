"""`rig certificate` of a CSV table: the results of a run, and what is not known without a run file."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from certificate_lab import ISSUED, REGISTER, SETTINGS, settled, stand
from command import rig

from rig.verbs.certificate.layout import sections
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Refused, make

DAY = date.fromisoformat(ISSUED)
TABLE = """[table]
began = 2026-11-20
models = { cell_V = "1 + force_kN" }
given_by = { cell_V = "DVM-1", force_kN = "W-1" }
"""


@pytest.fixture
def lab(tmp_path):
    """A folder with a register, and what makes a document of a table in it."""
    (tmp_path / "equipment.toml").write_text(REGISTER)

    def made(*tables: str, text: str = SETTINGS, table: str = TABLE, **more: object):
        paths = tuple(tmp_path / f"{number}.csv" for number in range(len(tables)))
        for path, written in zip(paths, tables, strict=True):
            path.write_text(written)
        settings = tmp_path / "certificate.toml"
        settings.write_text(text.replace("[method]", f"{table}\n[method]"))
        return make(CertificateRequest(paths, DAY, settings=settings, **more)).document  # type: ignore[arg-type]

    return made


def cells(*, cube: float = 0.0, gross: float = 0.0, columns: str = "replicate,force_kN,cell_V,room_degC") -> str:
    """Four replications of weights on a load cell."""
    rng = np.random.default_rng(4)
    given = []
    for n, (replicate, force) in enumerate((r, f) for r in range(4) for f in (0, 1, 2, 4, 5, 4, 2, 1, 0)):
        volts = 0.1 + 0.5 * force + cube * force**3 + rng.normal(0, 1e-4) + gross * (n == 13)
        row = {"elapsed_s": 60 * n, "replicate": replicate, "force_kN": force, "cell_V": volts}
        row["room_degC"] = 20 + 0.1 * (n % 5)
        given.append(",".join(f"{row[name]:.9g}" for name in columns.split(",")))
    return "\n".join([columns, *given]) + "\n"


def reasons(make_it, *tables, **more) -> str:
    with pytest.raises(Refused) as refused:
        make_it(*tables, **more)
    return "\n".join(refused.value.reasons)


def test_the_table_of_a_run_has_the_results_of_the_run(tmp_path):
    """Exported as CSV, with the same register: values, uncertainties, factors, conformity, conditions."""
    run = stand(tmp_path / "run")
    tolerance = '[[tolerance]]\nresult = "output at force 4 kN"\nunit = "V"\nnominal = 2.1\ndeviation = 0.01\n'
    of_run = make(CertificateRequest((run,), DAY, settings=settled(tmp_path, tolerance))).document
    done = rig("export", run, "--out", tmp_path / "run.csv")
    assert done.returncode == 0, done.stderr
    (tmp_path / "table").mkdir()
    (tmp_path / "table/equipment.toml").write_text(REGISTER)
    settings = settled(tmp_path / "table", tolerance, SETTINGS.replace("[method]", f"{TABLE}[method]"))
    of_table = make(CertificateRequest((tmp_path / "run.csv",), DAY, settings=settings)).document
    assert of_table.tables == of_run.tables
    assert of_table.statements == of_run.statements
    assert of_table.budgets == of_run.budgets
    assert of_table.conditions == of_run.conditions
    assert of_table.items == of_run.items
    assert [one.certificate for one in of_table.equipment] == [one.certificate for one in of_run.equipment]
    assert of_table.simulated is of_run.simulated is True


def test_what_is_not_known_without_a_run_file_is_said(lab):
    bare = lab(cells(columns="force_kN,cell_V"))
    told = " ".join(bare.deviations)
    for words in (
        "There is no run file: the record of this calibration is the table 0.csv with 36 rows",
        "No instrument reported its identity",
        "No environment was recorded",
        "nor are times (elapsed_s) and replications (replicate)",
        bare.evidence[0].head,
    ):
        assert words in told
    assert bare.conditions == ()
    full = lab(cells(columns="elapsed_s,replicate,force_kN,cell_V,room_degC"))
    told = " ".join(full.deviations)
    assert "No environment" not in told
    assert "nor are" not in told
    assert [one.name for one in full.conditions] == ["room_degC"]
    assert full.dates.began == full.dates.ended == date(2026, 11, 20)
    assert full.method.sentences[-1] == "Evaluated from the table 0.csv: 36 observations."
    words = json.dumps([str(one) for one in sections(full)])
    assert "there is no run file. Its SHA-256" in words
    assert "rig verify" not in words


def test_a_table_of_others_says_how_it_was_read(lab):
    """Semicolons, a decimal comma, and a row without a value."""
    rows = [line.replace(",", ";").replace(".", ",") for line in cells().splitlines()]
    rows[7] = ";".join(["1", "1", "", "20,5"])
    found = lab("\n".join(rows))
    told = " ".join(found.deviations)
    assert "cells separated by semicolons; decimal comma" in told
    assert "1 row left out without a value in cell_V (row 8)" in told
    assert found.evidence[0].observations == 35


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('force_kN = "W-1"', 'force_kN = "W-2"'), "equipment.W-2 is missing, and table.given_by.force_kN of"),
        ((', force_kN = "W-1"', ""), "force_kN: the register states no error of what reads or sets it"),
        (("2026-11-20", "2031-11-20"), "equipment.W-1.certificate.due = 2030-01-01, and the run ended on 2031-11-20"),
        (("2026-11-20", "2026-11-25"), "issued on 2026-11-24, before the run ended on 2026-11-25"),
        (("1 + force_kN", "1 + load_kN"), "there is no column 'load_kN'"),
        (("1 + force_kN", "1 + ("), "table.models.cell_V"),
    ],
)
def test_what_contradicts_the_table_is_refused(lab, change, words):
    assert words in reasons(lab, cells(), table=TABLE.replace(*change))


def test_a_table_needs_its_section_and_names_with_units(lab, tmp_path):
    assert "certificate.toml has no [table]" in reasons(lab, cells(), table="")
    wrong = cells(columns="force_kN,cell_V").replace("force_kN", "force")
    table = TABLE.replace("force_kN", "force")
    assert "column 'force' has no unit in its name" in reasons(lab, wrong, table=table)
    (tmp_path / "equipment.toml").unlink()
    assert "has no register of equipment: name one with --equipment" in reasons(lab, cells())


def test_an_effect_is_counted_or_declared(lab):
    """A cubic part: with times it has a line or is in the model; without, it has to be declared."""
    timed = cells(cube=1e-4, columns="elapsed_s,replicate,force_kN,cell_V")
    declared, traced = lab(timed), lab(timed, traced=True)
    assert any("effects beside the declared model" in line.label for line in declared.budgets[0].contributions)
    assert "third-order:force_kN" in declared.models[0]
    assert any("force_kN^3" in one.label for one in traced.tables[0].results)
    told = reasons(lab, cells(cube=1e-4, columns="replicate,force_kN,cell_V"))
    assert "the trace finds third-order:force_kN" in told
    assert "add its term to table.models" in told
    model = TABLE.replace("1 + force_kN", "1 + force_kN + force_kN^3")
    made = lab(cells(cube=1e-4, columns="replicate,force_kN,cell_V"), table=model)
    (cube,) = [one for one in made.tables[0].results if one.label == "coefficient force_kN^3"]
    assert cube.estimate == pytest.approx(1e-4, abs=3 * cube.standard)


def test_gross_errors_are_refused_until_somebody_keeps_them(lab):
    table = cells(gross=0.01)
    told = reasons(lab, table)
    assert "cell_V: gross errors, row 15 is" in told
    made = lab(table, table=TABLE.replace("[table]", "[table]\nkeep = [15]"))
    assert any("Gross errors of cell_V stay in the results: row 15 is" in one for one in made.deviations)


def test_two_tables_are_as_found_and_as_left(lab):
    made = lab(cells(), cells(columns="force_kN,cell_V"), adjustment="Zero was set.")
    assert [one.stage for one in made.evidence] == ["as found", "as left"]
    assert "both files are of the same run" in reasons(lab, cells(), cells(), adjustment="Zero was set.")


def test_all_forms_are_written(tmp_path):
    pytest.importorskip("typst")
    (tmp_path / "equipment.toml").write_text(REGISTER)
    (tmp_path / "t.csv").write_text(cells())
    (tmp_path / "certificate.toml").write_text(SETTINGS.replace("[method]", f"{TABLE}[method]"))
    done = rig("certificate", "t.csv", "--out", "c", "--issued", ISSUED, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    xml = next(Path(tmp_path / "c").glob("*.xml")).read_text()
    assert "Table of 36 observations, without a run file: t.csv, SHA-256 " in xml
    assert len(list((tmp_path / "c").iterdir())) == 4


def test_columns_of_the_room_tell_whether_certificates_hold(lab, tmp_path):
    """One that is not named as the room's may be of a chamber in which the item stood: it tells nothing."""
    conditions = "holds_at = { temperature_degC = [19, 22], humidity_pct = [20, 60] }"
    register = REGISTER.replace('laboratory = "voltage"', f'laboratory = "voltage"\n{conditions}')
    (tmp_path / "equipment.toml").write_text(register)
    damp = "\n".join(
        f"{line},{'humidity_pct' if n == 0 else 40 + n % 3}" for n, line in enumerate(cells().splitlines())
    )
    silent = lab(damp)
    assert [one.found for one in silent.holdings] == ["", ""]
    named = f'{TABLE}room = ["room_degC", "humidity_pct"]\n'
    told = lab(damp, table=named)
    assert [(one.found, one.by) for one in told.holdings] == [
        ("20.00 to 20.40", "room"),
        ("40.00 to 42.00", "humidity"),
    ]
    assert {one.label for one in told.conditions} == {"room", "humidity"}
    (tmp_path / "equipment.toml").write_text(register.replace("[20, 60]", "[20, 41]"))
    assert "holds at humidity 20 to 41 pct, and by humidity_pct it goes from 40 to 42" in reasons(
        lab, damp, table=named
    )
    assert "there is no column 'vault_degC'" in reasons(lab, damp, table=f'{TABLE}room = ["vault_degC"]\n')
