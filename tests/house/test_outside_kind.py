"""A kind of calibration of another package has all that ours have, by the command line."""

from __future__ import annotations

import ast
import csv
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent
from urllib.request import urlopen

import outside_package
import pytest
from command import Done, in_its_own_process, rig

from rig.procedures.kind import Kind
from rig.run_file.read.reader import RunReader
from rig.run_file.state.documents import declared_model

TILT = outside_package.SOURCE / "acme_rig" / "tilt"
DOCUMENT = (outside_package.SOURCE.parent.parent / "docs" / "how_to" / "kinds.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"(?:`([\w./]+)`:\n\n)?```(\w+)\n(.*?)```\n", DOCUMENT, re.DOTALL)
"""File that a block of code is said to be of, its language, and the code."""
(PROCEDURE,) = (text for _, language, text in BLOCKS if language == "toml" and text.startswith("kind = "))
WORLD = """
seed = 7
[sensors.x]
offset_V = 0.0123
sensitivity_V_per_g = 5.02
noise_V = 25e-6
coning_deg = 0
"""
BACKLASH = "[effects.backlash]\npitch_arcsec = 6\n"
HALF_V = 5.02 * 6 / 3600 / 57.29578
"""What six seconds of arc between up and down come to, V."""


@pytest.fixture(scope="module", autouse=True)
def _outside() -> Iterator[None]:
    with outside_package.installed():
        yield


def of_one_sensor() -> str:
    """The bench of the outside instrument with one level sensor on it."""
    text = re.sub(r"\[sensors\.[yz]\]\n(?:[^\[\n].*\n|\n)*", "", outside_package.bench_text())
    assert text.count("[sensors.") == 1
    return text


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab")
    (folder / "bench.toml").write_text(of_one_sensor())
    (folder / "level.toml").write_text(PROCEDURE)
    (folder / "world.toml").write_text(WORLD)
    (folder / "lagging.toml").write_text(WORLD + BACKLASH)
    return folder


def run(world: str) -> tuple[str, ...]:
    return ("run", "level.toml", "--bench", "bench.toml", "--dry", "--world", world, "--out", "runs")


def path_of(done: Done | subprocess.CompletedProcess[str], lab: Path) -> Path:
    assert done.stdout, done.stderr
    return lab / done.stdout.splitlines()[0]


@pytest.fixture(scope="module")
def plain(lab: Path) -> Path:
    """A run with nothing hidden."""
    done = rig(*run("world.toml"), cwd=lab)
    assert done.returncode == 0, done.stderr
    assert "every sensor is inside acceptance (standard error up to 0.0004 deg)" in done.stderr
    return path_of(done, lab)


@pytest.fixture(scope="module")
def lagging(lab: Path) -> Path:
    """A run on a head with backlash, which makes it miss its acceptance, killed at its twentieth point and resumed."""
    killed = in_its_own_process(*run("lagging.toml"), "--kill-at-point", 20, cwd=lab)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    path = path_of(killed, lab)
    done = in_its_own_process("resume", path, cwd=lab)
    assert done.returncode == 3, done.stderr
    assert "x_V is outside acceptance: standard error" in done.stderr
    return path


def result_of(*arguments: object) -> dict:
    done = rig(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_nothing_in_the_tree_names_it():
    root = outside_package.SOURCE.parent.parent
    folders = ("rig", "drivers", "sims", "procedures", "fitter", "contracts", "proving", "examples", "pyproject.toml")
    files = [f for folder in folders for f in ([root / folder, *(root / folder).rglob("*")]) if f.is_file()]
    assert len(files) > 300
    assert not [f for f in files if f.suffix in (".py", ".toml", ".j2") and b"acme-tilt" in f.read_bytes()]


def test_the_document_shows_the_code_as_it_is():
    shown = [(file, text) for file, language, text in BLOCKS if language in ("python", "jinja")]
    assert len(shown) >= 8
    for file, text in shown:
        code, stale = (TILT / file).read_text(), f"{file} is no longer as docs/how_to/kinds.md has it: {text}"
        if file.endswith(".py"):  # by what it says: in a document it may be indented and wrapped otherwise
            known = {ast.dump(node) for node in ast.walk(ast.parse(code))}
            assert {ast.dump(node) for node in ast.parse(dedent(text)).body} <= known, stale
        else:
            assert text == code, stale
    (entry,) = (text for _, language, text in BLOCKS if language == "toml" and text != PROCEDURE)
    assert entry in (outside_package.SOURCE / "pyproject.toml").read_text()


def test_the_document_names_every_member():
    members = {name for name in vars(Kind) if not name.startswith("_")}
    assert members - set(re.findall(r"`(\w+)`", DOCUMENT)) == set()


def test_the_commands_of_the_document_run(lab, tmp_path):
    for name in ("bench.toml", "level.toml"):
        (tmp_path / name).write_text((lab / name).read_text())
    (commands,) = (text for _, language, text in BLOCKS if language == "sh")
    run_file = ""
    for line in commands.splitlines():
        program, *arguments = line.replace("RUN", run_file).split()
        done = rig(*arguments, cwd=tmp_path)
        assert program == "rig"
        assert done.returncode in (0, *([3] if arguments[0] == "run" else [])), (line, done.stderr)
        run_file = run_file or (done.stdout.splitlines()[0] if arguments[0] == "run" else "")
    assert {"level.json", "level.html", "level.csv", "angles.csv"} <= {path.name for path in tmp_path.iterdir()}


def test_it_is_planned(lab):
    plan = result_of("plan", lab / "level.toml", "--bench", lab / "bench.toml")
    assert (plan["points"], plan["replications"], plan["precision"]) == (60, 6, [])
    assert plan["reach"] == {"pitch_deg": [-3.0, 3.0]}
    shown = rig("plan", lab / "level.toml", "--bench", lab / "bench.toml")
    assert shown.returncode == 0, shown.stderr
    assert "Predicted precision" not in shown.stdout


def test_a_design_of_its_own_is_checked_by_its_own_settings(lab, tmp_path):
    (tmp_path / "two.toml").write_text(PROCEDURE.replace("-2, -1, 0, 1, 2", "0, 1"))
    done = rig("plan", tmp_path / "two.toml", "--bench", lab / "bench.toml")
    assert done.returncode == 78
    assert "design.pitch_deg" in done.stderr


def test_status_and_verify_and_acceptance_know_its_run(plain):
    status = result_of("status", plain)
    assert status["acceptance"]["inside"] is True
    assert status["acceptance"]["sensors"]["x_V"]["limit"] == "standard error up to 0.0004 deg"
    assert rig("verify", plain).returncode == 0


def test_a_run_that_was_killed_is_resumed_whole(lagging):
    with RunReader.open(lagging) as reader:
        points = [r.run_index for r in reader.records("observation") if r.status == "accepted"]
    assert sorted(points) == list(range(60))
    assert rig("verify", lagging).returncode == 0


def test_it_is_fitted_and_used(plain, tmp_path):
    fitted = result_of("fit", plain, "--out", tmp_path / "level.json")
    sensor = fitted["sensors"]["x_V"]
    assert fitted["data"]["kind"] == "acme-tilt"
    for term, true in (("offset", 0.0123), ("slope", 5.02)):
        found = sensor["coefficients"][term]
        assert abs(found["estimate"] - true) < 4 * found["stderr"] + 1e-5, (term, found)
    (tmp_path / "use.csv").write_text(f"x_V\n{0.0123 + 5.02 * 0.0174524:.6f}\n1.0\n")
    done = rig("infer", tmp_path / "level.json", tmp_path / "use.csv", "--out", tmp_path / "angles.csv", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["quantities"] == ["pitch_deg"]
    rows = list(csv.DictReader((tmp_path / "angles.csv").read_text().splitlines()))
    assert float(rows[0]["pitch_deg_lo95"]) < 1.0 < float(rows[0]["pitch_deg_hi95"])
    assert [row["flag"] for row in rows] == ["", "outside the calibrated -2 to 2 deg"]


def test_nothing_is_added_where_nothing_is_missing(plain):
    sensor = result_of("trace", plain)["sensors"]["x_V"]
    assert (sensor["verdict"], sensor["effects"]) == ("nothing to add", [])


def test_what_hides_is_traced_and_reported(lagging, tmp_path):
    sensor = result_of("trace", lagging, "--report", tmp_path / "level.html")["sensors"]["x_V"]
    assert sensor["verdict"] == "explained"
    (effect,) = sensor["effects"]
    assert effect["effect"] == "hysteresis"
    ((low, high),) = effect["interval_95"]
    # one draw in twenty is outside such an interval, and any change of a command's time is another draw
    assert abs(abs(low + high) / 2 - HALF_V) < high - low, effect
    assert sensor["after"]["sigma_E"] < sensor["before"]["sigma_E"]
    page = (tmp_path / "level.html").read_text()
    assert "<h4>hysteresis" in page
    assert "SIMULATED" in page
    shown = rig("trace", lagging)
    assert "hysteresis" in shown.stdout
    assert "rig confirm" not in shown.stdout, "no further run is made of this kind"


def test_what_it_does_not_do_is_said_in_a_line(plain):
    for command, words in (("confirm", "no further run is made of level sensors"), ("chart", "control charts are not")):
        done = rig(command, plain, "--list") if command == "confirm" else rig(command, plain, plain)
        assert done.returncode == 2
        assert words in done.stderr
        assert len(done.stderr.splitlines()) == 1


def test_its_table_is_exported_and_read_again(plain, tmp_path):
    assert rig("export", plain, "--out", tmp_path / "level.csv").returncode == 0
    of_run, of_table = result_of("fit", plain), result_of("fit", tmp_path / "level.csv", "--tilt")
    for term in ("offset", "slope"):
        first, second = (one["sensors"]["x_V"]["coefficients"][term]["estimate"] for one in (of_run, of_table))
        assert first == pytest.approx(second, rel=1e-9)
    assert (
        "--traced is for any table and attitude sensors"
        in rig("fit", tmp_path / "level.csv", "--tilt", "--traced").stderr
    )


def test_its_options_and_settings_stand_in_help_and_reference():
    assert "--tilt" in rig("fit", "--help").stdout
    assert '## procedure.toml, `kind = "acme-tilt"`' in rig("explain", "procedure").stdout


def test_a_kind_is_given_all_of_the_declared_model():
    declared = declared_model({"procedure.toml": "[model]\ncubic = true\ntemperature = true\n"})
    assert declared == {"cubic": True, "temperature": True, "formula": None}


def test_the_page_shows_residuals_of_its_model(plain):
    command = [sys.executable, "-m", "rig", "watch", str(plain), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            assert server.stdout is not None
            address = re.search(r"http://127\.0\.0\.1:\d+/", server.stdout.readline())
            assert address
            with urlopen(f"{address[0]}run/{plain.stem}/state.json", timeout=60) as answer:
                residuals = json.load(answer)["charts"]["residuals"]
        finally:
            server.kill()
    (sensor,) = residuals["sensors"]
    assert (sensor["name"], sensor["unit"], len(sensor["values"])) == ("x_V", "uV", 60)
    assert 10 < sensor["rms"] < 40, "the noise of a mean over one second is 25 uV"
