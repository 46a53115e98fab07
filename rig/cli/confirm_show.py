"""What `rig confirm` shows: open questions, possible runs, verdicts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from rig.cli.show import err, mark, out, print_json
from rig.errors import ExitCode
from rig.procedures.present.durations import duration
from rig.procedures.present.joined import MOST, some
from rig.procedures.present.terminal import print_whole

if TYPE_CHECKING:
    from rig.fitter.confirm import Confirmation
    from rig.verbs.confirm.answers import Confirmed
    from rig.verbs.confirm.first import First
    from rig.verbs.confirm.proposal import Proposal
    from rig.verbs.confirm.proposals import Inseparable

SHOWN = 5
"""Number of proposals shown by default."""


def listed(first: First, proposals: Sequence[Proposal], never: Sequence[Inseparable]) -> dict[str, Any]:
    """Values for `--json`."""
    return {
        "first": str(first.path),
        "proposals": [p.to_json() for p in proposals],
        "inseparable": [one.to_json() for one in never],
    }


def show_open(first: First, never: Sequence[Inseparable]) -> None:
    """Open questions, and those that no run can answer."""
    from rig.verbs.confirm.proposals import planned  # noqa: PLC0415

    plans = planned(first).questions
    for question in first.questions:
        alike = [m.effect for m in question.members[1:] if not m.near]
        near = some([f"{m.effect} ({m.sigmas:.1f} standard errors)" for m in question.members if m.near])
        told = [f"these data do not distinguish it from {some(alike)}"] if alike else []
        told += [f"less clearly excluded, and so judged again by the further run: {near}"] if near else []
        told += ["no run is planned for so many; the further run judges them all the same"] * (question not in plans)
        told += [shared.removeprefix(f"{question.effect} ")] if (shared := first.shared(question.effect)) else []
        text = "; ".join(told) or "these data exclude every other cause of the catalogue"
        out.print(f"[bold]{escape(question.effect)}[/]: {escape(text)}", soft_wrap=True)
    for line in _inseparable(never):
        out.print(f"  [yellow]{escape(line)}[/]", soft_wrap=True)


def _inseparable(never: Sequence[Inseparable]) -> Iterator[str]:
    """Pairs of explanations that no run separates: each, or of many explanations of one effect all in one line."""
    of: dict[str, list[Inseparable]] = {}
    for one in never:
        of.setdefault(one.effect, []).append(one)
    for effect, pairs in of.items():
        for one in pairs if len(pairs) <= MOST else ():
            yield f"{' or '.join(one.pair)}: {_no_run(one.sigmas, one.by_hand, one.would)}"
        if len(pairs) > MOST:
            names = {name for one in pairs for name in one.pair}
            by_hand = dict.fromkeys(words for one in pairs for words in one.by_hand)
            would = dict.fromkeys(words for one in pairs for words in one.would.split("; "))
            most = max(one.sigmas for one in pairs)
            yield (
                f"{effect}: {len(pairs)} pairs of {len(names)} explanations: "
                f"{_no_run(most, [*by_hand], '; '.join([*would][:SHOWN]))}"
            )


def _no_run(sigmas: float, by_hand: Sequence[str], would: str) -> str:
    does = (
        f"a run with a change by a person does: {'; or '.join(by_hand)}"
        if by_hand
        else f"a person would have to change something: {would}"
    )
    return f"no run of this bench separates them (at most {sigmas:.1f} standard errors expected) as it stands; {does}"


def show_proposals(
    first: First, proposals: Sequence[Proposal], never: Sequence[Inseparable], take: int, *, every: bool
) -> None:
    """Possible runs, the best first, and what the taken one may leave open."""
    from rig.verbs.confirm.proposal import SURE  # noqa: PLC0415
    from rig.verbs.confirm.proposals import otherwise  # noqa: PLC0415

    shown = proposals if every else proposals[: max(take, SHOWN)]
    width, no_better = len(str(len(shown))), []
    for number, proposal in enumerate(shown, start=1):
        if number != take and any(_no_better(proposal, other) for other in shown[: number - 1]):
            no_better.append(str(number))
            continue
        colour = "[green]" if number == take else "[default]"
        out.print(f"{colour}{number:>{width}}  {escape(proposal.variation.what)}[/]", soft_wrap=True)
        separated, pairs = proposal.separated
        told = [f"{proposal.size}, {duration(proposal.hours * 3600.0)}"]
        told += [f"{separated} of {pairs} pairs separated"] if pairs > 1 else []
        word = "nearest pair" if pairs > 1 else "pair"
        told += [] if proposal.nearest is None else [f"{word} {_weakest(*proposal.nearest)}"]
        told += [f"weakest cause {_weakest(*proposal.shown)}"]
        out.print(f"{' ' * width}  {'; '.join(told)}", soft_wrap=True)
    out.print(
        f"  time: of the bench; separated: with a probability of {SURE:.0%} or more; pair of causes, and weakest cause "
        "against none: expected standard errors, and the probability that they are enough",
        soft_wrap=True,
    )
    if no_better:
        out.print(f"  {', '.join(no_better)}: no figure is better, and no time shorter, than that of a run above")
    if len(proposals) > len(shown):
        out.print(f"  and {len(proposals) - len(shown)} more: --list shows them")
    lines = [*otherwise(first, proposals[take - 1], never)]
    for line in lines if len(lines) <= MOST + 1 else [*lines[:MOST], f"and {len(lines) - MOST} more pairs: --json"]:
        out.print(f"  [yellow]run {take}: {escape(line)}[/]", soft_wrap=True)


def _no_better(one: Proposal, other: Proposal) -> bool:
    """Whether a run takes as long as another, or longer, and separates nothing better."""
    if (one.nearest is None) != (other.nearest is None) or one.separated[0] > other.separated[0]:
        return False
    pairs = [(one.shown, other.shown), *([(one.nearest, other.nearest)] if one.nearest and other.nearest else [])]
    return one.hours >= other.hours and all(mine[1] <= theirs[1] for mine, theirs in pairs)


def _weakest(chance: float, sigmas: float) -> str:
    from rig.verbs.confirm.proposal import SURE  # noqa: PLC0415

    text = f"{sigmas:.1f} ({chance:.0%})" if sigmas < 100 else f"{sigmas:.0f} ({chance:.0%})"
    return f"[green]{text}[/]" if chance >= SURE else text


def show(confirmed: Confirmed, listed: Mapping[str, Any], report: Path | None, *, as_json: bool) -> int:
    """Verdicts, errors and sentences, and the report; returns the exit code."""
    from rig.verbs.confirm.answers import sentences  # noqa: PLC0415

    code = ExitCode.DONE if confirmed.settled else ExitCode.OUTSIDE_ACCEPTANCE
    if as_json:
        print_json({**listed, **confirmed.to_json()})
        _write_report(confirmed, report)
        return code
    by = ", ".join(map(str, confirmed.paths)) + f" ({duration(3600.0 * confirmed.bench_h)} of bench time)"
    out.print(f"\n{mark(confirmed.first.simulated)}judged by {escape(by)}", soft_wrap=True)
    for answer in confirmed.answers:
        show_answer(answer)
    columns = ("declared model", "with the effects", "scatter of a row")
    several = any(confirmed.named(name) != name for name in confirmed.judged.errors)
    errors = Table("error on the further run" + ("" if several else f" / {confirmed.unit}"), *columns)
    for name, e in confirmed.judged.errors.items():
        errors.add_row(
            escape(confirmed.named(name)), *(f"{confirmed.inferred(e, v):.3g}" for v in (e.before, e.after, e.sigma))
        )
    out.print()
    print_whole(errors, out)
    if confirmed.own:
        out.print(f"  for both models, {confirmed.own}", soft_wrap=True)
    out.print()
    for sentence in sentences(confirmed):
        out.print(escape(sentence), soft_wrap=True)
    _write_report(confirmed, report)
    return code


def show_answer(answer: Confirmation) -> None:
    """A verdict, and every cause with its evidence and size."""
    from rig.fitter.confirm import BY_BOTH  # noqa: PLC0415 - as those below
    from rig.verbs.confirm.answers import chance, sizes, unfit  # noqa: PLC0415

    out.print(f"\n[bold]{escape(answer.effect)}[/]: [bold]{answer.verdict}[/]")
    for member in answer.members:
        cause = f"[green]{escape(member.effect)}[/]" if member.holds else escape(member.effect)
        out.print(f"  {cause}{'' if member.holds else ': does not hold'}", soft_wrap=True)
        fits = "" if member.fits else f"; does not fit: {unfit(member)}"
        behind = f"{member.sigmas:.1f} standard errors behind the best; " if member.sigmas else ""
        clear = f"{member.shown:.1f} standard errors (limit {member.limit:.1f}), p {chance(member.p_shown)}"
        same = f"the same size in both runs: p {member.p_changed:.2g}"
        if member.missed < math.inf:
            same += f"; predicted by the first run, all but {100 * member.missed:.2g} % of it"
        out.print(f"    {behind}shown by {clear}; {same}{fits}", soft_wrap=True)
        size = sizes(member) or ["not told"]
        by_both = any(one.endswith(BY_BOTH) for one in size)  # with a searched constant
        label = f"    size{'' if by_both else ' in the further run'}, 95 %: "
        out.print(label + escape(f"\n{' ' * len(label)}".join(size)), soft_wrap=True)
    if answer.outliers:
        which = ", ".join(str(row + 1) for row in answer.outliers)
        out.print(
            f"  [yellow]observations {which} of the further run are outliers and were left out[/]", soft_wrap=True
        )


def _write_report(confirmed: Confirmed, report: Path | None) -> None:
    if report is None:
        return
    from rig.verbs.confirm.page import write_confirm_report  # noqa: PLC0415

    write_confirm_report(report, confirmed)
    err.print(f"report: {escape(str(report))}", soft_wrap=True)
