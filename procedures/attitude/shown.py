"""Display of attitude calibrations on the command line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.markup import escape

from rig.procedures.attitude.parameters import LABELS, NO_DIRECTION, shown
from rig.procedures.attitude.words import misfit_in_words
from rig.procedures.evaluate.fit_in_short import sensors_in_short
from rig.procedures.present.blocks import Block, Grid, Line
from rig.procedures.present.gross_shown import show_gross, show_left_out
from rig.procedures.present.numbers import with_interval
from rig.procedures.present.words import TESTS, significant


def show_attitude_fit(result: Mapping[str, Any]) -> Iterator[Block]:
    """A table of parameters per sensor, and its analysis of variance."""
    yield from show_left_out(result["data"])
    for name, sensor in result["sensors"].items():
        yield from _show_sensor(name, sensor)
        if name in result["kept"]:
            kept = result["kept"][name]
            yield from _show_parameters_of(
                f"{name}, kept with {', '.join(kept['effects']) or 'no effect'}", kept["parameters"]
            )
            yield Line(f"  {kept['at_degC_sentence']}")
            yield from (Line(f"  [yellow]{escape(sentence)}[/]") for sentence in kept["depends_on"])
            lacks = kept["lack_of_fit"]
            widened = "; the intervals above hold that too" if lacks["model_error"] else ""
            style = "yellow" if widened or lacks["T_bias"] is None else "none"
            yield Line(f"  [{style}]{escape(lacks['sentence'] + widened)}[/]")
            yield Line()
    lacking = [name for name in result["sensors"] if _lacks(result, name)]
    if any(name not in result["kept"] for name in lacking):
        yield Line("some tests are significant: the model lacks something; see rig trace")
    elif lacking:
        yield Line(f"{', '.join(lacking)}: something is still lacking with the effects that are kept; see rig trace")


def show_attitude_fit_in_short(result: Mapping[str, Any]) -> Iterator[Block]:
    """A row a sensor: its error, and which tests are significant."""
    yield from show_left_out(result["data"])
    words = {"T_bias": "lack of fit", "T_b": "offset drift", "T_S": "sensitivity drift", "T_drift": "drift"}
    cells = {}
    for name, sensor in result["sensors"].items():
        found = [what for test, what in words.items() if sensor[test] is not None and significant(sensor, test)]
        cells[name] = (sensor["model"], degrees(sensor["sigma_E_deg"]), ", ".join(found) or "nothing")
    yield from sensors_in_short(result["sensors"], ("model", "sigma_E", "significant"), cells)
    if any(_lacks(result, name) for name in result["sensors"]):
        yield Line("some tests are significant: the model lacks something; see rig trace")


def _lacks(result: Mapping[str, Any], name: str) -> bool:
    """Whether a sensor has a significant test that the kept effects do not explain."""
    kept, sensor = result["kept"].get(name), result["sensors"][name]
    if kept is None:
        return any(significant(sensor, test) for test in TESTS)
    return kept["lack_of_fit"]["model_error"] is not None or kept["lack_of_fit"]["drifts"]


def _show_sensor(name: str, sensor: Mapping[str, Any]) -> Iterator[Block]:
    yield from _show_parameters_of(f"{name}, {sensor['model']}", sensor["parameters"])
    style = "yellow" if "OUTSIDE" in sensor["at_degC_sentence"] else "none"
    yield Line(f"  [{style}]{sensor['at_degC_sentence']}[/]")
    yield from show_gross(sensor["gross_errors"])
    drift = "replications drift: " if sensor["errors_from"] == "replications" else ""
    yield Line(f"  {drift}{sensor['intervals_cover']}")
    if sensor["model_error"] is not None:
        yield Line(f"  [yellow]{escape(misfit_in_words(sensor))}[/]")
    yield Line(
        f"  sigma_E {degrees(sensor['sigma_E_deg'])} = bias {degrees(sensor['sigma_bias_deg'])} and "
        f"precision {degrees(sensor['sigma_prec_deg'])}",
        wrapped=True,
    )
    for test, what in (
        ("T_bias", "lack of fit"),
        ("T_b", "offset drift"),
        ("T_S", "sensitivity drift"),
        ("T_drift", "drift of any kind"),
    ):
        value, bound = sensor[test], sensor[TESTS[test]]
        if value is None:
            yield Line(f"  {test:<8} cannot be tested with these data: {what}", wrapped=True)
            continue
        verdict = "[yellow]significant[/]" if significant(sensor, test) else "not significant"
        yield Line(f"  {test:<8} {value:9.3g}  (95 % limit {bound:.3g})  {what}: {verdict}", wrapped=True)
    if sensor["T_bias_blind"] is not None:
        yield Line(f"  [yellow]{escape(sensor['T_bias_blind'])}[/]")
    yield Line()


def _show_parameters_of(heading: str, parameters: Mapping[str, Any]) -> Iterator[Block]:
    table = Grid(("parameter", "estimate", "standard error", "95 % interval"), title=heading)
    for parameter in (rows := shown(parameters)):
        table.add_row(LABELS[parameter], *with_interval(parameters[parameter]))
    yield table
    if "mx_V" in rows:
        yield Line(f"  {NO_DIRECTION}")


def degrees(value: float | None) -> str:
    """A standard error in degrees, as printed in the paper."""
    return "unknown" if value is None else f"{value * 1e4:.3g}e-4 deg"
