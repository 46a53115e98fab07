"""`rig night`: simulated nights on which everything goes wrong."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.progress import counting
from rig.cli.show import err, out, print_json
from rig.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from proving.night.scenario import Size
    from proving.seeds import Place


@app.command()
def night(
    seeds: Annotated[int, typer.Option(min=1, help="how many nights of each laboratory")] = 100,
    first: Annotated[int, typer.Option(min=0, help="the first seed")] = 0,
    lab: Annotated[
        str,
        typer.Option(
            help="an example laboratory by its folder, such as bath; all; both: attitude and pressure; or any-bench: "
            "drawn from the seed, of all instruments and protocols"
        ),
    ] = "both",
    full: Annotated[bool, typer.Option("--full", help="the examples' whole procedures, 28 and 37 hours")] = False,
    brief: Annotated[bool, typer.Option("--brief", help="4 points a night: to try a cluster or a ledger")] = False,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="replay this one night, and tell it in order of time", show_default=False),
    ] = None,
    bug: Annotated[
        str | None,
        typer.Option(help="plant a bug in the controller, and stop when a night finds it", show_default=False),
    ] = None,
    keep: Annotated[
        Path | None, typer.Option(help="with --seed: an empty folder to leave its run file in", show_default=False)
    ] = None,
    calm: Annotated[bool, typer.Option("--calm", help="nothing goes wrong: what the fit alone does")] = False,
    bench: Annotated[
        Path | None,
        typer.Option(help="with --lab: your own bench instead of the laboratory's", show_default=False),
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="processes")] = os.cpu_count() or 1,
    scheduler: Annotated[
        str | None,
        typer.Option(help="a Dask cluster instead: its scheduler's address, tcp://host:8786", show_default=False),
    ] = None,
    ledger: Annotated[
        Path | None,
        typer.Option(help="keep results in this file, and go on with what is in it", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Simulate nights with faults, crashes and power cuts, and check invariants after each.

    Nights are short (2 x 12 points, or 4 whole plots of 3 pressures; of other laboratories about 12 points) unless
    --full or --brief is given. Every seed is a night of its own, the same on every machine. A bench of
    your own may have any installed instrument; the faults that its twin declares happen as well. What is checked:
    proving/notes/nights.md. A campaign with a --ledger that was stopped or killed goes on with the same command.

    Examples:

    - `rig night --seeds 1000`
    - `rig night --seed 42 --lab attitude`
    - `rig night --bug skip-re-approach`
    """
    from proving.night.any_bench import LAB as ANY_BENCH  # noqa: PLC0415
    from proving.night.bugs import BUGS  # noqa: PLC0415
    from proving.night.scenario import EVERY_LAB, LABS  # noqa: PLC0415
    from proving.seeds import Place  # noqa: PLC0415

    if bug is not None and bug not in BUGS:
        raise UsageError(f"--bug {bug}: there is no such bug; there are {', '.join(BUGS)}")
    if full and brief:
        raise UsageError("--full or --brief: a night has one size")
    size: Size = "full" if full else "brief" if brief else "short"
    if lab not in (*EVERY_LAB, ANY_BENCH, "both", "all"):
        known = ", ".join(EVERY_LAB)
        raise UsageError(f"--lab {lab}: there is no such example; there are {known}, both, all and {ANY_BENCH}")
    if lab == ANY_BENCH and (full or bench is not None):
        raise UsageError(f"--lab {ANY_BENCH}: its bench is drawn from the seed, and its nights are short or --brief")
    labs = LABS if lab == "both" else EVERY_LAB if lab == "all" else (lab,)
    texts = None
    if bench is not None:
        if len(labs) > 1:
            raise UsageError("--bench is one laboratory's: say which one's procedures to run on it with --lab")
        texts = _read(bench)
    nights = _Nights(size, bug or "", calm, texts, "" if bench is None else f" --bench {bench}")
    if seed is not None:
        if len(labs) > 1:
            raise UsageError("--seed replays one night: say of which laboratory with --lab")
        return _replay(seed, labs[0], nights, keep)
    if keep is not None:
        raise UsageError("--keep leaves the run file of one night: say which with --seed and --lab")
    console = err if as_json else out
    chosen = range(first, first + seeds)
    with Place.open(jobs, scheduler, ledger) as place:
        summary = {one: _campaign(chosen, one, nights, place, console) for one in labs}
    if as_json:
        print_json(summary)
    if bug:
        return ExitCode.DONE if any(s["violations"] for s in summary.values()) else ExitCode.FAULT
    return ExitCode.DONE if all(s["holds"] for s in summary.values()) else ExitCode.FAULT


@dataclass(frozen=True)
class _Nights:
    """Which nights.

    Attributes:
        size, bug, calm, bench: see `proving.night.campaign.one_night`.
        of_bench: the option that names the bench, for replays; "" without.

    """

    size: Size
    bug: str
    calm: bool
    bench: Mapping[str, str] | None
    of_bench: str

    @property
    def asked(self) -> dict[str, Any]:
        """As arguments of `one_night`."""
        return {"size": self.size, "bug": self.bug, "calm": self.calm, "bench": self.bench}

    def __str__(self) -> str:
        """As options of the command."""
        bug = f" --bug {self.bug}" if self.bug else ""
        size = "" if self.size == "short" else f" --{self.size}"
        return f"{size}{bug}{' --calm' if self.calm else ''}{self.of_bench}"


def _read(bench: Path) -> dict[str, str]:
    """A bench file and the contract files that it names, by name. Raises `ConfigurationError`."""
    from rig.bench.bench_file import check_options  # noqa: PLC0415
    from rig.bench.config import read_text  # noqa: PLC0415
    from rig.bench.contract_files import read_bench  # noqa: PLC0415
    from rig.simulated.dry_run import twin_classes  # noqa: PLC0415

    config, beside = read_bench(bench)
    check_options(config, str(bench))
    twin_classes(config)
    return {"bench.toml": read_text(bench, "bench"), **beside}


def _campaign(seeds: range, lab: str, which: _Nights, place: Place, console: Console) -> dict[str, Any]:
    from proving.night.campaign import Verdict, nights, unbiased  # noqa: PLC0415
    from proving.seeds import Digest  # noqa: PLC0415

    digest = Digest()
    total = Counter(dict.fromkeys(("nights", "sessions", "happened", "skipped", "violations", "unknowable"), 0))
    found: list[str] = []
    off: list[tuple[str, float, float]] = []
    results = place.results(nights(lab, **which.asked), seeds)
    with counting(lab, len(seeds)) as one_more, closing(results):
        for seed, result in results:
            digest.add(seed, result)
            verdict = Verdict.of(result)
            total["nights"] += 1
            total["sessions"] += verdict.sessions
            total["happened"] += verdict.happened
            total["skipped"] += verdict.skipped
            total["violations"] += bool(verdict.violations)
            total["unknowable"] += bool(verdict.unknowable)
            off += verdict.deviations
            for one in verdict.unknowable:
                err.print(f"{lab} seed {verdict.seed}: nobody could know: {escape(one.unknowable)}", soft_wrap=True)
            for violation in verdict.violations:
                line = f"seed {verdict.seed}: {violation.invariant}: {violation.what}"
                found.append(line)
                if len(found) <= _SHOWN:
                    err.print(f"[red]{lab}[/] {escape(line)}", soft_wrap=True)
            if verdict.violations:
                err.print(f"  replay: rig night --lab {lab} --seed {verdict.seed}{escape(str(which))}", soft_wrap=True)
            one_more(f"{total['violations']} in which something did not hold")
            if which.bug and verdict.violations:
                break
    bias = None if which.size == "brief" else unbiased(off, lab)  # too few points for a calibration to be judged
    words = (
        f"{lab}: {total['nights']} nights, {total['happened']} things that went wrong, {total['sessions']} sessions, "
        f"{total['skipped']} points given up for a reason; {total['violations']} nights in which something did not hold"
    )
    if total["unknowable"]:
        words += f", {total['unknowable']} in which nobody could know better"
    console.print(words, soft_wrap=True)
    if bias is not None:
        console.print(f"  {bias}", soft_wrap=True)
        if not bias.holds:
            err.print(
                f"[red]{lab}[/] unbiased: mean or sd are further from 0 and {bias.own_sd:g} than by chance",
                soft_wrap=True,
            )
    figures = None if bias is None else {"coefficients": bias.quantities, "mean": bias.mean, "sd": bias.sd}
    holds = not total["violations"] and (bias is None or bias.holds)
    return {**total, "holds": holds, "bias": figures, "found": found[:_KEPT], "digest": str(digest)}


_SHOWN, _KEPT = 10, 100


def _replay(seed: int, lab: str, nights: _Nights, keep: Path | None) -> int:
    import tempfile  # noqa: PLC0415

    from proving.night.campaign import replay  # noqa: PLC0415

    if keep is not None and keep.exists() and any(keep.iterdir()):
        raise UsageError(f"--keep {keep}: the folder is not empty")
    with tempfile.TemporaryDirectory(prefix="rig-night-") as temporary:
        folder = keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        verdict, told = replay(seed, lab, folder, **nights.asked)
    for line in told:
        out.print(escape(line), soft_wrap=True, highlight=False)
    for violation in verdict.violations:
        err.print(f"[red]does not hold:[/] {escape(violation.invariant)}: {escape(violation.what)}", soft_wrap=True)
    for one in verdict.unknowable:
        err.print(f"nobody could know ({escape(one.unknowable)}): {escape(one.invariant)}", soft_wrap=True)
    if not verdict.violations and not verdict.unknowable:
        err.print("everything holds")
    return ExitCode.FAULT if verdict.violations else ExitCode.DONE
