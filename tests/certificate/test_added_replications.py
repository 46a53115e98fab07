"""A certificate and a calibration of a run to which a loop added replications: one set of numbers, every file named."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import pytest
from command import rig as command

import rig
from rig.engine.session import Outcome, Signals
from rig.errors import ExitCode
from rig.examples import example
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.tables import FileSource
from rig.tables.segments import joined
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Refused, make
from rig.verbs.data.result import fit_source

LAB = example("load-cell-lab")


@pytest.fixture(scope="module")
def segments(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three replications of the load cell, and one that was added to them."""
    folder, told = tmp_path_factory.mktemp("added"), list[Path]()
    (folder / "world.toml").write_text((LAB / "world.toml").read_text().replace("-0.0006*creep", ""))
    for number, (replications, seed, start_s) in enumerate(((3, 1, 0.0), (1, 4, 20_000.0)), start=1):
        text = (LAB / "procedure.toml").read_text().replace("replications = 3", f"replications = {replications}")
        (folder / "procedure.toml").write_text(text.replace("seed = 1", f"seed = {seed}"))
        plan = load_plan(folder / "procedure.toml", LAB / "bench.toml", dry=True, world=folder / "world.toml")
        done = start_run(
            plan, folder, announce=told.append, signals=Signals(), on_progress=lambda _: None,
            world_start_s=start_s, run_id=f"night-{number}",
        )  # fmt: skip
        assert done.outcome is Outcome.COMPLETE
    return told


def request(segments: list[Path]) -> CertificateRequest:
    run, *added = segments
    return CertificateRequest((run,), date(2026, 7, 1), settings=LAB / "certificate.toml", added=tuple(added))


def test_the_certificate_names_every_file_and_says_that_replications_were_added(segments: list[Path]):
    document = make(request(segments)).document
    assert [one.run_id for one in document.evidence] == ["night-1", "night-2"]
    assert [one.observations for one in document.evidence] == [63, 21]
    assert len({one.head for one in document.evidence}) == 2
    (said,) = [one for one in document.deviations if "Added to it" in one]
    assert said == "Added to it, and evaluated with it as one run, are runs of their own: night-2.sqlite."


def test_its_numbers_are_those_of_all_replications(segments: list[Path]):
    run, _ = segments
    (made,), (alone,) = make(request(segments)).budgets, make(request([run])).budgets
    assert len(made.of.table) == len(joined(segments)) == 84
    fitted = fit_source(FileSource(run), {}, (), keep=True, added=segments[1:]).to_json()
    results = made.evaluation.results
    value = dict(zip(results.names, results.values.tolist(), strict=True))["cell coefficient force_kN"]
    assert value == pytest.approx(fitted["coefficients"]["force_kN"]["estimate"], rel=1e-9)
    by_scatter = [
        next(line for line in one.contributions if line.name == "scatter of readings").standard_uncertainty
        for one in (made.budgets[0], alone.budgets[0])
    ]
    assert by_scatter[0] < by_scatter[1]


def test_the_calibration_keeps_the_influences_of_the_register(segments: list[Path], tmp_path: Path):
    """Before, a calibration of several segments had repeatability only."""
    fitted = fit_source(FileSource(segments[0]), {}, (), keep=True, added=segments[1:])
    assert any("rig infer adds the influences of the register" in note for note in fitted.notes())
    fitted.save(tmp_path / "calibration.json")
    inferred = rig.infer(tmp_path / "calibration.json", {"cell_V": [2.5]}, out=tmp_path / "out.csv")
    assert "total" in (tmp_path / "out.csv").read_text() or "total" in str(inferred.notes())


def test_an_incomplete_replication_is_a_reason_against_a_certificate(segments: list[Path], tmp_path: Path):
    broken = tmp_path / "night-2.sqlite"
    broken.write_bytes(segments[1].read_bytes()[:8192])
    with pytest.raises(Refused, match="night-2"):
        make(request([segments[0], broken]))


def test_rig_fit_takes_them_as_well(segments: list[Path]):
    run, added = segments
    by_hand = json.loads(command("fit", run, "--added", added, "--json").stdout)
    assert by_hand["data"]["points"] == 84
    assert added.name in by_hand["data"]["segments"]
    refused = command("fit", run, "--added", run.with_name("none.sqlite"))
    assert (refused.returncode, "there is no run file" in refused.stderr) == (ExitCode.USAGE, True)
