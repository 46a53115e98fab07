"""The wheel, installed into an empty environment with what it declares and nothing else, runs the main job elsewhere.

It is built from the sdist, and has to be the wheel of the source tree file by file: so both are tried at once.

What it depends on is not fetched and unpacked again: the environment is lent the distributions installed beside these
tests, those that the wheel's requirements lead to. One that is imported and not declared is missed there.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from importlib.metadata import Distribution, distribution
from pathlib import Path

import pytest
from few_sensors import with_sensors
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]


def quietly(*command: object, **options: object) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{command}: {done.stderr[-2000:]}"
    return done.stdout


def required(of: Distribution, extras: frozenset[str] = frozenset()) -> dict[str, Distribution]:
    """What a distribution requires here, and what that requires; raises where one is missing or of another version."""
    found: dict[str, Distribution] = {}
    waiting = [(of, extras)]
    while waiting:
        asking, wanted = waiting.pop()
        for requirement in map(Requirement, asking.requires or ()):
            marker = requirement.marker
            if marker and not any(marker.evaluate({"extra": extra}) for extra in wanted or {""}):
                continue
            one = distribution(requirement.name)
            assert requirement.specifier.contains(one.version, prereleases=True), f"{requirement}, here {one.version}"
            if one.name not in found or requirement.extras:
                found[one.name] = one
                waiting.append((one, frozenset(requirement.extras)))
    return found


def lend(one: Distribution, site: Path) -> None:
    """Link the modules of a distribution and what is known of it into another environment."""
    for name in {file.parts[0] for file in one.files or ()} - {"..", "__pycache__"}:
        if not (site / name).exists():
            (site / name).symlink_to(Path(str(one.locate_file(name))))


PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")


def wheel_of(source: Path, folder: Path) -> Path:
    quietly(*PIP, "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder, source)
    (wheel,) = folder.glob("*.whl")
    return wheel


def files_of(wheel: Path) -> dict[str, str]:
    with zipfile.ZipFile(wheel) as opened:
        return {name: hashlib.sha256(opened.read(name)).hexdigest() for name in opened.namelist()}


@pytest.fixture(scope="module")
def sdist(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    quietly(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder, cwd=ROOT)
    (made,) = folder.glob("*.tar.gz")
    return made


@pytest.fixture(scope="module")
def wheel(sdist, tmp_path_factory) -> Path:
    return wheel_of(sdist, tmp_path_factory.mktemp("wheel"))


def test_the_sdist_holds_what_a_fresh_copy_is_tested_with(sdist):
    with tarfile.open(sdist) as opened:
        held = {name.partition("/")[2]: mode for name, mode in ((m.name, m.mode) for m in opened.getmembers())}
    listed = subprocess.run(("git", "-C", ROOT, "ls-files", "-z"), capture_output=True, text=True, check=False)
    if listed.returncode == 0:
        tracked = set(filter(None, listed.stdout.split("\0")))
        assert {name for name in tracked if (ROOT / name).is_file()} - set(held) == set()
    assert {"README.md", "CHANGELOG.md", "CONTRIBUTING.md", "Makefile", "tests/house/test_documents.py"} <= set(held)
    assert all(held[name] & 0o100 for name in ("tools/check", "tools/make-venv", ".ci/run"))


def test_the_wheel_of_the_sdist_is_the_wheel_of_the_tree(wheel, tmp_path):
    ours = files_of(wheel_of(ROOT, tmp_path))
    assert files_of(wheel) == ours
    assert {name.split("/")[0] for name in ours if ".dist-info/" not in name} == {"rig"}
    assert "rig/py.typed" in ours


def somebody_elses(folder: Path) -> Path:
    """A wheel of another project, whose packages are named as folders of our source."""
    for name in ("drivers", "sims", "procedures", "fitter", "contracts", "examples"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text(f"raise ImportError('this is another {name}')\n")
    (folder / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        '[project]\nname = "fitter"\nversion = "1.0"\n'
        "[tool.hatch.build.targets.wheel]\n"
        'packages = ["drivers", "sims", "procedures", "fitter", "contracts", "examples"]\n'
    )
    return wheel_of(folder, folder.parent)


@pytest.mark.timeout(600)
def test_an_installed_wheel_runs_the_demo_beside_packages_named_as_our_folders(wheel, tmp_path):
    venv.create(tmp_path / "env", with_pip=False, symlinks=True)
    python = tmp_path / "env" / "bin" / "python"
    theirs = somebody_elses(tmp_path / "theirs" / "fitter")
    assert set(files_of(wheel)) & set(files_of(theirs)) == set()
    quietly(*PIP, "--python", python, "install", "--no-deps", "--no-compile", wheel, theirs)
    (site,) = (tmp_path / "env").glob("lib/python*/site-packages")
    (about,) = site.glob("calibration_rig-*.dist-info")
    needed = required(Distribution.at(about))
    assert {"numpy", "scipy", "pymodbus", "matplotlib", "Jinja2"} <= set(needed)
    assert "pytest" not in needed
    for one in needed.values():
        lend(one, site)
    # one sensor, half as many points as the short demo, in about as many hours, in which temperature and time differ
    lab = site / "rig" / "examples" / "attitude-lab"
    with_sensors(lab, lab, "x")
    night = lab / "night.toml"
    text = night.read_text()
    for whole, half in (("pitch_count = 37", "pitch_count = 19"), ("\ndwell_s = 9\n", "\ndwell_s = 58\n")):
        assert text.count(whole) == 1
        text = text.replace(whole, half)
    night.write_text(text)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    clean = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    out = quietly(python.parent / "rig", "demo", "--short", "--json", cwd=elsewhere, env=clean)
    first, _, rest = out.partition("\n")
    assert (elsewhere / first).with_suffix(".html").stat().st_size > 100_000
    result = json.loads(rest)
    found = {e["effect"] for e in result["sensors"]["x_V"]["effects"]}
    assert found == {"isolation-pad-deflection", "sensitivity-temperature"}
    assert result["sensors"]["x_V"]["verdict"] == "explained"
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert quietly(python.parent / "rig", "--version", cwd=elsewhere, env=clean) == f"rig {version}\n"
    # what is proven about the program comes with the source alone, and the commands say so
    assert not (site / "proving").exists()
    night_here = subprocess.run(
        [python.parent / "rig", "night", "--seeds", "3"], capture_output=True, text=True, check=False, env=clean
    )
    assert night_here.returncode == 2
    assert "get the project's source" in night_here.stderr
