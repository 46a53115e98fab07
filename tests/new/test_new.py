"""`rig new`: answers become files, which pass `rig plan` and a dry run at once; wrong answers are refused at once."""

from __future__ import annotations

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

DAQ = ONE.replace("keysight-34401a", "can-daq").replace("/dev/rig/dvm", "can:socketcan/can0")
"""Its first channel reads degC; that in volts is its last."""


def made(tmp_path, answers: str):
    (tmp_path / "given.toml").write_text(answers)
    done = rig("new", "lab", "--answers", "given.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    return done, tmp_path / "lab"


@pytest.mark.parametrize(
    ("answers", "points"), [(ONE, 10), (CHAMBER, 6), (DIAL, 5), (DAQ, 10)], ids=["serial", "chamber", "dial", "can"]
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
    assert day not in rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=lab).stdout  # it has none yet
    path.write_text("".join(line.removeprefix("# ") for line in path.read_text().splitlines(keepends=True)[2:]))
    path.write_text(path.read_text().replace("2027-01-31", "2999-01-31"))
    done = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=lab)
    assert done.returncode == 0, done.stderr
    assert day in done.stdout
    assert "the register states no error" not in done.stdout
    done = rig(
        "run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", "--create-only", cwd=lab
    )
    assert done.returncode == 0, done.stderr


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
        ("channels = 2", "channels: fluke-8846a has 1 of V (input)"),
        ('reads_at = "COM"', "reads_at: COM is not an address of a serial line; write /dev/ttyUSB0"),
        ('quantity = "voltage"\nsets_with = "keithley-2400"\nsets_at = "/dev/a"\nreads_at = "/dev/a"',
         "reads_at: /dev/a is the address of keithley-2400; each"),
        ('chamber = "espec-scp220"\nchamber_degC = [20, 400]', "chamber_degC: espec-scp220 goes from -40 to 150"),
        ('order = "down"', "order: 'down' is not one of up-down, random, as written"),
        ("replications = 1.5", "replications: 1.5 is not a whole number"),
        ('model = "parabola"\nlevels = [0, 1]', "model: 2 levels do not determine it"),
        ('model = "1 + force_N"', "model: force_N is not set here; a formula has force_kN"),
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
