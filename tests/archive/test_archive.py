"""`rig lab`: what is due, histories, recalls; the index is that of the files, whatever happened to them."""

from __future__ import annotations

import json
import os
import random
import re
import threading
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import apsw
import pytest

from rig.archive import Lab, affected, due, history
from rig.archive import index as archive_index
from rig.archive import store as archive_store
from rig.archive.documents import read_kept
from rig.errors import UsageError
from rig.fitter.steps import heard
from rig.verbs.certificate.document import Amendment, Dates, Equipment, Item
from rig.verbs.certificate.measured import Result, ResultTable, Stage, Statement
from tests.support.command import rig
from tests.support.sample_certificate import document

WHAT = "output at force 10 kN"


def write(
    folder: Path,
    number: str,
    on: date,
    *,
    value: float = 5.0,
    serial: str = "S-1",
    used: str = "DVM-1",
    stage: Stage = "",
    next_due: date | None = None,
    replaces: str = "",
    found: float | None = None,
    customer: str = "Meridian",
    simulated: bool = False,
) -> Path:
    """A certificate of a cell, 5 V +- 0.05 V at 10 kN; as found and as left where `found` is given."""
    stages: tuple[tuple[Stage, float], ...] = (
        ((stage, value),) if found is None else (("as found", found), ("as left", value))
    )
    sample = document(simulated=simulated)
    made = replace(
        sample,
        number=number,
        customer=replace(sample.customer, name=customer),
        items=(Item("cell", "load cell", "EXAMPLE", "10 kN" if serial else "", serial, "no damage"),),
        equipment=(Equipment("meter", "", "", "", used, "E-7", "Institute", on - timedelta(200), None),),
        dates=Dates(None, on, on, on + timedelta(1)),
        next_due=next_due,
        amends=Amendment(replaces, on, ("a number",), "0" * 64, replaces, on) if replaces else None,
        tables=tuple(
            ResultTable(
                "cell",
                "results",
                (Result("cell at 10", WHAT, ("10",), "5", "0.0002", "2", "0.95", "V", volt, 1e-4, 2.0, 1e3),),
                stage=one,
            )
            for one, volt in stages
        ),
        statements=tuple(
            Statement("cell", WHAT, "5 ± 0.05 V", "simple", "pass", "0.99", "it conforms", one, "", (4.95, 5.05))
            for one, _ in stages
        ),
    )
    path = folder / f"{number}.json"
    path.write_text(json.dumps(made.to_json()))
    return path


def register(folder: Path, asset: str, due_on: str, serial: str = "") -> Path:
    path = folder / "equipment.toml"
    path.write_text(
        f'name = "r"\n[equipment.{asset}]\nmodel = "34401A"\nserial = "{serial}"\n'
        f'[equipment.{asset}.certificate]\nnumber = "E-7"\ndate = 2024-01-01\ndue = {due_on}\nlaboratory = "I"\n'
    )
    return path


def told(folder: Path) -> dict[str, Any]:
    with Lab.open(folder) as lab:
        return {one.key: one for one in due(lab)}


def content(folder: Path, *, rebuild: bool = False) -> list[tuple[Any, ...]]:
    """Everything in the index but when it was read."""
    with Lab.open(folder, rebuild=rebuild) as lab:
        rows: list[tuple[Any, ...]] = []
        for table in ("file", "certificate", "thing", "item"):
            rows += sorted((table, *map(str, row.values())) for row in lab.rows(f"SELECT * FROM {table}"))
        return rows


def test_an_item_that_drifts_steadily_is_due_when_a_straight_line_leaves_its_tolerance(tmp_path: Path) -> None:
    # 10 mV a year; 5.02 V on 2025-01-01: 5.05 V is reached three years later, but for the uncertainty of the slope.
    for year in range(2021, 2026):
        write(tmp_path, f"C-{year}", date(year, 1, 1), value=5.02 + 0.01 * (year - 2025))
    found = told(tmp_path)["EXAMPLE 10 kN S-1"]
    assert found.drift.by == WHAT
    assert not found.only_known_until
    assert date(2027, 11, 1) < date.fromisoformat(found.on) <= date(2028, 1, 1)


def test_the_earlier_of_cycle_and_drift_counts(tmp_path: Path) -> None:
    for year in range(2021, 2026):
        write(
            tmp_path,
            f"C-{year}",
            date(year, 1, 1),
            value=5.02 + 0.01 * (year - 2025),
            next_due=date(year + 1, 1, 1),
        )
    assert told(tmp_path)["EXAMPLE 10 kN S-1"].on == "2026-01-01"


def test_a_steady_item_is_not_said_to_be_due_beyond_the_length_of_its_history(tmp_path: Path) -> None:
    for year in (2022, 2023, 2024):
        write(tmp_path, f"C-{year}", date(year, 1, 1), value=5.0)
    found = told(tmp_path)["EXAMPLE 10 kN S-1"]
    assert found.only_known_until
    assert found.on == "2025-12-31"


def test_few_calibrations_have_no_drift(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2024, 1, 1))
    write(tmp_path, "C-2", date(2025, 1, 1))
    found = told(tmp_path)["EXAMPLE 10 kN S-1"]
    assert found.on == ""
    assert "fewer than 3" in found.drift.why


def test_an_adjustment_begins_a_new_history_with_what_was_left(tmp_path: Path) -> None:
    for i, year in enumerate((2019, 2020, 2021)):
        write(tmp_path, f"C-{year}", date(year, 1, 1), value=5.0 + 0.02 * i)
    write(tmp_path, "C-2022", date(2022, 1, 1), found=5.06, value=5.0)
    assert "after its adjustment" in told(tmp_path)["EXAMPLE 10 kN S-1"].drift.why
    for i, year in enumerate((2023, 2024)):
        write(tmp_path, f"C-{year}", date(year, 1, 1), value=5.02 + 0.02 * i)
    on = date.fromisoformat(told(tmp_path)["EXAMPLE 10 kN S-1"].on)
    assert date(2024, 4, 1) < on < date(2024, 7, 3)  # 5.04 + 0.02 a year: 5.05 after half a year


def test_equipment_is_due_by_its_register(tmp_path: Path) -> None:
    register(tmp_path, "DVM-1", "2026-03-01")
    assert told(tmp_path)["DVM-1"].on == "2026-03-01"


def test_a_changed_register_is_read_again(tmp_path: Path) -> None:
    path = register(tmp_path, "DVM-1", "2026-03-01")
    told(tmp_path)
    os.utime(tmp_path, ns=(10**18, 10**18))  # long ago: only the file says that it changed
    told(tmp_path)
    path.write_text(path.read_text().replace("2026-03-01", "2027-04-01"))
    assert told(tmp_path)["DVM-1"].on == "2027-04-01"


def test_a_recall_finds_what_used_it_in_the_time_and_what_was_calibrated_with_that(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10), used="DVM-1", serial="A")
    write(tmp_path, "C-2", date(2025, 3, 10), used="DVM-1", serial="REF")  # a reference, calibrated with it
    write(tmp_path, "C-3", date(2025, 4, 10), used="X-9", serial="B")
    write(tmp_path, "C-4", date(2025, 2, 10), used="REF-7", serial="C")  # before the reference was wrong
    write(tmp_path, "C-5", date(2025, 5, 10), used="REF-7", serial="D")
    path = tmp_path / "equipment.toml"
    path.write_text('name = "r"\n[equipment.REF-7]\nmaker = "EXAMPLE"\nmodel = "10 kN"\nserial = "REF"\n')
    with Lab.open(tmp_path) as lab:
        found = affected(lab, "DVM-1", date(2025, 3, 1))
    assert [one.number for one in found] == ["C-2", "C-5"]
    assert found[1].through == ("DVM-1", "EXAMPLE 10 kN REF")


def test_a_recall_names_replaced_certificates_and_what_replaced_them(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    write(tmp_path, "C-1-1", date(2025, 1, 10), replaces="C-1")
    with Lab.open(tmp_path) as lab:
        found = {one.number: one.replaced_by for one in affected(lab, "DVM-1")}
        assert found == {"C-1": "C-1-1", "C-1-1": ""}
        assert [row["number"] for row in history(lab, "S-1").certificates] == ["C-1-1"]


def test_a_recall_by_the_number_of_the_equipments_certificate(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    with Lab.open(tmp_path) as lab:
        assert [one.number for one in affected(lab, "E-7")] == ["C-1"]


def test_a_dry_run_is_no_part_of_the_history_of_a_real_item(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    write(tmp_path, "C-2", date(2026, 1, 10), simulated=True, value=5.2)
    write(tmp_path, "C-3", date(2026, 1, 10), simulated=True, serial="S-2")
    found = told(tmp_path)
    assert (found["EXAMPLE 10 kN S-1"].certificate, found["EXAMPLE 10 kN S-1"].simulated) == ("C-1", False)
    assert found["EXAMPLE 10 kN S-2"].simulated  # all of it is
    with Lab.open(tmp_path) as lab:
        assert [row["number"] for row in history(lab, "S-1").certificates] == ["C-1"]
        assert lab.problems() == ["EXAMPLE 10 kN S-1: its simulated certificates are no part of its history"]


def test_a_look_leaves_the_date_of_the_folder_as_it_is(tmp_path: Path) -> None:
    """Otherwise every look would read the folder again."""
    write(tmp_path, "C-1", date(2025, 1, 10))
    told(tmp_path)
    os.utime(tmp_path, ns=(10**18, 10**18))
    register(tmp_path, "DVM-1", "2026-03-01")
    told(tmp_path)
    os.utime(tmp_path, ns=(10**18, 10**18))
    (tmp_path / "equipment.toml").write_text((tmp_path / "equipment.toml").read_text() + "\n")
    told(tmp_path)  # writes the index
    assert tmp_path.stat().st_mtime_ns == 10**18


def test_something_unknown_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    with Lab.open(tmp_path) as lab:
        with pytest.raises(UsageError, match="nothing is called 'DVM-2'"):
            affected(lab, "DVM-2")
        with pytest.raises(UsageError, match="no certificate is of 'DVM-1'"):
            history(lab, "DVM-1")


def test_items_known_by_their_name_alone_are_apart_by_customer(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10), serial="", customer="A")
    write(tmp_path, "C-2", date(2025, 1, 10), serial="", customer="B")
    assert sorted(told(tmp_path)) == ["cell of A", "cell of B"]


def test_files_that_cannot_be_used_and_contradictions_are_said(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    (tmp_path / "copies").mkdir()
    write(tmp_path / "copies", "C-1", date(2025, 1, 10), value=5.01)
    torn = write(tmp_path, "C-2", date(2025, 1, 10))
    torn.write_text(torn.read_text()[:500])
    register(tmp_path, "DVM-1", "2026-03-01", serial="1")
    (tmp_path / "other").mkdir()
    register(tmp_path / "other", "DVM-1", "2026-03-01", serial="2")
    with Lab.open(tmp_path) as lab:
        problems = lab.problems()
    assert any(one.startswith("C-2.json: ") for one in problems)
    assert any("C-1 is there several times" in one for one in problems)
    assert any("asset DVM-1 is several things" in one for one in problems)


@pytest.mark.parametrize("seed", range(4))
def test_the_index_is_that_of_the_files_whatever_happened_to_them(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    print("seed", seed)
    folders = [tmp_path, tmp_path / "2024", tmp_path / "2025"]
    for folder in folders[1:]:
        folder.mkdir()
    made: list[Path] = []
    for step in range(12):
        match rng.randrange(4):
            case 0 if made:
                made.pop(rng.randrange(len(made))).unlink()
            case 1 if made:
                one = rng.choice(made)
                one.rename(moved := rng.choice(folders) / one.name)
                made[made.index(one)] = moved
            case 2:
                register(rng.choice(folders), "DVM-1", f"2026-0{rng.randrange(1, 9)}-01")
            case _:
                day = date(2020, 1, 1) + timedelta(rng.randrange(2000))
                made.append(write(rng.choice(folders), f"C-{step}", day, value=rng.gauss(5.0, 0.01)))
        if rng.random() < 0.6:
            content(tmp_path)
    before = content(tmp_path)
    assert before == content(tmp_path, rebuild=True)


def test_an_index_in_the_making_says_where_it_is(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    (tmp_path / "2026").mkdir()
    for i in (2, 3):
        write(tmp_path / "2026", f"C-{i}", date(2025, i, 10))
    said: list[str] = []
    parts: list[float] = []
    with heard(lambda done, words: (said.append(words), parts.append(done))):
        told(tmp_path)
    assert "2026: C-3.json" in said
    assert parts == sorted(parts)


def test_a_kill_in_a_refresh_leaves_the_index_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    before = content(tmp_path)
    for i in range(2, 6):
        write(tmp_path, f"C-{i}", date(2025, i, 10))
    real, calls = read_kept, []

    def killed(path: Path) -> Any:
        calls.append(path)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(path)

    monkeypatch.setattr(archive_index, "read_kept", killed)
    with pytest.raises(KeyboardInterrupt):
        told(tmp_path)
    monkeypatch.undo()
    with Lab.open(tmp_path) as lab:
        assert len(lab.rows("SELECT * FROM certificate")) == 5
    assert before != content(tmp_path) == content(tmp_path, rebuild=True)


def test_several_at_once_wait_for_one_another(tmp_path: Path) -> None:
    for i in range(1, 9):
        write(tmp_path, f"C-{i}", date(2025, i, 10))
    wrong: list[BaseException] = []

    def look() -> None:
        try:
            assert len(told(tmp_path)) == 1
        except BaseException as error:
            wrong.append(error)

    threads = [threading.Thread(target=look) for _ in range(6)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert not wrong
    assert content(tmp_path) == content(tmp_path, rebuild=True)


def test_an_index_of_another_version_or_a_damaged_one(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    before = content(tmp_path)
    other = apsw.Connection(str(tmp_path / archive_store.NAME))
    other.pragma("user_version", 99)
    other.close()
    assert content(tmp_path) == before
    (tmp_path / archive_store.NAME).write_bytes(b"no database, but long enough to look like one" * 50)
    with pytest.raises(UsageError, match="remove it"):
        told(tmp_path)


def test_the_command_says_what_is_overdue(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10), next_due=date(2026, 1, 10))
    late = rig("lab", "--folder", tmp_path, "--today", "2026-02-01", "--check", "--json")
    found = json.loads(late.stdout)["answer"][0]
    assert late.returncode == 3
    assert (found["on"], found["days"]) == ("2026-01-10", -22)
    assert rig("lab", "--folder", tmp_path, "--today", "2026-01-01", "--check").returncode == 0
    recall = rig("lab", "recall", "DVM-1", "--folder", tmp_path, "--since", "2025-01-10")
    assert "1 certificate rests on DVM-1 since 2025-01-10" in recall.stdout
    item = rig("lab", "item", "S-1", "--folder", tmp_path)
    assert "5.00000 +- 0.00010 V" in " ".join(re.sub("[│\\s]+", " ", item.stdout).split())
    assert "rig lab item ASSET" in rig("lab", "item", "--folder", tmp_path).stderr


def test_what_is_due_is_sent_over_the_channels_of_notify(tmp_path: Path) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10), next_due=date(2026, 1, 10))
    write(tmp_path, "C-2", date(2025, 1, 10), next_due=date(2026, 9, 10), serial="S-2")
    notify = tmp_path / "notify.toml"
    got = tmp_path / "got.txt"
    notify.write_text(f"[[channel]]\nkind = 'command'\nargv = ['sh', '-c', 'printf %s \"$RIG_WHAT\" > {got}']\n")
    asked = ("lab", "--folder", tmp_path, "--remind", "--today")
    assert rig(*asked, "2025-12-01", env={"RIG_NOTIFY": str(notify)}).returncode == 0
    assert not got.exists()  # nothing within 30 days
    assert rig(*asked, "2026-01-01", env={"RIG_NOTIFY": str(notify)}).returncode == 0
    assert "S-1 cell 10 kN (Meridian): 2026-01-10, in 9 days; by its cycle" in got.read_text()
    assert "S-2" not in got.read_text()
    notify.write_text("[[channel]]\nkind = 'command'\nargv = ['false']\n")
    failed = rig(*asked, "2026-01-01", env={"RIG_NOTIFY": str(notify)})
    assert failed.returncode == 2
    assert "not everybody was reminded" in failed.stderr
