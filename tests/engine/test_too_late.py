"""Where a wait was too short, the run says which key of which file has the limit, its value, and the next step."""

from __future__ import annotations

from general_lab import BATH, BATH_WORLD, BENCH, CHAMBER, PROCEDURE, run_dry

from rig.engine.session import Outcome

NIGHT = """kind = "general"
name = "a bath that is slow"
replications = 1
[factors.bath_degC]
levels = [0, 100]
{hard}
[settle]
dwell_s = 5
timeout_s = 300
{more}
[faults]
not_settled = ["abort"]
soak = ["abort"]
[model]
formula = "1 + bath_degC"
"""
SLOW = BATH_WORLD.replace("time_constant_s = 120", "time_constant_s = 5000")
TWIN = (
    "The twin is as slow as time_constant_s of [sources.bath_degC] in the world file says, or of [instruments.bath] in "
    "the bench file (left out)."
)


def end_of(tmp_path, hard="", more="", bench=BATH, world=SLOW):
    _, result = run_dry(tmp_path, NIGHT.format(hard=hard, more=more), bench, world)
    assert result.outcome is Outcome.FAULT
    return result.message


def test_a_move_that_is_too_slow_is_told_with_its_limit_and_the_next_step(tmp_path):
    said = end_of(tmp_path)
    assert said.startswith("moving took longer than 600 s (bath at ")
    advice = said.splitlines()[1]
    assert advice == (
        "Next: raise timeout_s of [settle] in the procedure (now 300, and a move may take 600 in any case). Or allow "
        "more: a wider band in [factors.bath_degC] (now 0.1 degC), or a shorter dwell_s of [settle] (now 5). bath says "
        "that it has arrived within tolerance of [instruments.bath] in the bench file (now 0.02 degC). "
        f"{TWIN} A temperature that takes so long is better a whole plot: `hard = true` of its factor, and [soak]."
    )


def test_settling_that_is_too_slow_is_told_with_its_limit(tmp_path):
    bench = BATH.replace("tolerance = 0.02\n", "")  # it has arrived by time alone
    said = end_of(tmp_path, bench=bench)
    assert said.startswith("bath timed-out after 301 s (it reads ")
    assert "\nNext: raise timeout_s of [settle] in the procedure (now 300). Or allow more: a wider band" in said


def test_a_soak_that_is_too_slow_is_told_with_its_limits(tmp_path):
    said = end_of(tmp_path, hard="hard = true", more="[soak]\ntimeout_s = 1800\ndwell_s = 60\nrenew_degC = 5")
    assert said.splitlines()[1] == (
        "Next: raise timeout_s of [soak] in the procedure (now 1800); or allow more there: tolerance_degC (now 0.5), "
        "sensor_tolerance_degC (now 1), drift_degC_per_h (now 0.5), or a shorter dwell_s (now 60). " + TWIN
    )


def test_an_environment_that_is_too_slow_is_told_with_its_limits(tmp_path):
    asked = "[environment]\nsetpoint_degC = 60\ntimeout_s = 900\n"
    _, result = run_dry(tmp_path, PROCEDURE + asked, BENCH + CHAMBER)
    assert result.outcome is Outcome.FAULT
    assert "\nNext: raise timeout_s of [environment] in the procedure (now 900); or allow more" in result.message
