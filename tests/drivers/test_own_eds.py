"""A bench whose head is somebody's CiA 402 drives: their EDS is a file beside the bench file, with fewer objects."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from buses import EDS, without_objects
from dry import LAB, SHORT, dry, write_short

from rig.bench.bench_file import check_options
from rig.bench.contract_files import read_bench
from rig.errors import ConfigurationError
from rig.run_file.read.reader import RunReader
from rig.runs.plans import load_plan, plan_of, stored_plan
from rig.unattended.doctor.instruments import check_twins
from rig.verbs.page import story

SPARSE = without_objects(EDS, 0x6067, 0x6068, 0x6084, 0x6085, 0x6099, 0x609A, 0x60A8, 0x60A9, 0x60AA)
HEAD = """[instruments.head]
driver = "cia402-pair"
address = "can:socketcan/can0"
eds = "drives/sparse.eds"
velocity_unit = "0.1 rpm"
acceleration_unit = "rpm/s"
turns_per_table_turn = 100
"""
ONE = SHORT.replace("replications = 2", "replications = 1")


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    folder = tmp_path / "bench"
    (folder / "drives").mkdir(parents=True)
    (folder / "drives" / "sparse.eds").write_text(SPARSE)
    text = (LAB / "bench.toml").read_text()
    path = folder / "bench.toml"
    path.write_text(re.sub(r"\[instruments\.head\]\n(?:[^\[\n].*\n|\n)*", HEAD + "\n", text))
    return path


def test_a_run_says_what_the_drives_do_without_and_the_run_file_keeps_their_eds(tmp_path: Path, bench: Path) -> None:
    path = dry(tmp_path / "runs", bench=bench, text=ONE)
    said = [line.what for line in story(path)]
    judged = [
        what
        for what in said
        if what.startswith("head: the EDS has no 6067h that can be set: this program judges whether a target")
    ]
    assert len(judged) == 1, said
    assert sum(what.startswith("head: the EDS has no") for what in said) == 6
    shutil.rmtree(bench.parent)
    with RunReader.open(path) as run:
        plan = stored_plan(run, path, None)
        assert run.documents()["bench.toml"].count("drives/sparse.eds") == 1, "the bench file as it was given"
    assert plan.bench.instruments["head"].options["eds"] == SPARSE


def test_a_file_that_is_not_there_is_a_mistake_in_the_bench_file(tmp_path: Path, bench: Path) -> None:
    procedure = write_short(tmp_path, ONE)
    documents = dict(load_plan(procedure, bench, dry=True).documents)
    (bench.parent / "drives" / "sparse.eds").unlink()
    for read in (lambda: load_plan(procedure, bench, dry=True), lambda: read_bench(bench)):
        with pytest.raises(
            ConfigurationError, match=r"eds \(instruments.head\) file .*drives/sparse.eds does not exist"
        ):
            read()
    del documents["drives/sparse.eds"]
    with pytest.raises(ConfigurationError, match=r"instruments.head.eds = 'drives/sparse.eds' does not exist"):
        plan_of(documents, dry=True)


def test_a_bench_that_leaves_the_unit_out_is_refused_before_anything_moves(tmp_path: Path, bench: Path) -> None:
    bench.write_text(bench.read_text().replace('velocity_unit = "0.1 rpm"\n', ""))
    with pytest.raises(ConfigurationError, match=r"velocity_unit is needed: the EDS has no 60A9h"):
        load_plan(write_short(tmp_path, ONE), bench, dry=True)


def test_doctor_warns_of_what_the_drives_do_without(bench: Path) -> None:
    findings = [one for one in check_twins(read_bench(bench)[0], {}, "", {}) if one.check == "head"]
    assert [one.level for one in findings] == ["ok"] + ["warning"] * 6
    assert findings[1].found.startswith("the EDS has no 6067h that can be set")


def test_a_run_that_was_begun_without_units_goes_on_in_counts_as_before(tmp_path: Path, bench: Path) -> None:
    procedure = write_short(tmp_path, ONE)
    documents = dict(load_plan(procedure, bench, dry=True).documents)
    lines = documents["bench.toml"].splitlines()
    documents["bench.toml"] = "\n".join(line for line in lines if not line.startswith(("velocity_u", "acceleration_u")))
    with pytest.raises(ConfigurationError, match="velocity_unit is needed"):
        plan_of(documents, dry=True)
    stored = plan_of(documents, dry=True, stored=True).bench
    assert stored.instruments["head"].options["velocity_unit"] == "counts/s"
    assert check_options(stored, "bench")["head"].model_dump()["acceleration_unit"] == "counts/s^2"
