"""What `make bench` measures: each against a peer or the physical limit, in the same run, in turns.

An entry is one function that prepares two actions, ours and the peer's, and says how many units each of them does.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

Clock = Callable[[], float]
Action = Callable[[], object]


def of_children() -> float:
    """Processor time of processes that have ended, seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True)
class Pair:
    """Two actions to be timed in turns.

    Attributes:
        ours: what we do.
        peer: what it is compared with.
        units: how many units (points, exchanges, readings) ours and the peer's do at a time.
        clock: seconds; processor time of this process unless something else is meant.
        takes: whether the actions return what they took (bytes, or seconds of a part) instead of being timed.

    """

    ours: Action
    peer: Action
    units: tuple[float, float] = (1.0, 1.0)
    clock: Clock = time.process_time
    takes: bool = False


@dataclass(frozen=True)
class Ratio:
    """One row of the ledger.

    Attributes:
        name: of the row.
        what: what is compared with what.
        prepare: makes the pair; it gets a folder on the project's disk.
        rounds: how often both take turns.

    """

    name: str
    what: str
    prepare: Callable[[Path], Pair]
    rounds: int = 7


RATIOS: dict[str, Ratio] = {}


def ratio(name: str, what: str, rounds: int = 7) -> Callable[[Callable[[Path], Pair]], Callable[[Path], Pair]]:
    """Enter a function as a row of the ledger."""

    def enter(prepare: Callable[[Path], Pair]) -> Callable[[Path], Pair]:
        RATIOS[name] = Ratio(name, what, prepare, rounds)
        return prepare

    return enter


def night_data() -> Any:
    from proving.truth.attitude import D1, simulate
    from proving.truth.attitude_hidden import PADS_AND_TEMPERATURE

    return simulate(PADS_AND_TEMPERATURE, D1(180, 37, 13), seed=0)[0]


def yardstick(rows: int = 2886, columns: int = 24) -> Action:
    """numpy's least squares of a night's rows: what one look at all data costs."""
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(rows, columns)), rng.normal(size=rows)
    return lambda: np.linalg.lstsq(x, y, rcond=None)


def process(*argv: str) -> Action:
    """A process to its end, without output. Raises `CalledProcessError` if it fails."""
    here = Path(__file__).parent.parent
    return lambda: subprocess.run(argv, cwd=here, capture_output=True, check=True)


@ratio(
    "own-point", "a point of the controller, ideal instruments, one durable commit / an fdatasync of 2 kB (wall time)"
)
def _own_point(folder: Path) -> Pair:
    from benchmarks.bench_engine import bare_sync, ours

    return Pair(lambda: ours(folder)[0], lambda: bare_sync(folder), takes=True)


@ratio(
    "own-point-bluesky", "a point of the controller / a point of bluesky's RunEngine, which stores nothing (wall time)"
)
def _bluesky(folder: Path) -> Pair:
    from benchmarks.bench_engine import bluesky, ours

    bluesky()  # raises ImportError without the extra "bench"
    return Pair(lambda: ours(folder)[0], lambda: bluesky()[0], takes=True)


@ratio("exchange", "one query of the ESP301 through driver, wire and twin / the twin alone")
def _exchange(_: Path) -> Pair:
    from benchmarks.bench_exchange import BENCH, TWINS
    from rig.drivers.newport_esp301 import NewportESP301
    from rig.drivers.wires import Wires
    from rig.sims.bench import SimBench
    from rig.sims.world import World

    world = World()
    sim = SimBench(world, BENCH, {}, "bench", TWINS)
    head = NewportESP301(
        "head", "sim://bench/head", NewportESP301.Options(), Wires(world, simulated=sim.transports()), world
    )
    head.prepare()
    twin = sim.twin("head")

    def alone() -> None:
        for _ in range(1000):
            heard: list[bytes] = []
            twin.on_rx(b"1TP?\r", heard.append)
            world.run_until(None, lambda heard=heard: bool(heard))

    return Pair(lambda: [head._line.query("1TP?") for _ in range(1000)], alone, (1000, 1000))


@ratio("night", "an exchange of a dry night, everything included / one query through driver, wire and twin", rounds=3)
def _night(_: Path) -> Pair:
    from benchmarks.bench_night import night

    sent = night("attitude", 0.5, counted=True)[1]
    query = _exchange(_).ours
    return Pair(lambda: night("attitude", 0.5, counted=False), query, (sent, 1000))


@ratio("fit", "fit of 2,886 points from angles / numpy.linalg.lstsq of its columns", rounds=31)
def _fit(_: Path) -> Pair:
    from rig.procedures.attitude.model import attitude_columns, attitude_parameters, fit_columns

    data = night_data()
    columns, y = attitude_columns(data.pitch_deg, data.roll_deg), data.outputs["x_V"]

    def ours() -> None:
        found = fit_columns(attitude_columns(data.pitch_deg, data.roll_deg), y)
        attitude_parameters(0, found.coefficients, found.covariance)

    return Pair(ours, lambda: np.linalg.lstsq(columns, y, rcond=None))


@ratio("table-2", "Table 2 of 2,886 points in 6 replications / numpy.linalg.lstsq of 24 columns", rounds=31)
def _table_2(_: Path) -> Pair:
    from rig.procedures.attitude.fit import fit_attitude

    data = night_data()
    return Pair(lambda: fit_attitude(data, "x_V"), yardstick())


@ratio("reml-flat", "REML of 220 points in 20 whole plots / numpy.linalg.lstsq of its 10 columns", rounds=101)
def _reml_flat(_: Path) -> Pair:
    from benchmarks.bench_reml import NAMES, WHOLE_PLOT, columns, responses
    from rig.fitter.split_plot import SplitPlotDesign

    x, y = columns(), responses(1, 10.0)[:, 0].copy()
    design = SplitPlotDesign(x, WHOLE_PLOT, NAMES)
    return Pair(lambda: design.fit(y), lambda: np.linalg.lstsq(x, y, rcond=None))


@ratio("reml-nested", "REML of 660 points in 60 whole plots in 3 replications / numpy.linalg.lstsq", rounds=31)
def _reml_nested(_: Path) -> Pair:
    from benchmarks.bench_reml import NAMES, columns, responses
    from rig.fitter.split_plot import SplitPlotDesign

    x = np.vstack([columns()] * 3)
    y = np.concatenate(responses(3, 10.0).T) + np.repeat([0.1, -0.4, 0.2], 220)
    design = SplitPlotDesign(x, np.arange(660) // 11, NAMES, replicate=np.arange(660) // 220)
    return Pair(lambda: design.fit(y), lambda: np.linalg.lstsq(x, y, rcond=None))


@ratio("inference", "angles with sd, intervals and flags of 200,000 readings / their arcsin and arctan2 in numpy")
def _inference(_: Path) -> Pair:
    from proving.truth.attitude import D1, Bench, simulate, volts
    from rig.procedures.attitude.infer import calibrate_package, infer_attitude

    calibration = calibrate_package(simulate(Bench(), D1(180, 19, 13), 0)[0])
    rng = np.random.default_rng(1)
    pitch, roll = rng.uniform(-89, 89, 200_000), rng.uniform(-180, 180, 200_000)
    v = volts(Bench(), pitch, roll) + rng.normal(size=(pitch.size, 3)) * calibration.sigma_V

    def angles() -> None:
        g = np.linalg.solve(calibration.matrix, (v - calibration.offsets_V).T)
        np.degrees(np.arcsin(np.clip(g[0], -1, 1))), np.degrees(np.arctan2(-g[1], -g[2]))

    return Pair(lambda: infer_attitude(calibration, v), angles)


@ratio(
    "inference-curve",
    "from CSV to CSV 50,000 values of a curve in two variables, each row with another temperature, with intervals / "
    "reading and writing the same cells with Python's csv",
    rounds=5,
)
def _inference_of_a_curve(folder: Path) -> Pair:
    import csv

    from rig.tables.csv_files import write_csv
    from rig.verbs.infer.result import infer

    calibration, readings, out = (folder / name for name in ("calibration.json", "readings.csv", "inferred.csv"))
    rng = np.random.default_rng(5)

    def bridge(p: Any, t: Any) -> Any:
        return 0.1 + 0.02 * p + 1e-5 * p**2 + 0.003 * t + 2e-5 * p * t + rng.normal(0, 0.002, p.size)

    p, t = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 100, 21), np.linspace(10, 40, 5)))
    write_csv({"p_kPa": p, "t_degC": t, "y_V": bridge(p, t)}, readings)
    rig = str(Path(sys.executable).with_name("rig"))
    model = ("--response", "y_V", "--formula", "1 + p_kPa*t_degC + p_kPa^2", "--out", str(calibration))
    subprocess.run([rig, "fit", str(readings), *model], check=True, capture_output=True)
    p, t = rng.uniform(1, 99, 50_000), rng.uniform(10, 40, 50_000)
    write_csv({"t_degC": t, "y_V": bridge(p, t)}, readings)
    infer(calibration, readings, out=out)

    def plain() -> None:
        with out.open(newline="") as file:
            head, *rows = csv.reader(file)
        cells = [[float(cell) for cell in row[:-1]] for row in rows]
        with (folder / "again.csv").open("w", newline="") as file:
            csv.writer(file).writerows([head, *cells])

    return Pair(lambda: infer(calibration, readings, out=out), plain)


@ratio(
    "trace-attitude", "trace of 2,886 points of three sensors with two effects / numpy.linalg.lstsq of 24 columns", 3
)
def _trace(_: Path) -> Pair:
    from rig.procedures.attitude.trace import trace

    data, look = night_data(), yardstick()
    return Pair(lambda: trace(data), lambda: [look() for _ in range(100)], (1, 100))


@ratio("trace-pressure", "trace of 220 readings of seven transducers with a cubic each / numpy.linalg.lstsq", 3)
def _trace_pressure(_: Path) -> Pair:
    from benchmarks.bench_trace import seven_transducers
    from proving.truth.whole_plot import CUBIC, GROWING, Bench, Run, simulate
    from rig.procedures.pressure.trace import trace_whole_plots

    bench = Bench(tuple(replace(one, cubic=CUBIC) for one in seven_transducers()), GROWING)
    data, look = simulate(bench, Run(), 1), yardstick(220, 10)
    return Pair(lambda: trace_whole_plots(data), lambda: [look() for _ in range(1000)], (1, 1000))


@ratio("trace-table", "trace of 4,800 rows of seven columns with a drift / numpy.linalg.lstsq of 24 columns", 3)
def _trace_table(_: Path) -> Pair:
    from proving.truth.table import MISSING, Lab, options, simulate
    from rig.procedures.general.column_roles import Roles, roles_of
    from rig.procedures.general.trace import trace_general
    from rig.procedures.tables.table import Table

    lab = Lab(4800, 4, clock=True)
    columns = simulate(lab, 1, MISSING["drift"].at(1.0))
    data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**options(lab)))
    look = yardstick(4800, 24)
    return Pair(lambda: trace_general(data), lambda: [look() for _ in range(100)], (1, 100))


@ratio("start-up", "`rig --help` / Python that does nothing (processor time)")
def _start_up(_: Path) -> Pair:
    rig = str(Path(sys.executable).with_name("rig"))
    return Pair(process(rig, "--help"), process(sys.executable, "-c", "pass"), clock=of_children)


@ratio("plan-attitude", "`rig plan` of night.toml, 2,886 points / imports of numpy and scipy alone (processor time)", 3)
def _plan_attitude(_: Path) -> Pair:
    return _plan("examples/attitude-lab", "night.toml")


@ratio("plan-pressure", "`rig plan` of the pressure example / imports of numpy and scipy alone (processor time)", 3)
def _plan_pressure(_: Path) -> Pair:
    return _plan("examples/pressure-lab", "procedure.toml")


def _plan(folder: str, procedure: str) -> Pair:
    rig = str(Path(sys.executable).with_name("rig"))
    ours = process(rig, "plan", f"{folder}/{procedure}", "--bench", f"{folder}/bench.toml")
    bare = process(sys.executable, "-c", "import numpy, scipy.linalg, scipy.special")
    return Pair(ours, bare, clock=of_children)


def _table_of(folder: Path, rows: int) -> Path:
    from rig.tables.csv_files import write_csv

    rng = np.random.default_rng(3)
    path = folder / "table.csv"
    write_csv({name: rng.normal(size=rows) for name in ("pitch_deg", "roll_deg", "x_V", "y_V", "z_V")}, path)
    return path


@ratio("csv", "reading a table of 100,000 rows of five numbers / Python's csv.reader and float", rounds=5)
def _csv(folder: Path) -> Pair:
    import csv

    from rig.tables import read_table

    path = _table_of(folder, 100_000)

    def plain() -> None:
        with path.open(newline="") as file:
            rows = csv.reader(file)
            next(rows)
            np.array([[float(cell) for cell in row] for row in rows])

    return Pair(lambda: read_table(path), plain)


@ratio("memory", "growth of a process that reads a table of 300,000 rows / its numbers, eight bytes each", rounds=1)
def _memory(folder: Path) -> Pair:
    path, rows = _table_of(folder, 300_000), 300_000
    code = (
        "import sys; from pathlib import Path; from rig.tables import read_table\n"
        "len(sys.argv) > 1 and read_table(Path(sys.argv[1]))\n"
        "print(Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0])"
    )

    def peak(*argv: str) -> float:
        # its own word: the system would charge it with what its parent had in memory
        done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True, check=True)
        return float(done.stdout) * 1024.0

    return Pair(lambda: peak(str(path)) - peak(), lambda: 8.0 * 5 * rows, takes=True)
