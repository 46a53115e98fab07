"""`import rig`: the same answers as the command line, as objects."""

from __future__ import annotations

import doctest
import importlib
import inspect
import json
import re
import shutil
import signal
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser
from pathlib import Path

import command
import dry
import dry_pressure
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from few_sensors import with_sensors
from matplotlib.figure import Figure

import rig
from rig.cli.show import out
from rig.engine.session import Progress
from rig.verbs.data.result import first_endless

ROOT = Path(__file__).parents[2]
ATTITUDE = Path(__file__).parents[1] / "data" / "attitude-20261121.sqlite"
OUTPUTS = ("x_V", "y_V", "z_V")
GENERAL = {"response": "y_mV", "formula": "1 + x_mm"}


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "line.csv"
    path.write_text(line(seed=7))
    return path


def line(seed: int) -> str:
    """A table of anything: a line, its noise, and a wave over time that nobody declared."""
    rng = np.random.default_rng(seed)
    time = np.arange(60.0) * 10
    x = np.tile(np.arange(6.0), 10)
    y = 3 + 2 * x + 0.1 * np.sin(2 * np.pi * time / 200) + rng.normal(0, 0.01, 60)
    return "x_mm,y_mV,t_s\n" + "".join(f"{a},{b},{c}\n" for a, b, c in zip(x, y, time, strict=True))


@pytest.fixture(scope="module")
def pressure(tmp_path_factory):
    """Of one of the seven transducers: the pictures of each are drawn twice, alike."""
    bench, world = with_sensors(dry_pressure.LAB, tmp_path_factory.mktemp("lab"), "bridge_1")
    return dry_pressure.dry(tmp_path_factory.mktemp("pressure"), bench=bench, world=world)


def printed(*arguments: object) -> object:
    """What a command prints with --json."""
    done = command.rig(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def shown(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> str:
    """What a command shows on a terminal as wide as `str(result)` takes it to be."""
    monkeypatch.setattr(out, "width", 120)
    return command.rig(*arguments).stdout


def options(given: dict[str, str]) -> list[str]:
    return [word for name, value in given.items() for word in (f"--{name}", value)]


def test_a_fit_is_what_the_command_prints(table, pressure):
    assert rig.open(ATTITUDE).fit().to_json() == printed("fit", ATTITUDE)
    assert rig.open(str(pressure)).fit().to_json() == printed("fit", pressure)
    assert rig.open(table).fit(**GENERAL).to_json() == printed("fit", table, *options(GENERAL))
    left_out = rig.open(table).fit(leave_out=[3, 5], **GENERAL)
    assert left_out.to_json() == printed("fit", table, *options(GENERAL), "--leave-out", "3,5")
    assert left_out.to_json()["data"]["rows_left_out"] != []


def test_a_trace_is_what_the_command_prints(table):
    assert rig.open(ATTITUDE).trace().to_json() == printed("trace", ATTITUDE)
    found = rig.open(table).trace(**GENERAL)
    assert found.to_json() == printed("trace", table, *options(GENERAL))
    assert found.verdicts == {"y_mV": "explained"}
    frame = found.to_pandas()
    assert set(frame["effect"]) == {effect["effect"] for effect in found.to_json()["sensors"]["y_mV"]["effects"]}
    assert frame["coefficient"].dtype == np.float64


@pytest.mark.parametrize("form", [str, dict, pd.DataFrame])
def test_readings_are_a_file_or_columns_or_a_data_frame(tmp_path, form):
    run = rig.open(ATTITUDE)
    calibration = run.fit()
    columns = {name: run.table[name] for name in OUTPUTS}
    readings, kept, out = tmp_path / "readings.csv", tmp_path / "kept.json", tmp_path / "angles.csv"
    pd.DataFrame(columns).to_csv(readings, index=False)
    calibration.save(kept)
    told = printed("infer", kept, readings, "--out", out)
    found = calibration.infer(str(readings) if form is str else form(columns), near=(0.0, 0.0))
    assert found.to_json() == {**told, "file": None}
    for name, values in rig.open(out).table.columns.items():
        assert np.array_equal(found[name], values), name
    assert rig.infer(kept, readings, out=tmp_path / "again.csv").to_json() == {
        **told,
        "file": str(tmp_path / "again.csv"),
    }
    assert (tmp_path / "again.csv").read_bytes() == out.read_bytes()


def test_a_table_of_anything_is_inferred_from_as_the_command_does(tmp_path, table):
    calibration = rig.open(table).fit(**GENERAL)
    calibration.save(tmp_path / "line.json")
    told = printed("infer", tmp_path / "line.json", table, "--out", tmp_path / "x.csv")
    assert calibration.infer(table, out=tmp_path / "x.csv").to_json() == told


def test_missing_values_may_be_nan_none_or_pandas_own(table):
    calibration = rig.open(table).fit(**GENERAL)
    given = [5.0, None, 7.0]
    for column in (given, np.array([5.0, np.nan, 7.0]), pd.array(given, "Float64"), pd.Series(given)):
        found = calibration.infer({"y_mV": column, "name": np.array(["a", None, "c"], object)})
        assert found["flag"].tolist() == ["", "no value of y_mV", ""]
        assert found["x_mm"][[0, 2]] == pytest.approx([1.0, 2.0], abs=0.05)
        assert found["name"].tolist() == ["a", "", "c"]
    assert found.notes()[-1] == "row 2, column y_mV: no value: the result of the row is empty"


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({}, "the given table has no columns"),
        ({"y_mV": []}, "the given table has no rows"),
        ({"y_mV": [1.0], "z": [1.0, 2.0]}, "column z: 2 values, where other columns have 1"),
        ({"y_mV": [[1.0]]}, r"column y_mV: it has the shape \(1, 1\)"),
        ({"y_mV": [1.0, np.inf]}, "row 2, column y_mV: inf is not a finite number"),
        ({"y_mV": np.array(["2026-01-15"], "M8[D]")}, "column y_mV: it holds datetime64"),
        ({3: [1.0]}, "a column is called 3, which is not a text"),
        ({"x": [1.0]}, "y_mV"),
    ],
)
def test_readings_that_cannot_be_used_are_refused(table, columns, message):
    with pytest.raises((rig.UsageError, rig.DataError), match=message):
        rig.open(table).fit(**GENERAL).infer(columns)


def test_errors_are_those_of_the_command_line(tmp_path, table):
    def said(*arguments: object) -> str:
        done = command.rig(*arguments)
        assert done.returncode == 2
        return done.stderr.removeprefix("rig: ").strip()

    with pytest.raises(rig.UsageError) as error:
        rig.open(tmp_path / "none.csv")
    assert str(error.value) == said("fit", tmp_path / "none.csv")
    with pytest.raises(rig.UsageError) as error:
        rig.open(table).fit(**GENERAL, points="fraction")
    assert str(error.value) == said("fit", table, *options(GENERAL), "--points", "fraction")
    with pytest.raises(rig.DataError) as data_error:
        rig.open(table).fit(response="y_mV")
    assert str(data_error.value) == said("fit", table, "--response", "y_mV")
    with pytest.raises(rig.UsageError) as error:
        rig.open(ATTITUDE).fit().plot()
    assert str(error.value) in said("fit", ATTITUDE, "--report", tmp_path / "report.html")
    with pytest.raises(rig.UsageError, match=r"there is no option colour; .*, whose options are: traced, temperature"):
        rig.open(ATTITUDE).fit(colour="red")
    with pytest.raises(rig.UsageError, match="is an input and is not overwritten"):
        rig.open(table).fit(**GENERAL).infer(table, out=table)


class Seen(HTMLParser):
    """Elements of a page, whether they are closed in order, and the text between them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.text = ""
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_a_notebook_shows_what_a_terminal_shows(table):
    for result in (rig.open(ATTITUDE).fit(), rig.open(ATTITUDE).table, rig.open(table).fit(**GENERAL)):
        seen = Seen(result._repr_html_())
        assert seen.tags <= {"div", "span", "table", "caption", "thead", "tbody", "tr", "th", "td", "p"}
        lines = [line.strip() for line in str(result).splitlines()]
        plain = [line for line in lines if line and not set(line) & set("━─│┃┏┓┗┛├└") and "..." not in line]
        assert plain
        assert not [word for line in plain for word in line.split() if "…" not in word and word not in seen.text]


def test_what_comes_from_a_file_does_nothing_in_a_notebook(tmp_path):
    evil = "<script>alert(1)</script>"
    path = tmp_path / f"{'<b>&'}.csv"
    path.write_text(f'"{evil}",[bold]y[/],:smile:\n<img src=x>,1,2\n[link=javascript:x]a[/link],2,\x1b[31m\n')
    page = rig.open(path).table._repr_html_()
    seen = Seen(page)
    assert not seen.tags & {"script", "img", "b", "a"}
    for word in (evil, "[bold]y[/]", ":smile:", "<img src=x>", "[link=javascript:x]a[/link]", "<b>&.csv", "\\x1b[31m"):
        assert word in seen.text
    assert "\x1b" not in page


def test_tables_have_their_units():
    observations = rig.open(ATTITUDE).table
    frame, arrays = observations.to_pandas(), observations.to_xarray()
    assert isinstance(frame, pd.DataFrame)
    assert isinstance(arrays, xr.Dataset)
    assert list(frame) == list(arrays) == list(observations.columns)
    assert frame.attrs["units"]["x_V"] == arrays["x_V"].attrs["units"] == "V"
    assert frame.attrs["units"]["sensor_temperature_degC"] == "degC"
    assert "units" not in arrays["order"].attrs
    assert np.array_equal(frame["x_V"], observations["x_V"])
    inferred = rig.open(ATTITUDE).fit().infer({name: observations[name] for name in OUTPUTS}).to_xarray()
    assert inferred["pitch_deg_lo95"].attrs["units"] == "deg"


def test_estimates_are_rows_of_a_data_frame(table):
    calibration = rig.open(ATTITUDE).fit()
    rows = calibration.to_pandas().set_index(["sensor", "of", "name"])
    told = calibration.to_json()["sensors"]["y_V"]["parameters"]["S_V"]
    assert rows.loc[("y_V", "parameter", "S_V"), ["estimate", "stderr", "unit"]].tolist() == [
        told["estimate"],
        told["stderr"],
        "V",
    ]
    general = rig.open(table).fit(**GENERAL).to_pandas()
    assert general["sensor"].tolist() == ["y_mV", "y_mV"]


@pytest.mark.parametrize("library", ["pandas", "xarray"])
def test_a_library_that_is_missing_is_named_with_what_installs_it(monkeypatch, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(rig.UsageError, match=rf"pip install 'calibration-rig\[{library}\]'"):
        getattr(rig.open(ATTITUDE).table, f"to_{library}")()


def test_figures_are_those_of_the_report(tmp_path, table, pressure):
    for result in (rig.open(table).trace(**GENERAL), rig.open(pressure).fit()):
        plots = result.plot()
        assert plots
        assert all(isinstance(figure, Figure) for figure in plots)
        result.report(tmp_path / "report.html")
        assert (tmp_path / "report.html").read_text().count("data:image/png") == len(plots)
        assert Seen(plots._repr_html_()).tags == {"img"}
    (figure,) = rig.open(ATTITUDE).table.plot()
    assert {axis.get_title() for axis in figure.axes} >= {"x / V", "sensor_temperature / degC"}


def test_importing_rig_loads_nothing():
    code = "import sys; before = set(sys.modules); import rig; print(sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "['rig']\n"
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = rig.nothing  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """Three runs of one bench, half a year apart."""
    folder = tmp_path_factory.mktemp("nights")
    paths = []
    for number in range(3):
        world = folder / f"world-{number}.toml"
        began = datetime(2024, 1, 15, tzinfo=UTC) + timedelta(days=182 * number)
        world.write_text(f"seed = {number + 1}\nepoch = {began:%Y-%m-%dT%H:%M:%S}Z\n")
        done = rig.run(dry.write_short(folder), dry.LAB / "bench.toml", world=world, out=folder)
        assert done.complete
        paths.append(done.path)
    return paths


def test_a_run_is_what_status_prints(tmp_path, monkeypatch):
    done = rig.run(dry.write_short(tmp_path), str(dry.LAB / "bench.toml"), out=tmp_path, operator="A. Person")
    assert done.outcome == "complete"
    assert done.path.parent == tmp_path
    assert done.to_json() == printed("status", done.path)
    assert done.to_json()["operators"] == ["A. Person"]
    assert done.to_json()["simulated"]
    assert shown(monkeypatch, "status", done.path) == str(done)
    assert Seen(done._repr_html_()).text.startswith("SIMULATED short on attitude-lab: complete")
    assert done.data.fit().to_json() == printed("fit", done.path)
    assert len(done.to_pandas()) == len(done.data.table) == done.to_json()["accepted"]


def test_a_run_that_cannot_begin_says_why(tmp_path):
    with pytest.raises(rig.UsageError, match="--world describes a simulated bench; it requires --dry"):
        rig.run(dry.write_short(tmp_path), dry.LAB / "bench.toml", dry=False, world=dry.LAB / "world.toml")
    with pytest.raises(rig.ConfigurationError, match=r"none\.toml"):
        rig.run(tmp_path / "none.toml", dry.LAB / "bench.toml", out=tmp_path)
    assert not list(tmp_path.glob("*.sqlite"))


def test_an_interrupt_leaves_a_run_that_goes_on(tmp_path):
    def interrupt(news: Progress) -> None:
        if news.done == 7:
            signal.raise_signal(signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    done = rig.run(dry.write_short(tmp_path), dry.LAB / "bench.toml", out=tmp_path, on_progress=interrupt)
    assert signal.getsignal(signal.SIGINT) is before
    assert (done.outcome, done.complete) == ("interrupted", False)
    assert 0 < done.to_json()["accepted"] < done.to_json()["points"]
    assert command.rig("resume", done.path).returncode == 0
    assert done.to_json()["state"] == "complete"


def test_a_chart_is_what_the_command_prints(monkeypatch, nights):
    given = {"tolerance": 1e-3, "usage": 30.0, "today": "2026-01-01"}
    told = printed("chart", *nights, *(f"--{name}={value}" for name, value in given.items()), "--sensor", "x_V")
    found = rig.chart([rig.open(nights[0]), *map(str, nights[1:])], sensors=["x_V"], **given)
    assert found.to_json() == told
    options = [f"--{name}={value}" for name, value in given.items()]
    assert shown(monkeypatch, "chart", *nights, *options, "--sensor", "x_V") == str(found)
    rows = found.to_pandas()
    assert rows["date"].nunique() == 3
    assert set(rows["parameter"]) == set(told["sensors"]["x_V"]["calibrations"][0]["parameters"])
    assert len(found.plot()) == 2
    with pytest.raises(rig.UsageError, match="at least two calibrations"):
        rig.chart(nights[:1])


def test_a_plan_is_what_the_command_prints(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.drivers.clock.RealClock.utc", lambda _self: 1_800_000_000.0)
    monkeypatch.setattr("shutil.disk_usage", lambda _path: shutil._ntuple_diskusage(3, 1, 2 * 10**9))
    procedure, bench = dry.write_short(tmp_path), dry.LAB / "bench.toml"
    found = rig.plan(procedure, bench, usage=30.0)
    assert found.to_json() == printed("plan", procedure, "--bench", bench, "--usage", 30)
    assert shown(monkeypatch, "plan", procedure, "--bench", bench, "--usage", 30) == str(found)
    assert found.finish < found.finish_latest
    assert len(found.to_pandas()) == len(found.to_json()["precision"])
    (figure,) = found.plot()
    assert [axis.get_title() for axis in figure.axes] == ["pitch / deg", "roll / deg"]


PUBLIC = {
    "budget": "(run: 'str | Path', *, equipment: 'str | Path | None' = None, at: 'Sequence[Mapping[str, float]]' = (), "
    "same_meter: 'bool' = False, probability: 'float' = 0.95, trials: 'int | None' = None, seed: 'int' = 1, each: "
    "'Callable[[], None] | None' = None, shapes: 'bool' = False, after_days: 'float | None' = None, confirmed_by: 'str "
    "| Path | Iterable[str | Path]' = (), **options: 'Any') -> 'Budget'",
    "chart": "(calibrations: 'Sequence[str | Path | Data]', *, tolerance: 'float | None' = None, usage: 'float | None' "
    "= None, sensors: 'Sequence[str]' = (), formula: 'str | None' = None, today: 'str | date | None' = None) -> "
    "'ControlChart'",
    "infer": "(calibration: 'str | Path', readings: 'Readings', *, out: 'str | Path | None' = None, "
    "separator: 'str | None' = None, decimal: 'str | None' = None, encoding: 'str | None' = None, "
    "header: 'int | None' = None, same_meter: 'bool' = False, mean_of: 'int | None' = None, "
    "**options: 'Any') -> 'Inferred'",
    "open": "(path: 'str | Path', *, separator: 'str | None' = None, decimal: 'str | None' = None, "
    "encoding: 'str | None' = None, header: 'int | None' = None) -> 'Data'",
    "plan": "(procedure: 'str | Path', bench: 'str | Path', *, out: 'str | Path' = 'runs', usage: 'float | None' = "
    "None, world: 'str | Path | None' = None, on_progress: 'Callable[[Progress], None]' = <lambda>) -> 'Plan'",
    "run": "(procedure: 'str | Path', bench: 'str | Path', *, dry: 'bool' = True, world: 'str | Path | None' = None, "
    "out: 'str | Path' = 'runs', operator: 'str | None' = None, on_progress: 'Callable[[Progress], None]' = <lambda>)"
    " -> 'Run'",
}
RESULT = {"plot", "to_json", "to_pandas", "to_xarray", "blocks", "notes", "frame"}
MEMBERS = {
    "Budget": RESULT | {"report"},
    "Data": {"table", "fit", "trace"},
    "Calibration": RESULT | {"infer", "inside", "report", "save"},
    "Trace": RESULT | {"report", "verdicts"},
    "ControlChart": RESULT | {"as_drift", "report"},
    "Inferred": RESULT | {"columns", "words"},
    "Observations": RESULT | {"columns", "provenance", "simulated"},
    "Plan": RESULT | {"finish", "finish_latest", "overdue"},
    "Run": RESULT | {"complete", "data"},
    "Result": RESULT,
}
ERRORS = {"BenchFault", "BusyError", "ConfigurationError", "RigError", "RunFileError", "StorageError", "UsageError"}


def test_what_is_public_is_written_down():
    assert set(rig.__all__) == {*PUBLIC, *MEMBERS, *ERRORS, "DataError", "Plots"}
    assert {*rig.__all__, "__version__"} <= set(dir(rig))
    for name, signature in PUBLIC.items():
        told = re.sub(r"<function <lambda> at \w+>", "<lambda>", str(inspect.signature(getattr(rig, name))))
        assert told == signature, name
    for name, members in MEMBERS.items():
        has = {member for member in dir(getattr(rig, name)) if not member.startswith("_")}
        fields = set(getattr(getattr(rig, name), "__dataclass_fields__", ()))
        assert has - fields == members, name
    for name in ERRORS:
        assert issubclass(getattr(rig, name), rig.RigError)
    assert not issubclass(rig.DataError, rig.RigError)


PROCEDURE = """
kind = "pitch-roll"
name = "few angles"
replications = 2
[design]
type = "T6"
[settle]
dwell_s = 2
[measure]
readings = 4
"""


@pytest.fixture
def folder(tmp_path, monkeypatch, table):
    """The folder of all examples: a run, tables, a procedure on a bench, readings."""
    shutil.copy(ATTITUDE, tmp_path / "night.sqlite")
    shutil.copy(table, tmp_path / "line.csv")
    (tmp_path / "line-2026.csv").write_text(line(seed=8))
    for name, seed in (("cell", 7), ("cell-2025", 7), ("cell-2026", 8)):
        (tmp_path / f"{name}.csv").write_text(line(seed).replace("y_mV", "y_V"))
    for name in ("bench.toml", "world.toml"):
        shutil.copy(dry.LAB / name, tmp_path)
    shutil.copy(dry.LAB / "equipment.toml", tmp_path / "register.toml")
    (tmp_path / "procedure.toml").write_text(PROCEDURE)
    (tmp_path / "readings.csv").write_text("x_V,y_V,z_V\n-2.485,4.308,0.016\n0.1,0,-5.05\n")
    monkeypatch.chdir(tmp_path)


def complaints(text: str, name: str, least: int) -> str:
    """What is wrong with the examples in a text, of which there are so many at least."""
    examples = doctest.DocTestParser().get_doctest(text, {"rig": rig}, name, name, 0)
    assert len(examples.examples) >= least
    told: list[str] = []
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    doctest.DocTestRunner(optionflags=flags).run(examples, out=told.append)
    return "".join(told)


def test_the_examples_of_the_document_run(folder):
    assert complaints((ROOT / "docs" / "how_to" / "python.md").read_text().replace("```", ""), "python.md", 20) == ""


def own_docstrings() -> dict[str, str]:
    """Docstrings with an example, of public names and of what they define or inherit, by name."""
    found = {}
    for name in sorted({*PUBLIC, *MEMBERS}):
        members = [m for m in MEMBERS.get(name, ()) if not hasattr(object, m)]
        for path in (name, *(f"{name}.{member}" for member in sorted(members))):
            one = getattr(rig, name) if path == name else inspect.getattr_static(getattr(rig, name), path.split(".")[1])
            text = inspect.getdoc(one) or ""
            if ">>>" in text and text not in found.values():
                found[path] = text
    return found


EXAMPLES = own_docstrings()


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_of_public_names_run(folder, name):
    assert complaints(EXAMPLES[name], name, 1) == ""


def test_public_functions_and_methods_that_take_something_have_an_example():
    assert {name for name in PUBLIC if name not in EXAMPLES} == set()
    assert {"Data.fit", "Data.trace", "Calibration.save", "Calibration.infer", "Trace.verdicts"} <= EXAMPLES.keys()


@pytest.mark.parametrize(
    "module",
    [
        "rig.drivers.roles",
        "rig.fitter.budget.budget",
        "rig.fitter.decision.rules",
        "rig.fitter.effects.own",
        "rig.fitter.formula",
        "rig.fitter.quantiles",
        "rig.fitter.rounding",
        "rig.procedures.plan.run_list",
    ],
)
def test_the_examples_of_what_plug_ins_import_run(module):
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted > 0
    assert found.failed == 0


def test_the_document_names_all_that_is_public():
    text = (ROOT / "docs" / "how_to" / "python.md").read_text()
    assert [
        name for name in rig.__all__ if not re.search(rf"\b{name}\b", text) and name not in ("Plots", "Result")
    ] == []


def test_a_number_too_large_for_a_double_is_named_and_no_calibration_file_is_written():
    """Found by the fuzz of CSV files: a spread that overflows was written half and ended in a traceback."""
    told = {"sensors": {"y": {"coefficients": [1.0, float("inf")], "df": None}}, "unused": "nothing"}
    assert first_endless(told) == ("sensors.y.coefficients.1", float("inf"))
    assert first_endless({"sensors": {"y": {"coefficients": [1.0]}}}) is None
