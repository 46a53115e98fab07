"""`rig infer` of pressure: which zero was used, whether it can be believed, and that nothing is dropped in silence."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from command import rig

from proving.truth.pressure import HOMOSCEDASTIC, simulate
from rig.procedures.pressure.fit import fit_pressure
from rig.procedures.pressure.infer import Zero, departure, infer_pressure
from rig.tables import write_csv

SENSOR, SSE = -70.0, 20.0
WHOLE_PLOT_MV = 0.011
"""Of the flight and of its zero: 0.8 standard deviations of the truth."""


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """Two transducers of one truth, calibrated on the command line."""
    folder = tmp_path_factory.mktemp("calibration")
    one = simulate(HOMOSCEDASTIC, 3)[0]
    noise = np.random.default_rng(16).normal(0, HOMOSCEDASTIC.subplot_mV, len(one.order))
    table = {
        "whole_plot": one.whole_plot,
        "order": one.order,
        "elapsed_s": one.elapsed_s,
        "pressure_psia": one.pressure_psia,
        "sensor_temperature_degC": one.sensor_temperature_degC,
        "sse_temperature_degC": one.sse_temperature_degC,
        "bridge_1_mV": one.outputs["bridge_mV"],
        "bridge_2_mV": one.outputs["bridge_mV"] + noise,
    }
    write_csv(table, folder / "table.csv")
    done = rig("fit", folder / "table.csv", "--out", folder / "calibration.json")
    assert done.returncode == 0, done.stderr
    return folder / "calibration.json"


def mV(psia, off=WHOLE_PLOT_MV):
    return float(HOMOSCEDASTIC.output_mV(psia, SENSOR, SSE)) + off


def text(rows, header="bridge_1_mV"):
    return f"{header},sensor_temperature_degC,sse_temperature_degC\n" + "".join(
        f"{row},{SENSOR},{SSE}\n" for row in rows
    )


class Case:
    """A folder with a flight and a zero, to be inferred from."""

    def __init__(self, folder, calibration):
        self.folder, self.calibration = folder, calibration

    def infer(self, flight, zero=None, *options):
        files = {"flight.csv": flight, "zero.csv": zero}
        for name, content in files.items():
            if content is not None:
                (self.folder / name).write_text(content)
        given = () if zero is None else ("--zero", "zero.csv")
        done = rig("infer", self.calibration, "flight.csv", *given, "--out", "out.csv", *options, cwd=self.folder)
        out = self.folder / "out.csv"
        self.rows = list(csv.DictReader(out.read_text().splitlines())) if done.returncode == 0 else []
        return done


@pytest.fixture
def case(tmp_path, calibration):
    return Case(tmp_path, calibration)


FLIGHT = text([mV(1.0), mV(2.0)])


def test_a_zero_read_at_a_stated_pressure_is_a_zero_at_that_pressure(case):
    done = case.infer(FLIGHT, text([f"0.5,{mV(0.5)}"], "pressure_psia,bridge_1_mV"))
    assert done.returncode == 0, done.stderr
    assert [float(row["pressure_psia"]) for row in case.rows] == pytest.approx([1.0, 2.0], abs=0.006)
    assert [row["flag"] for row in case.rows] == ["", ""]
    assert "read at 0.5 psia (as stated" in done.stderr


def test_the_pressure_of_rows_marked_vacuum_counts_too(case):
    rows = [f"0.3,1,{mV(0.3)}", f",0,{mV(1.0)}"]
    done = case.infer(text(rows, "pressure_psia,vacuum,bridge_1_mV"), None, "--json")
    assert done.returncode == 0, done.stderr
    assert float(case.rows[1]["inferred_pressure_psia"]) == pytest.approx(1.0, abs=0.006)
    (zero,) = json.loads(done.stdout)["zeros"]["bridge_1_mV"]
    assert zero["pressure_from"] == "pressure_psia"
    assert zero["zeros"][0]["pressure_psia"] == 0.3


def test_without_a_stated_pressure_vacuum_is_said_to_be_assumed(case):
    done = case.infer(FLIGHT, text([mV(0.0)]))
    assert "read at 0 psia (assumed" in done.stderr
    assert [row["flag"] for row in case.rows] == ["", ""]


STATED, PLOTS = "pressure_psia,bridge_1_mV", "whole_plot,bridge_1_mV"


@pytest.mark.parametrize(
    ("zero", "options", "message"),
    [
        (text([f"2.5,{mV(2.5)}"], STATED), (), "2.5 psia, which is far from zero"),
        (text([f"-1,{mV(0)}"], STATED), (), "no absolute pressure"),
        (text([f"0,{mV(0)}", f"0.4,{mV(0.4)}"], STATED), ("--zero-rows", "one-sitting"), "varies by"),
        (text([f"3,{mV(0.02)}"], "pressure_hPa,bridge_1_mV"), (), "name it pressure_psia"),
        (text([f"0,{mV(0)}", f",{mV(0)}"], STATED), (), "row 3, column pressure_psia: the value is"),
        (text([f"0,{mV(0)}"], "vacuum,bridge_1_mV"), (), "no row read in vacuum"),
        (text([mV(0.0), mV(0.0)]), (), "--zero-rows one-sitting (one after another"),
        (text([f"1,{mV(0)}", f"2,{mV(0)}"], PLOTS), ("--zero-rows", "one-sitting"), "not of one sitting"),
        (text([f"1,{mV(0)}", f"1,{mV(0)}"], PLOTS), ("--zero-rows", "independent"), "not all independent"),
        (text(["x"]), (), "row 2, column bridge_1_mV: 'x' is not a number"),
    ],
    ids=lambda value: value if isinstance(value, str) and "\n" not in value else "",
)
def test_zeros_that_make_no_sense_are_refused(case, zero, options, message):
    done = case.infer(FLIGHT, zero, *options)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert not (case.folder / "out.csv").exists()


def test_a_zero_far_from_the_calibration_is_flagged_in_every_row(case):
    done = case.infer(FLIGHT, text([mV(0.0, 0.2)]), "--json")
    assert done.returncode == 0
    zero = json.loads(done.stdout)["zeros"]["bridge_1_mV"][0]["zeros"][0]
    assert zero["implausible"] is True
    assert zero["off_mV"] == pytest.approx(0.2, abs=0.03)
    assert zero["wholeplot_sd_mV"] == pytest.approx(HOMOSCEDASTIC.wholeplot_mV, rel=0.5)
    assert zero["deviations"] > 7
    assert all("standard deviations from the calibration" in row["flag"] for row in case.rows)
    assert f"{zero['deviations']:.2g} standard deviations" in done.stderr


def test_honest_zeros_are_as_far_from_the_calibration_as_they_say():
    """Over 20 calibrations and 20 zeros each: the mean square of their standard deviations off is about one."""
    off, believed = [], []
    for seed in range(20):
        found = fit_pressure(simulate(HOMOSCEDASTIC, seed)[0], "bridge_mV", growth=False).calibration()
        rng = np.random.default_rng([16, seed])
        for _ in range(20):
            sensor, sse = rng.uniform(-118, -62), rng.uniform(-28, 28)
            error = rng.normal(0, HOMOSCEDASTIC.wholeplot_mV) + rng.normal(0, HOMOSCEDASTIC.subplot_mV)
            zero = Zero(float(HOMOSCEDASTIC.output_mV(0.0, sensor, sse)) + error, sensor, sse)
            off.append(departure(found, zero).deviations)
            believed.append(not departure(found, zero).implausible)
    assert np.mean(np.square(off)) == pytest.approx(1.15, abs=0.3)  # t with some 12 degrees of freedom
    assert np.mean(believed) > 0.99


def sd_of(found, true):
    errors = replace(found.errors, subplot_variance=true.subplot_mV**2, wholeplot_variance=true.wholeplot_mV**2)
    quiet = replace(found, errors=errors, covariance=0.0 * found.covariance)

    def sd(zero):
        return float(infer_pressure(quiet, mV(1.0), SENSOR, SSE, zero).sd_psia[0]) * 2.0

    return sd


def test_several_zeros_cost_what_their_meaning_says():
    """Standard deviations by hand, for 2 mV/psi and exact coefficients."""
    true = HOMOSCEDASTIC
    sd = sd_of(fit_pressure(simulate(true, 3)[0], "bridge_mV", growth=False).calibration(), true)
    s, w, v = true.subplot_mV, true.wholeplot_mV, mV(0.0)
    one = Zero(v, SENSOR, SSE)
    five = replace(one, readings=5)
    cases = [
        (one, 2 * s**2),
        (replace(five, scatter_mV=0.0), 2 * s**2),  # they agree: all of the error is the setting's, which they share
        (replace(five, scatter_mV=s), s**2 + s**2 / 5),  # they scatter as settings do: it averages
        (replace(five, scatter_mV=2 * s), s**2 + 4 * s**2 / 5),
        ([one] * 5, s**2 + w**2 + (s**2 + w**2) / 5),
        (replace(one, pressure_sd_psia=0.01), 2 * s**2 + 0.02**2),
    ]
    for zero, variance in cases:
        assert sd(zero) == pytest.approx(variance**0.5, rel=0.02)


def test_several_zero_rows_are_what_the_option_or_the_whole_plots_say(case):
    rows = [mV(0.0) + d for d in (-0.004, 0.0, 0.004)]
    widths = {}
    for name, zero, options in (
        ("sitting", text(rows), ("--zero-rows", "one-sitting")),
        ("independent", text(rows), ("--zero-rows", "independent")),
        ("one whole plot", text([f"7,{v}" for v in rows], "whole_plot,bridge_1_mV"), ()),
        ("three whole plots", text([f"{i},{v}" for i, v in enumerate(rows)], "whole_plot,bridge_1_mV"), ()),
    ):
        done = case.infer(FLIGHT, zero, *options)
        assert done.returncode == 0, done.stderr
        widths[name] = float(case.rows[0]["pressure_psia_sd"])
        assert ("one sitting" in done.stderr) == (name in ("sitting", "one whole plot"))
    assert widths["sitting"] == widths["one whole plot"]
    assert widths["independent"] == widths["three whole plots"]
    assert widths["independent"] > 2 * widths["sitting"]


def test_each_whole_plot_of_the_data_has_its_own_zero(case):
    rows = [f"{plot},{int(psia == 0)},{mV(psia, off)}" for plot, off in ((1, -0.02), (2, 0.02)) for psia in (0.0, 1.0)]
    done = case.infer(text([*rows, f"3,0,{mV(1.0)}"], "whole_plot,vacuum,bridge_1_mV"))
    assert done.returncode == 0, done.stderr
    assert [float(case.rows[i]["pressure_psia"]) for i in (1, 3)] == pytest.approx([1.0, 1.0], abs=0.006)
    assert "bridge_1_mV (1 rows): no zero was read in vacuum" in done.stderr


def test_a_blank_reading_empties_its_row_and_no_other(case):
    rows = [f"{mV(1.0)},{mV(1.0)},a", f",{mV(2.0)},", f"{mV(3.0)},{mV(3.0)},c"]
    done = case.infer(text(rows, "bridge_1_mV,bridge_2_mV,comment"), None, "--json")
    assert done.returncode == 0, done.stderr
    one = [row["bridge_1_pressure_psia"] for row in case.rows]
    assert one[1] == ""
    assert [float(one[0]), float(one[2])] == pytest.approx([1.0, 3.0], abs=0.03)
    assert [row["bridge_1_pressure_psia_flag"] for row in case.rows] == ["", "no value of bridge_1_mV", ""]
    assert [row["bridge_2_pressure_psia_flag"] for row in case.rows] == ["", "", ""]
    assert [row["comment"] for row in case.rows] == ["a", "", "c"]
    unused = json.loads(done.stdout)["unused"]
    assert unused["rows"] == [{"row": 3, "column": "bridge_1_mV", "why": "no value: the result of the row is empty"}]
    assert unused["columns"] == [{"column": "comment", "why": "plays no part"}]
    assert "row 3, column bridge_1_mV: no value" in done.stderr
    assert "not used: comment" in done.stderr


def test_an_output_in_another_unit_is_named_with_what_to_do(case):
    done = case.infer(text([f"{mV(1.0) / 1000},{mV(1.0)}"], "bridge_1_V,bridge_2_mV"), None, "--json")
    assert done.returncode == 0, done.stderr
    (column,) = json.loads(done.stdout)["unused"]["columns"]
    assert column["column"] == "bridge_1_V"
    assert column["why"].startswith("calibrated as bridge_1_mV: rename it, and convert")
    assert "bridge_1_V is not used: calibrated as bridge_1_mV" in done.stderr
    assert "bridge_1_mV is calibrated, but flight.csv has no such column" in done.stderr
    done = case.infer(text([mV(1.0) / 1000], "bridge_1_V"))
    assert done.returncode == 2
    assert "bridge_1_V: calibrated as bridge_1_mV" in " ".join(done.stderr.split())


def test_zero_rows_without_zeros_is_refused(case):
    done = case.infer(FLIGHT, None, "--zero-rows", "one-sitting")
    assert done.returncode == 2
    assert "and there are none" in " ".join(done.stderr.split())


def test_text_in_a_reading_is_an_error_with_its_place(case):
    done = case.infer(text([mV(1.0), "broken"]))
    assert done.returncode == 2
    assert "flight.csv, row 3, column bridge_1_mV: 'broken' is not a number" in done.stderr


def test_a_blank_pressure_of_a_zero_is_refused_not_taken_for_a_column_that_is_not_there(case):
    """Somebody meant to say at which pressure the zero was read: 0 psia is no answer to that."""
    for rows, blank in (([f",{mV(0.5)}"], 2), ([f",{mV(0.5)}", f"0.5,{mV(0.5)}"], 2)):
        done = case.infer(FLIGHT, text(rows, "pressure_psia,bridge_1_mV"), "--zero-rows", "one-sitting")
        assert done.returncode == 2
        assert f"row {blank}, column pressure_psia: the value is missing; fill it in" in " ".join(done.stderr.split())
        assert not (case.folder / "out.csv").exists()
    done = case.infer(FLIGHT, text([f"0.5,,{mV(0.5)}"], "pressure_psia,pressure_sd_psia,bridge_1_mV"))
    assert done.returncode == 2
    assert "row 2, column pressure_sd_psia: the value is missing" in " ".join(done.stderr.split())


@pytest.mark.parametrize("cubic_mV", [0.0, 0.004])
def test_lack_of_fit_within_whole_plots_is_said_in_fit_calibration_and_answer(case, cubic_mV):
    """Pressures that repeat within whole plots tell: F of the model against a mean for each setting."""
    rng = np.random.default_rng(11)
    pressures = np.tile([0.2, 1.0, 2.0, 3.0, 4.0, 5.0], 2)
    pairs = [(s, e) for s in (-110.0, -90.0, -70.0) for e in (-20.0, 20.0)]
    plot = np.repeat(np.arange(6), 12)
    p, sensor, sse = np.tile(pressures, 6), *np.repeat(np.array(pairs), 12, axis=0).T
    y = 0.3 + 2 * p + 0.01 * sensor + 0.002 * sse + cubic_mV * (p - 1) * (p - 3) * (p - 5)
    y = y + rng.normal(0, 0.01, 6)[plot] + rng.normal(0, 0.005, 72)
    names = ["whole_plot", "order", "elapsed_s", "pressure_psia"]
    names += ["sensor_temperature_degC", "sse_temperature_degC", "bridge_1_mV"]
    table = dict(zip(names, (plot + 1, np.arange(72), 240.0 * np.arange(72), p, sensor, sse, y), strict=True))
    write_csv(table, case.folder / "table.csv")
    formula = ("--formula", "1 + P + T_sensor + T_SSE")
    done = rig("fit", "table.csv", *formula, "--out", "c.json", cwd=case.folder)
    assert done.returncode == 0, done.stderr
    kept = json.loads((case.folder / "c.json").read_text())["sensors"]["bridge_1_mV"]
    found = kept["lack_of_fit"]

    def rss(columns):
        return np.sum((y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2)

    cells = np.eye(36)[plot * 6 + np.tile(np.arange(6), 12)]
    model, pure = rss(np.column_stack([np.eye(6)[plot], p])), rss(cells)
    assert (found["df_above"], found["df_below"]) == (72 - 7 - 36, 36)
    assert kept["errors"]["growth_per_psia"] == 0.0
    assert found["F"] == pytest.approx((model - pure) / 29 / (pure / 36), rel=1e-6)
    case.calibration = "c.json"
    said = case.infer(FLIGHT)
    for words in (done.stdout, said.stderr, " ".join(kept["notes"]), " ".join(kept["calibration"]["notes"])):
        assert ("lack of fit is significant" in " ".join(words.split())) == found["significant"] == (cubic_mV > 0)
