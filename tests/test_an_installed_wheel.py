"""The wheel, installed into an empty environment with what it declares and nothing else, runs the main job elsewhere.

What it depends on is not fetched and unpacked again: the environment is lent the distributions installed beside these
tests, those that the wheel's requirements lead to. One that is imported and not declared is missed there.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from importlib.metadata import Distribution, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parent.parent


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


@pytest.mark.timeout(600)
def test_an_installed_wheel_runs_the_demo(tmp_path):
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
    quietly(*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("*.whl")
    venv.create(tmp_path / "env", with_pip=False, symlinks=True)
    python = tmp_path / "env" / "bin" / "python"
    quietly(*pip, "--python", python, "install", "--no-deps", wheel)
    (site,) = (tmp_path / "env").glob("lib/python*/site-packages")
    (about,) = site.glob("*.dist-info")
    needed = required(Distribution.at(about))
    assert {"numpy", "scipy", "pymodbus", "matplotlib", "Jinja2"} <= set(needed)
    assert "pytest" not in needed
    for one in needed.values():
        lend(one, site)
    # half as many points as the short demo has, in as many hours, through which temperature and time differ
    night = site / "rig" / "examples" / "attitude-lab" / "night.toml"
    text = night.read_text()
    for whole, half in (("pitch_count = 37", "pitch_count = 19"), ("\ndwell_s = 9\n", "\ndwell_s = 48\n")):
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
    # what is proven about the program comes with the source alone, and the commands say so
    assert not (site / "proving").exists()
    night_here = subprocess.run(
        [python.parent / "rig", "night", "--seeds", "3"], capture_output=True, text=True, check=False, env=clean
    )
    assert night_here.returncode == 2
    assert "get the project's source" in night_here.stderr
