"""What CONTRIBUTING tells a newcomer to do, done as it stands there."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import outside_package
import pytest
from command import rig

from proving.truth.attitude import D1, Bench, simulate
from rig.tables.csv_files import write_csv

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SEED = 1
SIZE_V = 2e-5


def block(name: str) -> str:
    """The fenced block with this name behind its language."""
    (found,) = re.findall(rf"^```\w+ {re.escape(name)}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    return found


def shell(script: str, cwd: Path, *, site: Path | None = None, **environment: str) -> str:
    """Run a script; `site` is where packages lie that it finds beside those of these tests."""
    if site is not None:
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(site), os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        ["sh", "-ec", script],
        cwd=cwd,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{script}\n{done.stdout[-1000:]}\n{done.stderr[-2000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the table of a night in which there was a draught, and the effect that CONTRIBUTING has."""
    print(f"seed {SEED}")
    folder = tmp_path_factory.mktemp("lab")
    data, _ = simulate(Bench(), D1(180, 13, 13), SEED)
    draught = np.exp(np.cos(np.radians(data.pitch_deg))) * np.sin(3 * np.radians(data.roll_deg))
    names = ("replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC")
    columns = {name: getattr(data, name) for name in names} | dict(data.outputs)
    write_csv(columns | {"x_V": data.outputs["x_V"] + SIZE_V * draught}, folder / "night.csv")
    (folder / "effects.toml").write_text(block("effects.toml"), encoding="utf-8")
    return folder


def found(told: str) -> dict[str, list[str]]:
    sensors = json.loads(told)["sensors"]
    return {name: [effect["effect"] for effect in one["effects"]] for name, one in sensors.items()}


NOT_HIDDEN = {"y_V": [], "z_V": []}


def test_an_effect_in_ten_minutes(lab):
    assert found(shell(block("effect").rstrip() + " --json", lab)) == {"x_V": ["draught"], **NOT_HIDDEN}


def test_without_it_nothing_of_that_name_is_found(lab):
    assert "draught" not in found(rig("trace", "night.csv", "--json", cwd=lab).stdout)["x_V"]


def test_an_effect_that_is_installed(lab, tmp_path):
    source, site = tmp_path / "source", tmp_path / "site"
    source.mkdir()
    for name in ("effects.toml", "lab_effects.py", "pyproject.toml"):
        (source / name).write_text(block(name), encoding="utf-8")
    pip = "python -m pip --disable-pip-version-check --quiet --no-input install"
    shell(f"{pip} --no-index --no-deps --no-build-isolation --target {site} {source}", tmp_path)
    told = shell("rig trace night.csv --json", lab, site=site)
    assert found(told) == {"x_V": ["draught"], **NOT_HIDDEN}


def shorten(procedure: Path) -> None:
    """A thirteenth of the points: the steps are what is tried, and a point is like another."""
    text = procedure.read_text(encoding="utf-8")
    for whole, part in (("pitch_count = 13\n", "pitch_count = 5\n"), ("roll_count = 25 ", "roll_count = 5 ")):
        assert text.count(whole) == 1
        text = text.replace(whole, part)
    procedure.write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tree in which the steps for an instrument were taken, with the bench file of the next step."""
    tree = tmp_path_factory.mktemp("work") / "tree"
    tree.mkdir()
    shutil.copytree(ROOT / "tests", tree / "tests", ignore=shutil.ignore_patterns("__pycache__", "data", "page"))
    shutil.copytree(ROOT / "examples", tree / "examples")
    shorten(tree / "examples" / "attitude-lab" / "procedure.toml")
    (tree / ".venv").symlink_to(sys.prefix)
    install = "pip install --no-deps --no-build-isolation --editable"
    assert block("instrument").count(install) == 1
    # not into the environment of these tests: beside it
    beside = "pip install --quiet --no-index --no-deps --no-build-isolation --target ../site"
    told = shell(block("instrument").replace(install, beside), tree, site=tree.parent / "site", OLDPWD=str(tree))
    assert "*IDN?" in told
    bench = outside_package.bench_text().replace(outside_package.DRIVER, "my-meter")
    (tree / "bench.toml").write_text(bench, encoding="utf-8")
    return tree


def walked(name: str, tree: Path) -> None:
    shell(block(name), tree, site=tree.parent / "site", XDG_CONFIG_HOME=str(tree.parent), RIG_NOTIFY="")


def test_an_instrument_in_an_hour(tree):
    walked("bench", tree)
    assert list((tree / "runs").glob("*.sqlite"))


def test_a_kind_in_a_day(tree):
    (tree / "level.toml").write_text(block("level.toml"), encoding="utf-8")
    walked("kind", tree)
    assert json.loads((tree / "level.json").read_text(encoding="utf-8"))["data"]["kind"] == "my-tilt"
    assert "SIMULATED" in (tree / "level.html").read_text(encoding="utf-8")
