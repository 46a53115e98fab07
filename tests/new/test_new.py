"""`rig new`: answers become files, which pass `rig plan` and a dry run at once; wrong answers are refused at once."""

from __future__ import annotations

import json
import re
import tomllib

import pytest
from command import rig

from rig.errors import UsageError
from rig.new import instruments
from rig.new.files import NAMES, texts, write
from rig.new.questions import QUESTIONS, completed, due

ONE = """
quantity = "voltage"
levels = "0 to 10 in 3"
sets_with = "keithley-2400"
sets_at = "/dev/rig/smu"
reads = "transducer"
reads_with = "keysight-34401a"
reads_at = "/dev/rig/dvm"
replications = 2
model = "line"
"""
CHAMBER = """
quantity = "pressure"
sets_in = "kPa"
levels = [10, 50, 100]
sets_with = "fluke-ppc4"
reads_in = "mV"
reads_with = "keysight-34970a"
channels = 2
chamber = "watlow-f4t"
chamber_degC = [20, 40]
soak_min = 5
order = "random"
replications = 1
model = "1 + pressure_kPa + chamber_degC"
[reads_options]
channels = { 101 = "volts", 103 = "volts" }
"""
DIAL = """
quantity = "pressure"
levels = [0, 5, 10]
sets_with = "person"
reads = "gauge"
reads_in = "bar"
reads_with = "person"
resolution = 0.02
replications = 1
"""

FLOW = """
quantity = "valve"
sets_in = "V"
levels = [1, 5.5, 10]
sets_with = "scpi-source"
sets_at = "socket://192.0.2.31:5025"
standard = "flow_kg_per_min"
standard_with = "scpi-meter"
standard_at = "socket://192.0.2.33:5025"
standard_range = [0.5, 3.8]
reads = "mfs"
reads_in = "Hz"
reads_range = [300, 4200]
reads_with = "scpi-meter"
channels = 4
reads_at = "socket://192.0.2.35:5025"
chamber = "scpi-source"
chamber_degC = [10, 40]
soak_min = 5
replications = 1
model = "line"
"""
"""Four sensors on meters of one channel each; a standard reads what the valve makes."""

DAQ = ONE.replace("keysight-34401a", "can-daq").replace("/dev/rig/dvm", "can:socketcan/can0")
"""Its first channel reads degC; that in volts is its last."""


def made(tmp_path, answers: str):
    (tmp_path / "given.toml").write_text(answers)
    done = rig("new", "lab", "--answers", "given.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    return done, tmp_path / "lab"


@pytest.mark.parametrize(
    ("answers", "points"),
    [(ONE, 10), (CHAMBER, 6), (DIAL, 5), (DAQ, 10), (FLOW, 10)],
    ids=["serial", "chamber", "dial", "can", "flow"],
)
def test_files_pass_a_plan_and_a_dry_run_at_once(tmp_path, answers, points):
    done, lab = made(tmp_path, answers)
    assert f"{points} points" in done.stdout
    assert "latest" in done.stdout
    assert {path.name for path in lab.iterdir()} == set(NAMES)
    dry = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", cwd=lab)
    assert dry.returncode == 0, dry.stderr
    assert f"complete: {points} of {points} points" in dry.stderr
    assert "warning" not in dry.stderr


def test_a_chamber_is_a_factor_of_whole_plots_with_its_model(tmp_path):
    _, lab = made(tmp_path, CHAMBER)
    bench, procedure = (tomllib.loads((lab / name).read_text()) for name in ("bench.toml", "procedure.toml"))
    assert bench["factors"] == {"pressure_kPa": "source", "chamber_degC": "chamber"}
    assert {one["channel"] for one in bench["sensors"].values()} == {"101", "103"}
    assert procedure["factors"]["chamber_degC"]["hard"]
    assert procedure["model"]["abscissa"] == "pressure_kPa"


def test_a_meter_of_one_channel_is_there_once_for_each_sensor_and_a_standard_reads_what_is_set(tmp_path):
    """Only one sensor could be had with scpi-meter, and a model in what a standard reads was refused."""
    _, lab = made(tmp_path, FLOW)
    bench, procedure, world, settings, register = (
        tomllib.loads((lab / f"{name}.toml").read_text())
        for name in ("bench", "procedure", "world", "certificate", "equipment")
    )
    meters = [f"meter_{k}" for k in range(1, 5)]
    assert {name: one["reader"] for name, one in bench["sensors"].items()} == {
        f"mfs_{k}": meter for k, meter in enumerate(meters, 1)
    }
    assert len({bench["instruments"][meter]["address"] for meter in meters}) == 4
    assert bench["references"] == {"flow_kg_per_min": {"reader": "standard", "of": "valve_V"}}
    assert procedure["model"] == {"formula": "1 + flow_kg_per_min", "abscissa": "flow_kg_per_min"}
    assert world["references"]["flow_kg_per_min"]["formula"] == "0.5 + 0.366667*(valve_V - 1)"
    assert [one["flow_kg_per_min"] for one in settings["at"]] == [0.5, 2.15, 3.8]
    assert {"REF-01", *(f"READ-0{k}" for k in range(1, 5))} < set(register["equipment"])
    again = rig("new", "second", "--answers", "lab/answers.toml", cwd=tmp_path)
    assert again.returncode == 0, again.stderr


def test_every_option_that_stands_there_as_a_comment_can_be_used(tmp_path):
    _, lab = made(tmp_path, FLOW)
    bench, world = lab / "bench.toml", lab / "world.toml"
    for path in (bench, world):
        lines = path.read_text().splitlines(keepends=True)
        path.write_text(
            "".join(one.removeprefix("# ") if " = " in one.partition("#")[2][:30] else one for one in lines)
        )
    assert "hidden =" in world.read_text()
    assert tomllib.loads(bench.read_text())["instruments"]["standard"]["check"] == {"UNIT?": "KG_PER_MIN"}
    command = ("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml")
    done = rig(*command, cwd=lab)
    assert done.returncode == 0, done.stderr
    assert "complete: 10 of 10 points" in done.stderr


def test_the_last_lines_say_what_has_to_be_seen_to_before_a_run(tmp_path):
    """A register that was filled after the run was not that of the run, and limits that nobody was asked for were not
    mentioned.
    """
    told, _ = made(tmp_path, FLOW)
    *_, limits, register, written, there, run = told.stderr.splitlines()
    assert limits == (
        "the limits in bench.toml are made of the levels (valve_V 0 to 10, chamber_degC 0 to 40): set them to what "
        "bench and sensors stand"
    )
    assert register.startswith("for a certificate, fill in equipment.toml before the run: a run keeps the register as")
    assert (written, there.strip(), run.split()[:2]) == ("written into lab; next:", "cd lab", ["rig", "run"])


def test_the_register_has_the_models_that_were_said(tmp_path):
    """Its models were empty, whatever had been answered."""
    options = '[standard_options]\nmodel = "CMF010"\n[reads_options]\nmodel = "53220A"\n'
    _, lab = made(tmp_path, FLOW + options)
    own = tomllib.loads((lab / "equipment.toml").read_text())["equipment"]
    assert {asset: (one["maker"], one["model"]) for asset, one in own.items()} == {
        "SET-01": ("", ""),
        "REF-01": ("", "CMF010"),
        **{f"READ-0{k}": ("", "53220A") for k in range(1, 5)},
        "CH-01": ("", ""),
    }
    (tmp_path / "one").mkdir()
    _, lab = made(tmp_path / "one", ONE)
    own = tomllib.loads((lab / "equipment.toml").read_text())["equipment"]
    assert (own["SET-01"]["maker"], own["SET-01"]["model"]) == ("KEITHLEY INSTRUMENTS INC.", "MODEL 2400")
    assert (own["READ-01"]["maker"], own["READ-01"]["model"]) == ("", "34401A")


def test_the_scatter_that_a_plan_may_expect_is_that_of_an_observation_in_this_world(tmp_path):
    """It was that of a mean over 1 s, and an observation is the mean of five readings of half a second."""
    _, lab = made(tmp_path, FLOW)
    text = (lab / "procedure.toml").read_text()
    assert "scatter of one observation, in Hz;\n# sigma = { mfs_1 = 0.25, mfs_2 = 0.25," in text
    assert "here as in world.toml, of 5 readings\n" in text
    assert re.search(r"noise = 0\.4 +# standard deviation of a mean over 1 s\n", (lab / "world.toml").read_text())
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=lab)
    (run,) = (lab / "runs").glob("*.sqlite")
    sensors = json.loads(rig("fit", run, "--json", cwd=lab).stdout)["sensors"].values()
    assert all(0.5 < one["sigma_subplot"] / 0.25 < 2.0 for one in sensors), done.stderr


def test_numbers_are_proposed_that_a_person_would_say():
    answers = completed(tomllib.loads(FLOW.replace("reads_range = [300, 4200]\n", "")), "given")
    assert answers["reads_range"] == [100.0, 1000.0]
    narrow = FLOW.replace("reads_range = [300, 4200]\n", "").replace("[0.5, 3.8]", "[3.7, 3.8]")
    assert completed(tomllib.loads(narrow), "given")["reads_range"] == [970.0, 1000.0]


def test_limits_are_no_wider_than_those_of_the_instrument(tmp_path):
    valve = """
quantity = "valve"
sets_in = "V"
levels = [1, 5, 10]
sets_with = "scpi-source"
reads_in = "V"
reads_with = "keysight-34401a"
[sets_options]
low = 0
high = 10
"""
    _, lab = made(tmp_path, valve)
    assert tomllib.loads((lab / "bench.toml").read_text())["limits"] == {"valve_V": [0.0, 10.0]}


def test_somebody_who_does_not_know_gets_the_straight_line_and_is_told(tmp_path):
    done, lab = made(tmp_path, DIAL)
    assert "no model was named: the straight line is taken" in " ".join(done.stderr.split())
    text = (lab / "procedure.toml").read_text()
    assert 'formula = "1 + pressure_bar"' in text
    assert "# No model was named" in text
    points = tomllib.loads((lab / "certificate.toml").read_text())["at"]
    assert points == [{"pressure_bar": 0.0}, {"pressure_bar": 5.0}, {"pressure_bar": 10.0}]


def test_the_answers_are_kept_and_make_the_same_files(tmp_path):
    _, lab = made(tmp_path, CHAMBER)
    again = completed(tomllib.loads((lab / "answers.toml").read_text()), "answers.toml")
    assert texts(again) == {name: (lab / name).read_text() for name in NAMES}


def test_every_line_of_register_world_and_bench_can_be_used_when_its_mark_is_taken_away(tmp_path):
    _, lab = made(tmp_path, ONE)
    path = lab / "equipment.toml"
    day = "a day on which the certificates of the register are valid"
    told = " ".join(rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=lab).stdout.split())
    assert day not in told
    usual = "begins on 2026-01-15: the usual date of dry runs, as equipment.toml states no date of a certificate"
    assert f"with --dry it {usual}" in told
    run = ("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", "--create-only")
    assert f"SIMULATED it {usual}" in rig(*run, cwd=lab).stderr
    path.write_text("".join(line.removeprefix("# ") for line in path.read_text().splitlines(keepends=True)[2:]))
    path.write_text(path.read_text().replace("2027-01-31", "2999-01-31"))
    done = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=lab)
    assert done.returncode == 0, done.stderr
    assert day in done.stdout
    assert "the register states no error" not in done.stdout
    done = rig(*run, cwd=lab)
    assert done.returncode == 0, done.stderr
    assert day in done.stderr


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("levels = [1, 1]", "levels: 1 is there twice"),
        ('levels = "0,5 1,5"', "levels: the decimal sign is a point"),
        ('levels = "zero one"', "levels: 'zero' is no number"),
        ('quantity = "2 forces"', "quantity: '2 forces' is no name"),
        ('sets_in = "°"', "sets_in: '°' is no unit"),
        ('sets_with = "keithley-2400"', "sets_with: keithley-2400 sets V, not kN; possible are "),
        ('sets_with = "hp-3458a"', "sets_with: hp-3458a sets nothing; possible are "),
        ('sets_with = "acme"', "sets_with: 'acme' is not installed; possible are "),
        ('reads_in = "Hz"\nreads_with = "hp-3458a"', "reads_with: hp-3458a does not read Hz"),
        ('reads_in = "degC"\nchannels = 9\nreads_with = "css-canmod-temp"', "channels: css-canmod-temp has 4 of degC"),
        ('channels = 2\nreads_at = "/dev/a"\nreads_at_2 = "/dev/a"', "reads_at_2: /dev/a is the address of"),
        ('standard = "flow"', "standard: flow has to be a name with its unit, such as flow_kg_per_min, or none"),
        ('standard = "force_N"', "standard: it is read as force_kN, in the unit in which it is set"),
        ('reads_at = "COM"', "reads_at: COM is not an address of a serial line; write /dev/ttyUSB0"),
        ('quantity = "voltage"\nsets_with = "keithley-2400"\nsets_at = "/dev/a"\nreads_at = "/dev/a"',
         "reads_at: /dev/a is the address of keithley-2400; each"),
        ('chamber = "espec-scp220"\nchamber_degC = [20, 400]', "chamber_degC: espec-scp220 goes from -40 to 150"),
        ("reads_range = [1, 2, 3]", "reads_range: it is two numbers, that at the lowest level first, and here are 3"),
        ('order = "down"', "order: 'down' is not one of up-down, random, as written"),
        ("replications = 1.5", "replications: 1.5 is not a whole number"),
        ('model = "parabola"\nlevels = [0, 1]', "model: 2 levels do not determine it"),
        ('model = "1 + force_N"', "model: force_N is neither set nor read by a standard here; a formula has force_kN"),
        ('modle = "line"', "modle is not asked with these answers; did you mean model?"),
        ('reads_with = "keysight-34970a"\n[reads_options]\nchannels = { 1 = "volts" }', "reads_options.channels: "),
    ],
)  # fmt: skip
def test_a_wrong_answer_is_refused_with_what_is_possible(tmp_path, wrong, said):
    (tmp_path / "given.toml").write_text(wrong)
    done = rig("new", "lab", "--answers", "given.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert f"given.toml: {said}" in done.stderr
    assert not (tmp_path / "lab").exists()


def test_no_file_is_overwritten_and_none_is_left_of_a_write_that_failed(tmp_path, monkeypatch):
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "world.toml").write_text("mine")
    (tmp_path / "given.toml").write_text("")
    done = rig("new", "lab", "--answers", "given.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "lab has world.toml already, which is not overwritten" in done.stderr
    assert [path.name for path in (tmp_path / "lab").iterdir()] == ["world.toml"]
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="does not exist"):
        write(tmp_path / "other", {"a.toml": "x", "b/c.toml": "y"})
    assert not (tmp_path / "other").exists()


def test_show_prints_and_writes_nothing(tmp_path):
    (tmp_path / "given.toml").write_text(DIAL)
    done = rig("new", "--answers", "given.toml", "--show", cwd=tmp_path)
    assert done.returncode == 0
    assert all(f"# ---- {name}" in done.stdout for name in NAMES)
    assert [path.name for path in tmp_path.iterdir()] == ["given.toml"]


def test_a_file_of_ones_own_instrument_is_offered_and_copied(tmp_path):
    from rig.bench.plugins import declared  # noqa: PLC0415

    (tmp_path / "my_bath.toml").write_text(declared()["fluke-7341"])
    _, lab = made(tmp_path, 'quantity = "temperature"\nlevels = [20, 40]\nsets_with = "./my_bath.toml"\nsoak_min = 1\n')
    assert (lab / "my_bath.toml").read_text().strip() == declared()["fluke-7341"].strip()
    assert 'driver = "./my_bath.toml"' in (lab / "bench.toml").read_text()
    done = rig("new", "second", "--answers", "lab/answers.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_every_question_has_a_default_that_its_check_takes_and_an_explanation_of_a_line():
    answers = completed({}, "nothing")
    assert set(answers) < {one.key for one in QUESTIONS}
    for question in due(answers):
        assert question.check(question.default(answers), answers) == answers[question.key]
        assert question.why
        assert "\n" not in question.why


def test_instruments_are_offered_by_role_and_unit():
    answers = completed({}, "nothing")
    found = instruments.offered("sets", {**answers, "sets_in": "degC"})
    assert {"julabo-fp50", "watlow-f4t", "person", "scpi-source"} <= set(found)
    assert not {"keithley-2400", "hp-3458a", "newport-esp301"} & set(found)


def test_a_driver_that_cannot_be_loaded_is_not_offered_and_stops_nobody(monkeypatch):
    answers = completed({}, "nothing")
    monkeypatch.setattr(instruments, "drivers", lambda: ["hp-3458a", "of-another-package"])
    assert list(instruments.offered("reads", answers)) == ["hp-3458a"]


def test_a_chamber_reads_back_and_a_plan_says_where_nothing_does(tmp_path):
    """Nothing else would wait until the temperature is there."""
    _, lab = made(tmp_path, FLOW)
    bench = lab / "bench.toml"
    own = tomllib.loads(bench.read_text())["instruments"]["chamber"]
    assert (own["read"], own["tolerance"], own["time_constant_s"]) == ("READ?", 0.1, 300)
    planned = ("plan", lab / "procedure.toml", "--bench", bench)
    words = "chamber_degC: nothing reads how far it has come"
    assert words not in " ".join(rig(*planned).stdout.split())
    bench.write_text(re.sub(r"(?m)^(read|tolerance|time_constant_s) = .*\n", "", bench.read_text()))
    told = rig(*planned)
    assert words in " ".join(told.stdout.split()), told.stdout + told.stderr


@pytest.mark.parametrize(
    ("given", "formula", "noise"),
    [
        (FLOW, "-290.9 + 1182*flow_kg_per_min", 0.4),
        (FLOW.replace("reads_range = [300, 4200]\n", ""), "-36.36 + 272.7*flow_kg_per_min", 0.09),
        (ONE, "0 + 1*voltage_V", 0.001),
        ("", "0 + 0.1*force_kN", 0.0001),
        (DIAL, "0 + 1*pressure_bar", 0.01),
        (DIAL + "reads_range = [9, 1]\n", "9 - 0.8*pressure_bar", 0.01),
    ],
    ids=["as said", "Hz", "its own unit", "V", "a dial, which an eye reads", "falling"],
)
def test_a_simulated_sensor_reads_what_the_real_one_does(given, formula, noise):
    """A meter in Hz that reads thousands had a world of 0.01 + 0.345 x, with noise of 0.0001."""
    world = texts(completed(tomllib.loads(given), "given"))["world.toml"]
    sensors = tomllib.loads(world)["sensors"].values()
    assert {(one["formula"], one["noise"]) for one in sensors} == {(formula, noise)}


def test_a_thermometer_beside_the_chambers_own_reading_is_its_reference(tmp_path):
    thermometer = 'thermometer_with = "scpi-meter"\nthermometer_at = "socket://192.0.2.39:5025"\n'
    told, lab = made(tmp_path, FLOW + thermometer)
    bench, register = (tomllib.loads((lab / f"{name}.toml").read_text()) for name in ("bench", "equipment"))
    assert bench["references"]["chamber_degC"] == {"reader": "thermometer"}
    assert bench["instruments"]["thermometer"]["unit"] == "degC"
    assert "TH-01" in register["equipment"]
    world = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=lab)
    assert world.returncode == 0, world.stderr
    words = "chamber_degC: no other thermometer reads it; chamber's own reading is used"
    assert words not in " ".join(told.stdout.split())
    (tmp_path / "own").mkdir()
    without, _ = made(tmp_path / "own", FLOW)
    assert words in " ".join(without.stdout.split())
