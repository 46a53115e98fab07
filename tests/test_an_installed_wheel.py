"""The wheel, installed into an empty environment, runs the main job from another folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def quietly(*command: object, **options: object) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{command}: {done.stderr[-2000:]}"
    return done.stdout


@pytest.mark.timeout(600)
def test_an_installed_wheel_runs_the_demo(tmp_path):
    pip = ("-m", "pip", "--disable-pip-version-check", "--quiet")
    quietly(sys.executable, *pip, "wheel", "--no-deps", "--no-build-isolation", "-w", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("*.whl")
    quietly(sys.executable, "-m", "venv", tmp_path / "env")
    python = tmp_path / "env" / "bin" / "python"
    quietly(python, *pip, "install", "--constraint", ROOT / "constraints.txt", wheel)
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
