"""Tables with what the catalogue lacks: it is said, and no name is given that a shape without one equals."""

from __future__ import annotations

import numpy as np
import pytest

from proving.truth.table import Lab, options, simulate
from rig.fitter.trace.engine import family
from rig.fitter.trace.two_levels import two_levels
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def traced(columns, **told):
    return trace_general(roles_of(Table("table.csv", columns, simulated=True, provenance={}), Roles(**told))[0])


def sensor_of(n, seed, adds, **columns):
    """y = 3 + 2 x + error of sd one + what is added, in random order of x from -5 to 5, a minute from row to row."""
    rng = np.random.default_rng([seed, n])
    c = {"x": rng.permutation(np.linspace(-5.0, 5.0, n)), "t_s": np.cumsum(60.0 + 5.0 * rng.random(n))}
    c |= {name: make(rng, n) for name, make in columns.items()}
    c["y"] = 3.0 + 2.0 * c["x"] + adds(c) + rng.standard_normal(n)
    return c


def side(rng, n):
    return rng.choice([-1.0, 1.0], n)


def warm(rng, n):
    return 20.0 + np.cumsum(0.3 * rng.standard_normal(n))


def telegraph(n, stay, rng):
    return np.cumsum(rng.random(n) < 1.0 / stay) % 2


def remembering(n, rho, rng):
    out = rng.standard_normal(n)
    for i in range(1, n):
        out[i] = rho * out[i - 1] + np.sqrt(1.0 - rho**2) * out[i]
    return out


def test_neighbours_in_replications_may_be_alike():
    """With offsets of replications alone, AR 0.7 was taken for oscillations and steps in half of the tables."""
    lab = Lab(120, 1, clock=True, repeats=5, ar=0.7)
    results = [traced(simulate(lab, seed), **options(lab)) for seed in range(8, 16)]
    assert sum(bool(r.added) for r in results) <= 1  # of a limit of 5 %
    assert not any(e.family in ("periodic", "step", "drift") for r in results for e in r.added)
    assert all("autocorrelation" in [e.effect for e in r.effects] for r in results)


@pytest.mark.parametrize("seed", range(4))
def test_jumps_between_two_levels_are_said(seed):
    jumps = telegraph(160, 12.0, np.random.default_rng(seed))
    result = traced(sensor_of(160, seed, lambda _c: 3.5 * jumps), response="y", formula="1 + x", time="t_s")
    said = [rest.cause for rest in result.unnamed] + [str(effect.doubtful) for effect in result.added]
    assert any("jumps between two levels" in text for text in said)
    assert all(effect.doubtful for effect in result.added)
    assert result.verdict != "explained"


@pytest.mark.parametrize("rho", [0.5, 0.8, 0.93])
def test_noise_that_remembers_does_not_jump(rho):
    for seed in range(6):
        error = 2.0 * remembering(160, rho, np.random.default_rng(seed))
        columns = sensor_of(160, seed, lambda _c, error=error: error)
        result = traced(columns, response="y", formula="1 + x", time="t_s")
        assert not any("jumps" in rest.cause for rest in result.unnamed)


def test_two_levels_are_as_far_apart_as_they_are():
    rng = np.random.default_rng(3)
    jumps = telegraph(300, 15.0, rng)
    error = 4.0 * jumps + rng.standard_normal(300)
    basis = np.full((300, 1), 300**-0.5)
    found = two_levels(error - error.mean(), basis)
    assert found.apart == pytest.approx(4.0, rel=0.15)
    assert found.upper == pytest.approx(jumps.mean(), abs=0.16)
    normal = -150.0 * np.log(np.var(error))
    assert found.log_likelihood > normal + 50.0
    plain = rng.standard_normal(300)
    assert two_levels(plain - plain.mean(), basis).log_likelihood < -150.0 * np.log(np.var(plain)) + 2.0
    assert two_levels(np.zeros(300), basis) is None


@pytest.mark.parametrize(
    "adds",
    [
        lambda c: 2.5 * np.tanh(3.0 * (c["x"] - 1.0)),
        lambda c: 4.0 * np.exp(-((c["x"] - 2.0) ** 2)),
    ],
    ids=["threshold", "bump"],
)
@pytest.mark.parametrize("seed", range(2))
def test_a_curve_that_the_catalogue_lacks_is_not_explained(adds, seed):
    result = traced(sensor_of(150, seed, adds), response="y", formula="1 + x", time="t_s")
    assert all(effect.doubtful for effect in result.added)
    assert result.verdict in ("partly explained", "unexplained")


@pytest.mark.parametrize(
    ("adds", "name"),
    [
        (lambda c: 0.7 * c["x"] * (c["t_s"] > 4000.0), "sensitivity-step:t_s,x"),
        (lambda c: 0.7 * c["x"] * np.sin(2 * np.pi * c["t_s"] / 900.0), "sensitivity-oscillation:t_s,x"),
        (lambda c: 0.8 * c["side"] * (c["temp_c"] - 20.0), "direction-by-covariate:sign(side),temp_c"),
        (lambda c: -1.5 * np.clip(c["x"] / 0.4, -1.0, 1.0), "dead-zone:x"),
    ],
    ids=["range switched", "supply swings", "cold friction", "dead zone"],
)
def test_further_physics_has_names(adds, name):
    columns = sensor_of(160, 1, adds, side=side, temp_c=warm)
    result = traced(columns, response="y", formula="1 + x", time="t_s", direction="side")
    assert name in [effect.effect for effect in result.added]


def test_many_levels_of_three_rows_are_found():
    """25 subjects, three readings each, as far apart as one and a half errors: F 7.8 with 24 degrees of freedom."""
    named = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        subject, age = np.repeat(np.arange(25), 3), np.tile([8.0, 11.0, 14.0], 25)
        y = 17.0 + 0.7 * age + 1.5 * rng.standard_normal(25)[subject] + rng.standard_normal(75)
        result = traced({"age": age, "subject": subject, "y": y}, response="y", formula="1 + age", group=("subject",))
        named += [effect.effect for effect in result.added] == ["group-offset:subject"]
    assert named >= 5


def test_three_names_at_once_are_doubtful():
    def adds(c):
        return 1.0 * (c["temp_c"] - 20.0) + 1.5 * c["side"] + 1.5 * np.sin(2 * np.pi * c["t_s"] / 900.0)

    columns = sensor_of(160, 2, adds, side=side, temp_c=warm)
    result = traced(columns, response="y", formula="1 + x", time="t_s", direction="side")
    assert len(result.added) >= 3
    assert all("one unlisted cause" in str(effect.doubtful) for effect in result.added)


def test_what_repeats_itself_and_is_no_sine_is_not_explained_by_one():
    """A square wave over the setting, of which a sine holds 81 %."""
    columns = sensor_of(200, 7, lambda c: 1.1 * np.sign(np.sin(2 * np.pi * c["x"] / 2.3)))
    result = traced(columns, response="y", formula="1 + x", time="t_s")
    first = result.added[0]
    assert first.effect == "periodic:x"
    assert "a third of the period found" in str(first.doubtful)


def test_a_name_that_is_earned_has_no_doubt():
    """A name that the data earn has no doubt and leaves nothing."""
    columns = sensor_of(160, 4, lambda c: 1.2 * np.sin(2 * np.pi * c["t_s"] / 900.0))
    result = traced(columns, response="y", formula="1 + x", time="t_s")
    (effect,) = result.added
    assert (effect.effect, effect.doubtful) == ("oscillation:t_s", None)
    assert result.unnamed == ()
    assert result.verdict == "explained"


@pytest.mark.parametrize("seed", range(3))
def test_an_oscillation_that_has_not_come_back_twice_is_doubtful(seed):
    def slow(c):
        return 4.0 * np.sin(2.0 * np.pi * 1.6 * (c["t_s"] - c["t_s"][0]) / np.ptp(c["t_s"]))

    result = traced(sensor_of(150, seed, slow), response="y", formula="1 + x", time="t_s")
    waves = [effect for effect in result.added if effect.effect.startswith("oscillation")]
    assert waves or any("along" in rest.cause or "t_s" in rest.cause for rest in result.unnamed)
    assert all(effect.doubtful for effect in waves)


@pytest.mark.parametrize("seed", range(2))
def test_two_effects_of_one_column_are_doubtful_if_one_has_a_searched_constant(seed):
    """A logger that truncates toward zero is no dead zone, and no period, but looks like both."""

    def truncated(c):
        y = 3.0 + 2.0 * c["x"]
        return 4.0 * (np.trunc(y / 2.0) - y / 2.0)

    result = traced(sensor_of(160, seed, truncated), response="y", formula="1 + x", time="t_s")
    over_x = [effect for effect in result.added if effect.effect.endswith(":x")]
    assert over_x
    assert all(effect.doubtful for effect in over_x)


def test_a_direction_that_agrees_with_a_setting_is_used_and_said():
    """As a mere number it was named for the loop that it makes."""

    def adds(c):
        c["direction"] = np.sign(np.diff(c["x"], prepend=0.0))
        return 4.0 * c["direction"] * (1.0 - (c["x"] / 5.0) ** 2)

    table = Table("table.csv", sensor_of(80, 3, adds), simulated=True, provenance={})
    data, notes = roles_of(table, Roles(response="y", formula="1 + x", time="t_s"))
    assert data.scene.direction is not None
    assert "direction" not in data.scene.covariates
    assert "direction is taken for the side" in " ".join(notes)
    assert [effect.effect for effect in trace_general(data).added] == ["hysteresis:sign(direction),x"]
    ignored, _ = roles_of(table, Roles(response="y", formula="1 + x", time="t_s", ignore=("direction",)))
    assert ignored.scene.direction is None


def test_a_column_that_disagrees_with_every_setting_is_no_direction():
    data, _ = roles_of(
        Table("table.csv", sensor_of(80, 3, lambda _c: 0.0, side=side), simulated=True, provenance={}),
        Roles(response="y", formula="1 + x", time="t_s"),
    )
    assert data.scene.direction is None
    assert "side" in data.scene.covariates


def test_what_begins_anew_with_each_operator_is_said():
    """A saw tooth in the time since the operator changed was an oscillation in time, or noise."""
    stays = np.repeat([0, 1, 0, 1, 0], [30, 17, 25, 34, 14])
    columns = sensor_of(120, 5, lambda c: 4.0 * np.exp(-_since(stays, c["t_s"]) / 900.0))
    text = {"operator": np.where(stays == 1, "Ann", "Bo")}
    table = Table("table.csv", columns, simulated=True, provenance={}, text=text)
    result = trace_general(roles_of(table, Roles(response="y", formula="1 + x", time="t_s"))[0])
    assert any("since operator changed" in rest.cause for rest in result.unnamed)
    assert all(effect.doubtful for effect in result.added)


def _since(level, t):
    first = np.flatnonzero(np.diff(level, prepend=-1) != 0)
    return t - t[first][np.searchsorted(first, np.arange(len(t)), side="right") - 1]


def test_three_kinks_may_have_any_shape():
    """One value of a table mistyped: a bump of two straight lines."""
    columns = sensor_of(120, 1, lambda c: 8.0 * np.clip(1.0 - np.abs(c["x"] - 1.0) / 1.2, 0.0, None))
    (kinks,) = traced(columns, response="y", formula="1 + x", time="t_s").added
    assert (kinks.effect, len(kinks.coefficients)) == ("kink:x", 3)
    assert "with 3 values" in kinks.doubtful


def test_what_is_set_anew_at_each_change_of_operator_is_said():
    """Whoever sits down presses the zero key, and its error is drawn again: it was a finding about the noise only."""
    rng = np.random.default_rng(31)
    turn, zero = np.arange(140) // 7, 1.5 * rng.standard_normal(20)
    for k in range(3):
        zero[k::3] -= zero[k::3].mean()  # nobody is better than the others
    columns = sensor_of(140, 31, lambda _c: zero[turn])
    text = {"operator": np.array(["Ada", "Ben", "Cleo"])[turn % 3]}
    table = Table("table.csv", columns, simulated=True, provenance={}, text=text)
    result = trace_general(roles_of(table, Roles(response="y", formula="1 + x", time="t_s"))[0])
    assert not result.added
    (rest,) = [rest for rest in result.unnamed if rest.stratum != "noise"]
    assert rest.cause.startswith("with an offset of its own from each change of operator to the next")
    assert rest.shape.over.variable == "t_s"
