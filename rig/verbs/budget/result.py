"""`rig budget`: uncertainty budgets of a run's results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.errors import UsageError
from rig.fitter.rounding import rounded_df, with_error
from rig.options_of_kinds import options_of
from rig.procedures.present.blocks import Block, Grid, Line, headline
from rig.procedures.present.joined import once
from rig.procedures.present.terms import in_words
from rig.units.si import per_term
from rig.verbs.budget.coverage import headed
from rig.verbs.budget.evaluation import RunBudget, budget_of, run_with_register, shapes_at
from rig.verbs.budget.found import NOT_TRACED, SIMULATED, traced_budget
from rig.verbs.budget.lacking import by_sensor
from rig.verbs.frames import Frame, of_rows
from rig.verbs.result import Plots, Result

if TYPE_CHECKING:
    from rig.fitter.budget import Budgeted, Check

_AGREES = {True: "yes", False: "no", None: "not decided"}
SMALL = 1e-3
"""Share of the variance below which an influence is not printed; JSON has all."""


class Budget(Result):
    """Uncertainty budgets of a run.

    Attributes:
        found: the budgets, and what they are made of.
    """

    def __init__(self, found: RunBudget) -> None:
        self.found = found

    @property
    def _told(self) -> dict[str, Any]:
        table, register = self.found.of.table, self.found.of.register
        return {
            "data": {"kind": self.found.of.kind.name, "simulated": table.simulated, **table.provenance},
            "register": {"name": register.name, "example": register.example},
            "results": list(self._results()),
            "notes": list(self.notes()),
        }

    def _results(self) -> Iterator[dict[str, Any]]:
        checks: Sequence[Check | None] = self.found.checks or [None] * len(self.found.budgets)
        for one, sensor, check in zip(self.found.budgets, self.found.sensors, checks, strict=True):
            yield {**_json(one, sensor), **({} if check is None else {"simulated": _simulated(check)})}

    def blocks(self, *, each: bool = True) -> Iterable[Block]:
        """A table of results, and a budget of `each`."""
        yield headline(Path(self.found.of.table.source).name, self.found.of.table)
        grid = Grid(("result", "value", "expanded uncertainty", "k", "largest influence"), frame="plain", apart=2)
        for one in self.found.budgets:
            first = one.contributions[0]
            value, expanded = with_error(one.value, one.expanded_uncertainty)
            words = f"{first.name}, {100 * first.share:.0f} %"
            name = escape(in_words(one.name))
            grid.add_row(name, f"{value} {per_term(one.unit)}", expanded, f"{one.coverage_factor:.2f}", escape(words))
        for sentence in not_in(self):
            yield Line(f"[bold]not in the uncertainties:[/] {escape(sentence)}")
        yield Line(headed(self.found.budgets))
        yield grid
        yield from _checks(self.found)
        for one in self.found.budgets if each else ():
            yield from _budget(one)

    def notes(self) -> Sequence[str]:
        """Sentences about influences that are in the budgets, and about those that are not."""
        return (*once(self.found.notes, self.found.of.table.outputs), *self.found.evaluation.hints())

    def frame(self) -> Frame:
        """One row per result and influence."""
        text = ("result", "unit", "influence", "source", "kind")
        return of_rows(self._rows(), text, ("standard_uncertainty", "df", "share"), {})

    def _rows(self) -> Iterator[dict[str, Any]]:
        for one in self.found.budgets:
            for line in one.contributions:
                yield {**vars(line), "influence": line.name, "result": one.name, "unit": one.unit}

    def plot(self) -> Plots:
        """A bar chart of the shares of each result."""
        from rig.verbs.budget.page import shares  # noqa: PLC0415 - matplotlib takes a second to import

        return Plots(shares(one) for one in self.found.budgets)

    def report(self, path: Path | str) -> None:
        """Write tables and bar charts of shares as self-contained HTML."""
        from rig.verbs.budget.page import budget_page  # noqa: PLC0415
        from rig.verbs.write_page import write_page  # noqa: PLC0415 - templates are needed for reports alone

        write_page(Path(path), budget_page(self.found, tuple(self.notes())))

    def __repr__(self) -> str:
        return f"<rig.Budget of {self.found.of.table.source}: {len(self.found.budgets)} results>"


def not_in(made: Budget) -> Sequence[str]:
    """Notes about what is not in the uncertainties, which `blocks` has at its head."""
    return made.found.of.stated.what_is_lacking(made.found.unstated)


def _budget(one: Budgeted) -> Iterator[Block]:
    _, u = with_error(one.value, one.standard_uncertainty)
    unit = per_term(one.unit)
    grid = Grid(("share", "standard uncertainty", "df", "type", "influence", "traced to"), frame="plain", apart=2)
    left = 0
    for line in sorted(one.contributions, key=lambda c: -abs(c.share)):
        if abs(line.share) < SMALL:
            left += 1
            continue
        bar = "#" * round(10 * max(line.share, 0.0))
        cells = (
            f"{100 * line.share:5.1f} % {bar}",
            f"{line.standard_uncertainty:.2g} {unit}",
            rounded_df(line.df),
            line.kind,
        )
        grid.add_row(*cells, escape(line.name), escape(line.source))
    df = f"effective degrees of freedom {rounded_df(one.df)}"
    yield Line(f"\n[bold]{escape(in_words(one.name))}[/]: standard uncertainty {u} {unit}, {df}")
    yield grid
    if left:
        yield Line(f"  and {left} below 0.1 %")


def _checks(found: RunBudget) -> Iterator[Block]:
    """Intervals of the budgets beside simulated ones."""
    if not found.checks:
        return
    grid = Grid(("result", "budget", "simulated", "agrees"), frame="plain", apart=2)
    for one, check in zip(found.budgets, found.checks, strict=True):
        low, high = one.value - one.expanded_uncertainty, one.value + one.expanded_uncertainty
        drawn = check.simulated.symmetric
        texts = [with_error(end, one.expanded_uncertainty)[0] for end in (low, high, drawn.lower, drawn.upper)]
        budget, simulated = (f"{a} to {b} {one.unit}" for a, b in (texts[:2], texts[2:]))
        grid.add_row(escape(one.name), budget, simulated, _AGREES[check.agrees])
    yield Line("\nintervals of the budgets, and by simulation of the whole evaluation")
    yield grid


def _simulated(check: Check) -> dict[str, Any]:
    one = check.simulated
    return {
        "trials": one.trials,
        "mean": one.mean,
        "standard_deviation": one.standard_deviation,
        "interval": [one.symmetric.lower, one.symmetric.upper],
        "shortest_interval": [one.shortest.lower, one.shortest.upper],
        "error": one.error,
        "tolerance": check.tolerance,
        "agrees": check.agrees,
    }


def _json(one: Budgeted, sensor: str) -> dict[str, Any]:
    lines = [dict(vars(line)) for line in sorted(one.contributions, key=lambda c: -abs(c.share))]
    return {**vars(one), "sensor": sensor, "contributions": lines}


def budget(
    run: str | Path,
    *,
    equipment: str | Path | None = None,
    at: Sequence[Mapping[str, float]] = (),
    same_meter: bool = False,
    probability: float = 0.95,
    trials: int | None = None,
    seed: int = 1,
    each: Callable[[], None] | None = None,
    shapes: bool = False,
    after_days: float | None = None,
    confirmed_by: str | Path | Iterable[str | Path] = (),
    **options: Any,
) -> Budget:
    """Uncertainty budgets of a run's results, by its register of equipment; as a certificate has them.

    The run is traced. Effects that the declared model lacks are a line of the budget of each result that they move;
    with the option `traced` results are of the model with these effects.

    Args:
        run: the run file.
        equipment: another register than the one kept with the run.
        at: points at which outputs and inferred quantities are given, by quantity, such as {"force_kN": 2.5}.
        same_meter: whether the meter of the run reads the sensors in use, with the same errors.
        probability: coverage probability of expanded uncertainties.
        trials: of a simulation that checks the budgets, at least 100 / (1 - probability).
        seed: of the simulation.
        each: called after each trial.
        shapes: whether all coverage factors follow the shapes of the distributions; without it those of results in
            which one or two limits of error dominate, at 95 %, as on a certificate.
        after_days: inferred values are for a use so many days after the run, with the sensors' drift by their history.
        confirmed_by: a later run file, or several; effects that they settled are in the model.
        options: of `rig budget` for this kind of run, with underscores for hyphens.

    Raises:
        UsageError: it is no run file, has no register, or its kind does not have an option.
        ConfigurationError: the register cannot be used for the run.
        DataError: it cannot be evaluated, or a point cannot be used.
        RunFileError: the run file cannot be used.

    Example:
        >>> first = rig.budget("night.sqlite", equipment="register.toml").to_json()["results"][0]
        >>> first["name"], round(first["coverage_factor"], 2)
        ('x_V offset', 1.94)
    """
    if not 0.5 < probability < 1.0:
        raise UsageError(f"--probability {probability:g} is not between 0.5 and 1")
    register = None if equipment is None else Path(equipment)
    of = run_with_register(Path(run), register)
    given = {name: value for name, value in options.items() if value is not None}
    later = [Path(one) for one in ([confirmed_by] if isinstance(confirmed_by, (str, Path)) else confirmed_by)]
    beside = given.keys() - {"ignore"}
    if later and (beside or trials is not None):
        others = [*(f"--{name.replace('_', '-')}" for name in sorted(beside)), *(["--monte-carlo"] if trials else [])]
        raise UsageError(f"--confirmed-by is of the declared model and its confirmed effects: omit {', '.join(others)}")
    options_of(of.kind, given, lambda kind: kind.budget_options, f"{run} is of {of.kind.title}")
    if trials is not None and trials < round(100.0 / (1.0 - probability)):
        least = round(100.0 / (1.0 - probability))
        raise UsageError(f"--monte-carlo {trials}: {100 * probability:g} % need at least {least} trials")
    asked: dict[str, Any] = {
        "at": at,
        "same_meter": same_meter,
        "probability": probability,
        "options": given,
        "shapes": shapes or shapes_at(probability),
        "after_days": after_days,
    }
    if trials is None and not given.get("traced"):
        return Budget(traced_budget(of, asked, later, register))
    made = budget_of(of, **asked, trials=trials, seed=seed, each=each)
    traced = given.get("traced")
    more = by_sensor(made.lacking, of.table.outputs) if traced else [NOT_TRACED.format(why=SIMULATED)]
    return Budget(replace(made, notes=(*more, *made.notes)))
