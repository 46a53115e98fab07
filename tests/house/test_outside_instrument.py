"""An instrument of another package, installed as pip does it, has all that ours have. No file of the tree names it."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import outside_package
import pytest
from command import rig
from dry import SHORT, dry

from proving.night.campaign import replay
from proving.night.scenario import draw
from rig.bench.bench_file import check_options
from rig.bench.contract_files import read_bench
from rig.errors import BusyError
from rig.explain import explained
from rig.instruments.locks import locked_addresses
from rig.run_file.read.reader import RunReader

SEED = 17
"""A night in which the outside meter's oven goes cold while it measures."""


@pytest.fixture(scope="module", autouse=True)
def _outside() -> Iterator[None]:
    with outside_package.installed():
        yield


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(outside_package.bench_text())
    return path


@pytest.fixture
def quiet(tmp_path: Path) -> dict[str, str]:
    return {"XDG_CONFIG_HOME": str(tmp_path / "config"), "RIG_NOTIFY": ""}


def test_nothing_in_the_tree_names_it():
    root = outside_package.SOURCE.parent.parent
    names = ("acme-m7", "acme_rig", "oven-cold")
    folders = ("rig", "drivers", "sims", "procedures", "fitter", "contracts", "proving", "examples", "pyproject.toml")
    files = [f for folder in folders for f in ([root / folder, *(root / folder).rglob("*")]) if f.is_file()]
    assert len(files) > 300
    text = {f: f.read_bytes() for f in files if f.suffix in (".py", ".toml", ".eds", ".dbc")}
    assert not [f for f, content in text.items() if any(name.encode() in content for name in names)]


def test_the_doctor_asks_it_who_it_is(bench, tmp_path, quiet):
    done = rig("doctor", "--bench", bench, "--dry", "--json", "--out", tmp_path, env=quiet)
    findings = {one["check"]: one for one in json.loads(done.stdout)["findings"]}
    assert findings["scanner"]["level"] == "ok"
    assert findings["scanner"]["found"].startswith("ACME M7, serial number SN")
    assert done.returncode == 0


def test_a_dry_run_is_measured_with_it_and_its_contract_is_kept(bench, tmp_path):
    path = dry(tmp_path / "runs", bench=bench, text=SHORT.replace("replications = 2", "replications = 1"))
    with RunReader.open(path) as run:
        (begun,) = run.records("session")
        for software in (run.genesis().data["software"], begun.data["software"]):
            assert software["acme-rig"] == "1.0"
            assert "calibration-rig" in software
        observed = [r for r in run.records("observation") if r.status == "accepted"]
        assert len(observed) == 15
        assert all(set(r.data["outputs"]) == {"x_V", "y_V", "z_V"} for r in observed)
    config, _ = read_bench(bench)
    assert "oven_cold" in check_options(config, "bench")["scanner"].conditions


def test_its_own_contract_file_may_be_named_beside_the_bench(bench):
    bench.write_text(bench.read_text().replace('asset = "DVM-0777"\n', 'conditions = "mine.toml"\n'))
    (bench.parent / "mine.toml").write_text("[conditions]\noven_cold = 8\n")
    config, texts = read_bench(bench)
    assert texts == {"mine.toml": "[conditions]\noven_cold = 8\n"}
    assert config.instruments["scanner"].options["conditions"] == texts["mine.toml"]


def test_its_address_is_locked(bench):
    config, _ = read_bench(bench)
    with locked_addresses(config.instruments), pytest.raises(BusyError), locked_addresses(config.instruments):
        pass


def test_it_is_served_to_another_process_and_the_doctor_asks_it_there(bench, tmp_path, quiet):
    live = tmp_path / "LIVE.toml"
    command = (sys.executable, "-m", "rig", "sim", bench, "--speed", 20, "--live", live, "--for", 40)
    with subprocess.Popen([*map(str, command)], stderr=subprocess.PIPE, text=True) as server:
        try:
            assert any(line.startswith("serving") for line in server.stderr)
            assert tomllib.loads(live.read_text())["instruments"]["scanner"]["address"].startswith("/dev/pts/")
            done = rig("doctor", "--bench", live, "--json", "--out", tmp_path, env=quiet)
        finally:
            server.kill()
    findings = [one for one in json.loads(done.stdout)["findings"] if one["check"] == "scanner"]
    assert any(one["found"].startswith("ACME M7, serial number SN") for one in findings), findings


def test_its_options_are_in_the_reference():
    assert explained("instruments", "acme-m7").startswith("## `acme-m7`")


@pytest.mark.parametrize("heeded", [True, False])
def test_its_own_fault_strikes_in_a_night_and_everything_holds_if_its_driver_heeds_it(tmp_path, monkeypatch, heeded):
    if not heeded:
        from acme_rig.driver import AcmeM7  # noqa: PLC0415 - there is no such package before

        monkeypatch.setattr(AcmeM7, "fetch", AcmeM7.__base__.fetch)
    texts = {"bench.toml": outside_package.bench_text()}
    assert "oven-cold" in draw(SEED, "attitude", bench=texts).documents["world.toml"]
    verdict, told = replay(SEED, "attitude", tmp_path, bench=texts)
    assert any("oven-cold on scanner: the reference's oven is cold" in line for line in told)
    assert verdict.complete
    assert {violation.invariant for violation in verdict.violations} == (set() if heeded else {"truthful"})
    assert any("run file" in line and "reports error 4: oven cold" in line for line in told) is heeded


def test_a_campaign_of_nights_is_played_on_its_bench_in_processes_of_their_own(bench):
    command = (sys.executable, "-m", "rig", "night", "--lab", "attitude", "--bench", bench, "--first", SEED)
    done = subprocess.run(
        [*map(str, command), "--seeds", "2", "--jobs", "2", "--json"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["attitude"] | {"nights": 2, "violations": 0} == json.loads(done.stdout)["attitude"]


def test_a_bench_for_two_laboratories_is_refused(bench):
    done = rig("night", "--bench", bench, "--seeds", "1")
    assert done.returncode == 2
    assert "say which one's procedures to run on it with --lab" in done.stderr
