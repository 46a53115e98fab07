"""Hard factors that are no temperatures: a fixture that a person changes, a line pressure that a source holds."""

from __future__ import annotations

import itertools
import json
from types import SimpleNamespace

import general_lab as lab
import pytest
from command import rig
from few_points import Killed, kill_where, records
from general_lab import run_dry

from rig.cli.progress import run_progress
from rig.drivers.roles import SourceState
from rig.engine.axes import SourceMover
from rig.engine.session import Outcome, Progress, Signals
from rig.engine.sweeps import Sweeps
from rig.procedures.plan.run_list import Factor
from rig.run_file.events.bench import Fault
from rig.run_file.events.by_hand import AskedToSet
from rig.run_file.events.points import WholePlotBegan, WholePlotLost
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.sense import judged
from rig.runs.controller import resume_run
from rig.tables.table_of_run import run_table

FIXTURE = (
    lab.SOURCE.replace('input_V = "calibrator"', 'input_V = "calibrator"\ngap_mm = "operator"').replace(
        "input_V = [-8, 8]", "input_V = [-8, 8]\ngap_mm = [0, 5]"
    )
    + '[instruments.operator]\ndriver = "person"\nsay = "put the shim of {value} mm under the probe"\n'
)
FIXTURE_WORLD = """seed = 2
[sensors.meter]
formula = "0.01 + 0.02*gap_mm + 1.00002*input_V + seat"
noise = 1e-6
[draws.seat]
of = "gap_mm"
sd = 0.003
[sources.input_V]
time_constant_s = 0.3
[person]
sets_s = 20
"""
FIXTURE_PROCEDURE = """kind = "general"
name = "shims"
seed = 3
replications = REPLICATIONS
[factors.input_V]
levels = [-5, 0, 5]
[factors.gap_mm]
levels = [1, 2]
hard = true
[settle]
dwell_s = 3
[model]
formula = "1 + input_V + gap_mm"
"""


PLOTS = "gap_mm,input_V,whole_plot\n" + "".join(
    f"{gap},{volts},{plot}\n" for plot, gap in ((1, 1), (2, 1), (3, 2)) for volts in (-5, 5)
)


def fixture(replications=2):
    return FIXTURE_PROCEDURE.replace("REPLICATIONS", str(replications)), FIXTURE, FIXTURE_WORLD


def events(path, kind):
    return [r.event for r in records(path) if isinstance(r.event, kind)]


def makes_sense(path):
    with RunReader.open(path) as reader:
        assert judged(reader, 9).findings == ()


def killed_at(folder, done, procedure):
    with pytest.raises(Killed):
        run_dry(folder, procedure, FIXTURE, FIXTURE_WORLD, on_progress=kill_where(lambda news: news.done == done))
    (path,) = folder.glob("*.sqlite")
    assert resume_run(path, signals=Signals(), on_progress=lambda _: None).outcome is Outcome.COMPLETE
    makes_sense(path)
    return path


def test_a_person_sets_a_fixture_for_every_whole_plot_and_its_error_is_that_of_whole_plots(tmp_path):
    path, result = run_dry(tmp_path, *fixture(4))
    assert result.outcome is Outcome.COMPLETE, result.message
    makes_sense(path)
    gaps = [event.settings["gap_mm"] for event in events(path, WholePlotBegan)]
    assert gaps == [event.setpoint for event in events(path, AskedToSet)] == [2, 1] * 4
    fitted = json.loads(rig("fit", path, "--json").stdout)
    assert fitted["sigma_wholeplot"] == pytest.approx(0.003, rel=0.5)
    assert fitted["sigma_subplot"] < 2e-5
    assert fitted["coefficients"]["gap_mm"]["df"] == pytest.approx(6)


def test_a_fixture_that_stands_already_is_undone_first(tmp_path):
    procedure = FIXTURE_PROCEDURE.replace("REPLICATIONS", "1").replace("levels = [1, 2]", 'order = "as written"')
    procedure = procedure.replace("levels = [-5, 0, 5]", "") + '[design]\ntype = "file"\npoints = "p.csv"\n'
    (tmp_path / "p.csv").write_text(PLOTS)
    path, result = run_dry(tmp_path, procedure, FIXTURE, FIXTURE_WORLD)
    assert result.outcome is Outcome.COMPLETE, result.message
    makes_sense(path)
    asked = [(event.setpoint, event.say) for event in events(path, AskedToSet)]
    assert [gap for gap, _ in asked] == [1, 1, 2]
    assert [say.startswith("undo it") for _, say in asked] == [False, True, False]
    table = run_table(path).columns
    assert (
        len(
            {
                round(v - 1.00002 * u - 0.02 * g, 4)
                for v, u, g in zip(*(table[n] for n in ("meter_V", "input_V", "gap_mm")), strict=True)
            }
        )
        == 3
    )


def test_a_fixture_stands_over_a_short_interruption_and_is_asked_for_again_where_that_is_not_to_be_relied_on(tmp_path):
    procedure = FIXTURE_PROCEDURE.replace("REPLICATIONS", "1")
    stood = killed_at(tmp_path / "stood", 4, procedure)
    assert len(events(stood, AskedToSet)) == len(events(stood, WholePlotBegan)) == 2
    asked = killed_at(tmp_path / "asked", 4, procedure + "[recovery]\ncontinue_gap_s = 0\n")
    assert [event.setpoint for event in events(asked, AskedToSet)] == [2, 1, 1]
    (lost,) = events(asked, WholePlotLost)
    assert lost.kept == 1
    assert len(run_table(asked).columns["meter_V"]) == 7, "the reading of the lost whole plot is kept"


def test_a_fixture_is_asked_for_again_after_a_time_in_which_the_controller_had_no_turn(tmp_path, monkeypatch):
    measure, calls = Sweeps.measure, itertools.count()

    def late(self, *args):
        if next(calls) == 1:
            self._clock._clock.sleep(1000.0)  # nobody waits for it
        return measure(self, *args)

    monkeypatch.setattr(Sweeps, "measure", late)
    path, result = run_dry(tmp_path, FIXTURE_PROCEDURE.replace("REPLICATIONS", "1"), FIXTURE, FIXTURE_WORLD)
    assert result.outcome is Outcome.COMPLETE, result.message
    makes_sense(path)
    assert [(event.kept, "left alone for" in event.reason) for event in events(path, WholePlotLost)] == [(1, True)]
    assert [event.setpoint for event in events(path, AskedToSet)] == [2, 2, 1]


@pytest.mark.parametrize(("value", "stopped"), [(3.995, False), (3.9, True)])
def test_a_source_at_its_setting_is_left_alone_when_motion_stops(value, stopped):
    """Commanding its present value would be another setting, with an error of its own."""
    stops = []
    state = SourceState(setpoint=4.0, value=value, settled=False, output=True, safe=False, faults=())
    source = SimpleNamespace(read=lambda: state, stop=lambda: stops.append(1))
    SourceMover(source, Factor("line_bar", "line", hard=True), 0.01).stop()
    assert stops == [1] * stopped


LINE = (
    lab.SOURCE.replace('input_V = "calibrator"', 'input_V = "calibrator"\nline_psia = "supply"').replace(
        "input_V = [-8, 8]", "input_V = [-8, 8]\nline_psia = [0, 15.5]"
    )
    + lab.PACE
)
LINE_WORLD = """seed = 2
[sensors.meter]
formula = "0.01 + 0.02*line_psia + 1.00002*input_V"
noise = 1e-6
[sources.input_V]
time_constant_s = 0.3
"""
LINE_PROCEDURE = FIXTURE_PROCEDURE.replace("gap_mm", "line_psia").replace("REPLICATIONS", "1")
LINE_PROCEDURE = LINE_PROCEDURE.replace("levels = [1, 2]", "levels = [2, 4]\nband = 0.05\ndrift_per_s = 0.05")


@pytest.mark.parametrize("faults", ["", '[[faults]]\nkind = "power-cycle"\non = "supply"\nat_s = 55\n'])
def test_an_instrument_holds_a_pressure_for_a_whole_plot_which_is_measured_again_where_it_was_lost(tmp_path, faults):
    path, result = run_dry(tmp_path, LINE_PROCEDURE, LINE, LINE_WORLD + faults)
    assert result.outcome is Outcome.COMPLETE, result.message
    makes_sense(path)
    pressures = [event.settings["line_psia"] for event in events(path, WholePlotBegan)]
    assert pressures == ([4, 4, 2] if faults else [4, 2])
    assert [event.kept for event in events(path, WholePlotLost)] == ([1] if faults else [])
    table = run_table(path).columns
    assert len(table["meter_V"]) == (7 if faults else 6)
    assert table["line_readback_psia"] == pytest.approx(table["line_psia"], abs=1e-3)


def test_a_pressure_that_stands_is_left_before_it_is_set_for_another_whole_plot(tmp_path):
    points = PLOTS.replace("gap_mm", "line_psia")
    procedure = LINE_PROCEDURE.replace("levels = [2, 4]", 'order = "as written"').replace("levels = [-5, 0, 5]", "")
    (tmp_path / "p.csv").write_text(points)
    told = []
    path, result = run_dry(
        tmp_path,
        procedure + '[design]\ntype = "file"\npoints = "p.csv"\n',
        LINE,
        LINE_WORLD,
        on_progress=lambda news: told.append(news.message),
    )
    assert result.outcome is Outcome.COMPLETE, result.message
    makes_sense(path)
    assert [event.settings["line_psia"] for event in events(path, WholePlotBegan)] == [1, 1, 2]
    assert "setting whole plot 2 of 3" in told


WEIGHTS_IN_A_CHAMBER = f"""name = "a stand in a chamber"
{lab.DVM}{lab.CHAMBER}{lab.PERSON}
[sensors.cell]
reader = "dvm"
unit = "mV"
[factors]
force_kN = "operator"
bath_degC = "oven"
[limits]
force_kN = [0, 10]
bath_degC = [-60, 100]
"""
SLOW_PERSON = """seed = 2
[sensors.cell]
formula = "100 + 5*force_kN + bath_degC"
noise = 0.01
[person]
sets_s = 1500
"""
WARM_WEIGHTS = """kind = "general"
name = "weights in a chamber"
seed = 1
[factors.force_kN]
levels = [0, 2, 5]
[factors.bath_degC]
levels = [15, 35]
hard = true
[soak]
dwell_s = 300
[measure]
readings = 2
[model]
formula = "1 + force_kN + bath_degC"
"""


def test_a_whole_plot_that_is_seen_to_stand_waits_for_a_person_as_long_as_it_takes(tmp_path):
    path, result = run_dry(tmp_path, WARM_WEIGHTS, WEIGHTS_IN_A_CHAMBER, SLOW_PERSON)
    assert result.outcome is Outcome.COMPLETE, result.message
    assert events(path, WholePlotLost) == [], "25 minutes, and continue_gap_s is 10"
    makes_sense(path)


@pytest.mark.parametrize(("for_s", "lost"), [(10, 0), (1100, 1)])
def test_a_whole_plot_that_did_not_stand_while_a_person_was_waited_for_is_lost(tmp_path, for_s, lost):
    door = f'[[faults]]\nkind = "door-open"\non = "oven"\nat_s = 4400\nfor_s = {for_s}\n'
    path, result = run_dry(tmp_path, WARM_WEIGHTS, WEIGHTS_IN_A_CHAMBER, SLOW_PERSON + door)
    assert result.outcome is Outcome.COMPLETE, result.message
    found = events(path, WholePlotLost)
    assert len(found) == lost
    for one in found:
        assert "longer than continue_gap_s = 600 s (seen: oven is at " in one.reason
    assert json.loads(rig("status", path, "--json").stdout)["kept_of_lost"] == 2 * lost
    says = " ".join(f.message for f in events(path, Fault))
    assert "then resume" not in says, "it goes on by itself"
    makes_sense(path)


def test_a_resumed_dry_run_says_that_its_bench_begins_anew_and_not_that_power_was_lost_alone(tmp_path):
    world = SLOW_PERSON.replace("1500", "20")
    with pytest.raises(Killed):
        run_dry(
            tmp_path, WARM_WEIGHTS, WEIGHTS_IN_A_CHAMBER, world, on_progress=kill_where(lambda news: news.done == 1)
        )
    (path,) = tmp_path.glob("*.sqlite")
    assert resume_run(path, signals=Signals(), on_progress=lambda _: None).outcome is Outcome.COMPLETE
    (lost,) = events(path, WholePlotLost)
    assert lost.reason.startswith("the bench of a dry run begins anew in each session: ")
    makes_sense(path)


def test_a_plan_says_that_a_person_sets_a_factor_and_not_its_overtravel(tmp_path):
    files = lab.written(tmp_path, WARM_WEIGHTS, WEIGHTS_IN_A_CHAMBER, SLOW_PERSON)
    shown = rig("plan", files[0], "--bench", files[1]).stdout
    assert "force_kN from 0 to 5, set by a person; limits 0 to 10: ok" in shown
    assert "a person is at the bench for the whole run, and sets force_kN as quickly as in the rehearsal" in shown
    assert "bath_degC from 15 to 35;" in shown


def test_a_log_of_a_dry_run_has_no_line_for_what_a_simulated_person_does_at_once(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("rig.cli.progress.RealClock", lambda: SimpleNamespace(stopwatch=lambda: now[0]))
    asked = Progress("holding", 1, 20, 5.0, None, "to do by hand: put on 2 kN; then `rig done x`")
    with run_progress(simulated=True) as show:
        show(Progress("soaking", 1, 20, 4.0, None, "soaking"))
        show(asked)
        show(asked)
        now[0] = 2.0
        assert "by hand" not in capsys.readouterr().err
        show(asked)
    assert "put on 2 kN" in capsys.readouterr().err, "a real person is waited for"
    with run_progress(simulated=False) as show:
        show(asked)
    assert "put on 2 kN" in capsys.readouterr().err
