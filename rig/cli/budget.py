"""`rig budget`: uncertainty budgets of a run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.budget_options import EquipmentOption, SameMeterOption
from rig.cli.commands import app
from rig.cli.kind_options import with_options_of_kinds
from rig.cli.options import JsonOption, RunArgument
from rig.cli.progress import counting
from rig.cli.show import out, print_json, show_notes
from rig.cli.waiting import waiting
from rig.errors import ExitCode
from rig.files.atomic import check_files, check_format
from rig.procedures.present.terminal import show


@app.command()
@with_options_of_kinds(lambda kind: kind.budget_options)
def budget(
    run_file: RunArgument,
    equipment: EquipmentOption = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="a point at which outputs and inferred quantities are given: force_kN=2.5; repeatable",
            show_default="a few points of the run",
        ),
    ] = None,
    same_meter: SameMeterOption = False,
    probability: Annotated[
        float, typer.Option(min=0.5, max=0.9999, help="coverage probability of expanded uncertainties")
    ] = 0.95,
    shapes: Annotated[
        bool,
        typer.Option(
            "--shapes",
            help="take all coverage factors from the shapes of the distributions; default: only for results that one "
            "or two limits of error dominate, at 95 %, as on a certificate",
        ),
    ] = False,
    after_days: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="inferred values this many days after the run, with the drift of the sensors from the register (rig "
            "chart --as-drift)",
            show_default=False,
        ),
    ] = None,
    monte_carlo: Annotated[
        int | None,
        typer.Option(
            min=100,
            help="check the budgets by this number of simulated evaluations, with random errors of all influences",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the simulation; the same seed gives the same numbers")] = 1,
    confirmed_by: Annotated[
        list[Path] | None,
        typer.Option(
            "--confirmed-by",
            help="a further run (rig confirm): effects that it settled are in the model; repeatable",
            show_default=False,
        ),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="the budget of each result, too")] = False,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    as_json: JsonOption = False,
    *,
    given: dict[str, Any],
) -> int:
    """Uncertainty budgets of the results of a run, by its register of equipment.

    Every result has its expanded uncertainty and its largest influence; with --full its effective degrees of freedom
    and the shares of all influences. An influence is what the register states about an instrument, carried through the
    whole evaluation of the run. The run is traced: effects that the declared model lacks are a line of the budget of
    each result that they move.
    `--monte-carlo` compares the intervals with simulated ones (JCGM 101), and names those that differ.

    Examples:

    - `rig budget RUN --equipment equipment.toml`
    - `rig budget RUN --equipment equipment.toml --at force_kN=2.5`
    - `rig budget RUN --equipment equipment.toml --monte-carlo 200000 --report budget.html`
    """
    from rig.procedures.evaluate.points import points  # noqa: PLC0415
    from rig.verbs.budget.in_short import in_short  # noqa: PLC0415
    from rig.verbs.budget.result import budget as budget_run  # noqa: PLC0415
    from rig.verbs.budget.result import not_in  # noqa: PLC0415

    check_files([report], [run_file, *(confirmed_by or ()), *filter(None, (equipment,))])
    check_format(report, ".html", ".htm")
    asked: dict[str, Any] = {"equipment": equipment, "same_meter": same_meter, "probability": probability, **given}
    asked |= {"after_days": after_days, "confirmed_by": confirmed_by or ()}
    with counting("simulated evaluations", monte_carlo) if monte_carlo is not None else waiting("budget") as one_more:
        each = None if one_more is None else partial(one_more, "")
        found = budget_run(
            run_file, at=points(at or []), trials=monte_carlo, seed=seed, each=each, shapes=shapes, **asked
        )
    if report is not None:
        found.report(report)
    if as_json:
        print_json(found.to_json())
    else:
        show(found.blocks() if full else in_short(found), out)
        if not full:
            out.print("\neach result with its budget: --full; with pictures: --report FILE.html")
    show_notes(found, () if as_json else not_in(found))
    return ExitCode.DONE
