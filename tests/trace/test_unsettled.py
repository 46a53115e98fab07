"""What had not settled when it was read is said, and what looks like it is doubtful."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command import rig

from rig.procedures.tables.moving import Moving, sentences
from rig.tables.behind_rows import moving_inside

EXAMPLE = Path(__file__).parents[2] / "examples/flow-lab"
SEED = 20261129


def flow_lab(folder: Path, time_constant_s: float) -> Path:
    """A dry run of one chamber temperature, whose meters read one after another while a valve settles."""
    shutil.copytree(EXAMPLE, folder, dirs_exist_ok=True)
    lines = (folder / "bench.toml").read_text(encoding="utf-8").splitlines()
    bench = ['fetch = "READ?"' if line.startswith("fetch") else line for line in lines if not line.startswith("start ")]
    (folder / "bench.toml").write_text("\n".join(bench) + "\n", encoding="utf-8")
    change(folder / "procedure.toml", "levels = [10, 25, 40]", "levels = [25]")
    change(folder / "procedure.toml", "dwell_s = 30", "dwell_s = 15")
    change(
        folder / "world.toml",
        "[sources.chamber_degC]",
        f"[sources.valve_V]\ntime_constant_s = {time_constant_s}\n\n[sources.chamber_degC]",
    )
    args = ["run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", "--out", "runs"]
    assert rig(*args, cwd=folder).returncode == 0
    return next((folder / "runs").glob("*.sqlite"))


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize(("time_constant_s", "moves"), [(8.0, True), (1.0, False)])
def test_a_valve_that_still_moves_between_meters_makes_no_loop_that_is_explained(tmp_path, time_constant_s, moves):
    run = flow_lab(tmp_path, time_constant_s)
    traced = json.loads(rig("trace", str(run), "--json").stdout)
    fitted = json.loads(rig("fit", str(run), "--json").stdout)
    for name in ("sensor_1_Hz", "sensor_2_Hz"):
        one, notes = traced["sensors"][name], " ".join(fitted["sensors"][name]["notes"])
        told = "flow_kg_per_min still moved while it was read" in " ".join(one["notes"])
        assert told == moves
        assert ("flow_kg_per_min still moved while it was read" in notes) == moves
        doubts = {
            e["effect"]: e["doubtful"] for e in one["effects"] if e["effect"].startswith(("direct", "setting-lag"))
        }
        assert bool(doubts) == moves
        assert all("had not settled" in why for why in doubts.values())


def test_a_movement_is_the_way_of_the_steps():
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    steps = np.where(np.arange(40) % 2, 1.0, -1.0)
    settling = [step * 0.5 ** np.arange(5) * -0.3 + 0.01 * rng.normal(size=5) for step in steps]
    found = Moving.seen(settling, steps, "valve_V")
    assert found is not None
    assert found.change == pytest.approx(0.3 * (1 - 0.5**4), rel=0.3)
    assert Moving.seen([-one for one in settling], steps, "valve_V") is None, "it comes back: no settling"
    assert Moving.seen(settling, np.zeros(40), "valve_V") is None


def test_noise_with_a_memory_does_not_count_as_movement():
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    walks = [[np.cumsum(rng.normal(size=5)) for _ in range(39)] for _ in range(100)]
    steps = np.where(rng.integers(0, 2, size=39), 1.0, -1.0)
    assert not any(Moving.seen(walk, steps, "x") for walk in walks)


def test_an_output_alone_that_moves_is_said_to_be_late():
    late = Moving(0.5, 5, "force_kN")
    assert "follows late" in sentences({"cell_V": late}, "cell_V", ("force_kN",))["cell_V"]
    assert sentences({"cell_V": late}, "other_V", ("force_kN",)) == {}


@pytest.mark.parametrize("per_point", [0.5, -0.5])
def test_an_output_that_drifts_the_same_way_in_every_point_is_said_to_drift(per_point):
    """A sensor that warms up whenever it is read: the mean of each point has it, and nothing said so."""
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    every = []
    for step in rng.choice([-1.0, 1.0], size=30):
        values = 3.0 * step + per_point * np.arange(5) / 4.0 + 0.05 * rng.normal(size=5)
        channel = {"readings": values.tolist()}
        every.append((SimpleNamespace(outputs={"cell_V": channel}, references={}, temperatures={}), {"force_kN": step}))
    found: Any = moving_inside(every)  # type: ignore[arg-type]
    assert found["cell_V"].of == ""
    assert found["cell_V"].change == pytest.approx(per_point, rel=0.1)
    said = sentences(found, "cell_V", ("force_kN",))["cell_V"]
    assert "drifts inside the points" in said
    assert "the same way in every point" in said
    still = [(SimpleNamespace(outputs={"cell_V": {"readings": [1.0, 1.1, 0.9]}}, references={}, temperatures={}), {})]
    assert moving_inside(still * 9) == {}  # type: ignore[operator]
