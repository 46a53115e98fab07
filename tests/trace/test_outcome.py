"""What a trace says has one form, whatever kind of run it was made in; JSON is made of that in one place."""

import json

from rig.fitter.trace.outcome import Finding, Outcome, Parameter, Row, WithError, absent, run_json

CREEP = Finding(
    kind="effect",
    effect="creep",
    cause="it gives way",
    stratum="subplot",
    terms=("x", "x^2"),
    coefficients=(2.0, -1.0),
    stderr=(0.1, float("nan")),
    unit="V",
    size="2 ppm",
    share=0.4,
    p_adjusted=0.003,
    aliases=("drift",),
    separation={"drift": 0.5},
    separate_by="wait",
    more={"rms_V": 0.25},
)
GROWS = Finding("noise", "the scatter grows", "noise", 0.0, effect="noise-grows", p_adjusted=0.01)
REST = Finding("unnamed", "between points", "unnamed", 0.2, more={"order": 3})
FITTED = (
    Parameter("1", WithError(3.0, 0.5, 17, (2.0, 4.0))),
    Parameter("creep: x", WithError(2.0, None), unit="V"),
)


def outcome(**more):
    sides = ((*absent(["T_S"]), Row("sigma_E", value, "V"), Row("pct", {"5": value})) for value in (2.0, 1.0))
    before, after = sides
    return Outcome("x_V", "1 + x", "explained", (CREEP, GROWS, REST), before, after, FITTED, ("a note",), **more)


def test_json_has_a_key_a_row_and_every_finding_where_its_kind_stands():
    told = outcome().to_json()
    assert told["before"] == {"T_S": None, "sigma_E": 2.0, "pct": {"5": 2.0}}
    assert told["after"] == {"T_S": None, "sigma_E": 1.0, "pct": {"5": 1.0}}
    assert [one["effect"] for one in told["effects"]] == ["creep", "noise-grows"]
    assert told["unnamed"] == [
        {"where": "between points", "share": 0.2, "added": False, "stratum": "unnamed", "order": 3, "shape": None}
    ]
    assert told["fitted"]["coefficients"] == {
        "1": {"estimate": 3.0, "stderr": 0.5, "df": 17, "interval95": [2.0, 4.0]},
        "creep: x": {"estimate": 2.0, "stderr": None, "unit": "V"},
    }
    assert not {"refused", "sentence", "certificate"} & set(told)
    assert outcome(refused=()).to_json()["refused"] == []


def test_a_finding_says_all_of_it_and_no_number_that_is_none():
    told = json.loads(json.dumps(CREEP.to_json(), allow_nan=False))
    assert (told["term"], told["stderr"], told["rms_V"]) == ("x, x^2", [0.1, None], 0.25)
    assert (told["aliases"], told["separation_sigmas"]) == (["drift"], {"drift": 0.5})
    assert told["doubtful"] is None
    assert "sentence" not in told


def test_a_run_has_its_sensors_by_name_and_what_stands_beside_them():
    told = run_json(
        {"points": 3}, [outcome(sentence="x_V: creep.", certificate="It creeps.", more={"roles": {}})], unused=[]
    )
    assert (told["data"], told["unused"]) == ({"points": 3}, [])
    (sensor,) = told["sensors"].values()
    assert (sensor["sentence"], sensor["certificate"], sensor["roles"]) == ("x_V: creep.", "It creeps.", {})
