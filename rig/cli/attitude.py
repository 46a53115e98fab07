"""How the command line shows attitude calibrations and their traces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich.markup import escape
from rich.table import Table as RichTable

from fitter.trace.outcome import Outcome
from procedures.attitude.evaluate import AttitudeTraced
from procedures.attitude.parameters import LABELS, NO_DIRECTION, shown
from procedures.attitude.words import little_help, misfit_in_words
from procedures.words import TESTS, significant, unnamed, verdict_of
from rig.cli.effects import paragraph, show_certificate, show_effect
from rig.cli.gross import show_gross, show_left_out
from rig.cli.show import headline, number, out
from rig.present.parameters import with_error, with_interval


def show_attitude_fit(result: Mapping[str, Any]) -> None:
    """A table of parameters a sensor, and its analysis of variance."""
    show_left_out(result["data"])
    for name, sensor in result["sensors"].items():
        _show_sensor(name, sensor)
        if name in result["kept"]:
            kept = result["kept"][name]
            _show_parameters_of(f"{name}, kept with {', '.join(kept['effects']) or 'no effect'}", kept["parameters"])
            out.print(f"  {kept['at_degC_sentence']}", soft_wrap=True)
            _say(kept["depends_on"])
            lacks = kept["lack_of_fit"]
            widened = "; the intervals above hold that too" if lacks["model_error"] else ""
            style = "yellow" if widened or lacks["T_bias"] is None else "none"
            out.print(f"  [{style}]{escape(lacks['sentence'] + widened)}[/]", soft_wrap=True)
            out.print()
    lacking = [name for name in result["sensors"] if _lacks(result, name)]
    if any(name not in result["kept"] for name in lacking):
        out.print("some tests are significant: the model lacks something; see rig trace", soft_wrap=True)
    elif lacking:
        out.print(
            f"{', '.join(lacking)}: something is still lacking with the effects that are kept; see rig trace",
            soft_wrap=True,
        )


def _lacks(result: Mapping[str, Any], name: str) -> bool:
    """Whether a test of a sensor is significant that the effects kept beside the model do not settle."""
    kept, sensor = result["kept"].get(name), result["sensors"][name]
    if kept is None:
        return any(significant(sensor, test) for test in TESTS)
    return kept["lack_of_fit"]["model_error"] is not None or kept["lack_of_fit"]["drifts"]


def _say(sentences: Iterable[str]) -> None:
    for sentence in sentences:
        out.print(f"  [yellow]{escape(sentence)}[/]", soft_wrap=True)


def _show_sensor(name: str, sensor: Mapping[str, Any]) -> None:
    _show_parameters_of(f"{name}, {sensor['model']}", sensor["parameters"])
    style = "yellow" if "OUTSIDE" in sensor["at_degC_sentence"] else "none"
    out.print(f"  [{style}]{sensor['at_degC_sentence']}[/]", soft_wrap=True)
    show_gross(sensor["gross_errors"])
    drift = "replications drift: " if sensor["errors_from"] == "replications" else ""
    out.print(f"  {drift}{sensor['intervals_cover']}", soft_wrap=True)
    if sensor["model_error"] is not None:
        out.print(f"  [yellow]{escape(misfit_in_words(sensor))}[/]", soft_wrap=True)
    out.print(
        f"  sigma_E {degrees(sensor['sigma_E_deg'])} = bias {degrees(sensor['sigma_bias_deg'])} and "
        f"precision {degrees(sensor['sigma_prec_deg'])}"
    )
    for test, what in (
        ("T_bias", "lack of fit"),
        ("T_b", "offset drift"),
        ("T_S", "sensitivity drift"),
        ("T_drift", "drift of any kind"),
    ):
        value, bound = sensor[test], sensor[TESTS[test]]
        if value is None:
            out.print(f"  {test:<8} cannot be tested with these data: {what}")
            continue
        verdict = "[yellow]significant[/]" if significant(sensor, test) else "not significant"
        out.print(f"  {test:<8} {value:9.3g}  (95 % limit {bound:.3g})  {what}: {verdict}")
    if sensor["T_bias_blind"] is not None:
        out.print(f"  [yellow]{escape(sensor['T_bias_blind'])}[/]", soft_wrap=True)
    out.print()


def _show_parameters_of(heading: str, parameters: Mapping[str, Any]) -> None:
    table = RichTable("parameter", "estimate", "standard error", "95 % interval", title=heading, title_justify="left")
    for parameter in (rows := shown(parameters)):
        table.add_row(LABELS[parameter], *with_interval(parameters[parameter]))
    out.print(table)
    if "mx_V" in rows:
        out.print(f"  {NO_DIRECTION}", soft_wrap=True)


_BEFORE_AFTER = (
    ("sigma_E_deg", "sigma_E / 1e-4 deg", 1e4),
    ("sigma_bias_deg", "sigma_bias / 1e-4 deg", 1e4),
    ("sigma_prec_deg", "sigma_prec / 1e-4 deg", 1e4),
    ("T_bias", "T_bias", 1.0),
    ("T_b", "T_b", 1.0),
    ("T_S", "T_S", 1.0),
    ("cv_rms_deg", "left-out error / 1e-4 deg", 1e4),
)


def show_attitude_trace(traced: AttitudeTraced) -> None:
    """A short table a sensor: error before and after, and the effects found."""
    result, outcomes = traced.to_json(), {one.sensor: one for one in traced.outcomes}
    headline(result["data"]["file"], traced.table)
    for name, sensor in result["sensors"].items():
        out.print(f"\n[bold]{name}[/] ({sensor['declared']}): [bold]{escape(verdict_of(sensor))}[/]")
        table = RichTable("", "before", "after")
        for key, label, scale in _BEFORE_AFTER:
            table.add_row(label, *(_cell(sensor[side], key, scale) for side in ("before", "after")))
        out.print(table)
        if any(significant(sensor[side], test) for side in ("before", "after") for test in _MARKED):
            out.print("  * above its 95 % limit")
        _show_parameters(outcomes[name])
        _say(sensor["depends_on"])
        for effect in sensor["effects"]:
            show_effect(effect)
        for line in (*(one["sentence"] for one in sensor["refused"]), *unnamed(sensor), little_help(sensor)):
            if line:
                paragraph(f"[yellow]{escape(line)}[/]", 2)
        show_certificate(sensor)


_MARKED = ("T_bias", "T_b", "T_S")


def _cell(side: Mapping[str, Any], key: str, scale: float) -> str:
    text = number(None if side[key] is None else side[key] * scale, 3)
    return f"[yellow]{text} *[/]" if key in _MARKED and significant(side, key) else text


def _show_parameters(outcome: Outcome) -> None:
    table = RichTable("parameter", "before", "standard error", "after", "standard error")
    for one in outcome.parameters:
        sides = (one.before or one.after, one.after)
        table.add_row(one.label, *(text for side in sides for text in with_error(side.value, side.stderr)))
    out.print(table)
    out.print(f"  {outcome.more['at_degC_sentence']}", soft_wrap=True)


def degrees(value: float | None) -> str:
    """A standard error in degrees, as the paper prints it."""
    return "unknown" if value is None else f"{value * 1e4:.3g}e-4 deg"
