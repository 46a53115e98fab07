"""What commands load: the kind and the instruments at hand, and nothing of other commands; by names, not by times."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from small_run import write_small

DATA = Path(__file__).parents[1] / "data"
ATTITUDE, PRESSURE = (Path(__file__).parents[2] / "examples" / name for name in ("attitude-lab", "pressure-lab"))
COMMAND = """
import contextlib, sys
from rig.__main__ import main
with contextlib.suppress(SystemExit):
    main()
print(*sys.modules)
"""
SHORT = "import rig.runs.forecast; rig.runs.forecast.REHEARSED_WITH_SOAKS = rig.runs.forecast.REHEARSED = 1" + COMMAND
NEVER = (
    "scipy.stats",
    "scipy.optimize",
    "matplotlib",
    "jinja2",
    "rig.fitter.trace",
    "rig.fitter.effects",
    "rig.verbs.write_page",
)
NEVER += ("rig.tables", "rig.verbs.certificate", "rig.by_kind", "rig.watch", "rig.procedures.general")
OF_ATTITUDE = ("rig.drivers.newport_esp301", "rig.sims.twins.newport_esp301", "rig.procedures.attitude")
OF_PRESSURE = ("rig.drivers.druck_pace", "rig.sims.twins.druck_pace", "rig.procedures.pressure")
OF_TRACES = ("rig.procedures.attitude.effects", "rig.procedures.attitude.evaluate", "rig.procedures.attitude.report")
OF_TRACES += ("rig.procedures.pressure.effects", "rig.procedures.pressure.evaluate", "rig.procedures.pressure.trace")


def loaded(*command: object, code: str = COMMAND) -> list[str]:
    done = subprocess.run([sys.executable, "-c", code, *map(str, command)], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()


def of(names: tuple[str, ...], modules: list[str]) -> list[str]:
    return [one for one in modules if f"{one}.".startswith(tuple(f"{name}." for name in names))]


def test_a_plan_of_attitude_sensors_loads_nothing_of_another_kind_or_of_traces(tmp_path):
    bench = ATTITUDE / "bench.toml"
    found = loaded("plan", write_small(tmp_path), "--bench", bench, "--out", tmp_path, code=SHORT)
    assert not of((*NEVER, *OF_PRESSURE, *OF_TRACES, "rig.unattended", "rig.cli.run"), found)
    assert of(OF_ATTITUDE, found)


def test_a_plan_of_transducers_loads_nothing_of_another_kind(tmp_path):
    files = PRESSURE / "procedure.toml", "--bench", PRESSURE / "bench.toml"
    found = loaded("plan", *files, "--out", tmp_path, code=SHORT)
    assert not of((*NEVER, *OF_ATTITUDE, *OF_TRACES, "rig.unattended", "rig.cli.run"), found)
    assert of(OF_PRESSURE, found)


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """A run file, and the modules that its run loaded."""
    folder = tmp_path_factory.mktemp("night")
    found = loaded("run", write_small(folder), "--bench", ATTITUDE / "bench.toml", "--dry", "--out", folder)
    (path,) = folder.glob("*.sqlite")
    return path, found


def test_a_run_loads_nothing_of_results(night):
    assert not of((*NEVER, *OF_PRESSURE, *OF_TRACES, "rig.verbs"), night[1])


@pytest.mark.parametrize("command", ["status", "fit", "trace", "verify"])
def test_what_reads_a_run_loads_no_bench(night, command):
    found = loaded(command, night[0])
    assert not of(
        ("rig.runs.controller", "rig.engine.sequencer", "rig.simulated", "rig.sims", "scipy.stats", "matplotlib"), found
    )


def test_a_fit_loads_no_code_of_traces_and_of_procedures(night):
    found = loaded("fit", night[0])
    assert not of(
        (
            *OF_TRACES,
            "rig.procedures.attitude.trace",
            "rig.procedures.attitude.settings",
            "rig.procedures.general.settings",
        ),
        found,
    )


def test_a_fit_of_whole_plots_loads_no_code_of_traces():
    found = loaded("fit", DATA / "pressure-20261121.sqlite")
    assert not of((*OF_TRACES, "rig.procedures.attitude.fit", "rig.procedures.pressure.settings"), found)
    assert "rig.procedures.pressure.fitted" in found


def test_a_trace_of_a_csv_table_loads_nothing_of_runs_and_of_registers(tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("x,y\n" + "".join(f"{i},{2 * i + 0.1 * (i * 7 % 5)}\n" for i in range(20)))
    found = loaded("trace", table, "--response", "y", "--formula", "1 + x")
    assert not of(("rig.run_file", "rig.bench", "rig.register", "rig.verbs.budget", "rig.tables.table_of_run"), found)
    assert "rig.procedures.general.trace.report" in found
