"""The report of a loop: the night step by step, decisions with their reasons, errors before and after."""

from __future__ import annotations

from rig.loop.program import ONE_WITH_FIRST, Program
from rig.loop.timeline import clock_time
from rig.procedures.evaluate.results import Page
from rig.tables.table_of_run import run_table
from rig.verbs.confirm import Confirmed, sentences
from rig.verbs.confirm.page import shown_answers, shown_errors


def loop_page(program: Program, confirmed: Confirmed | None) -> Page:
    """The report, with the provenance of the first run.

    Args:
        program: state of the loop.
        confirmed: the judgement by all further runs; None without one.
    """
    table = run_table(program.file_of(program.runs[0]))
    contents = {
        "program": program.path.name,
        "steps": [(clock_time(record.utc_s), record.sentence()) for record in program.story],
        "why": program.decided.why if program.decided is not None else "",
        "runs": [
            (
                run.planned.number,
                run.planned.what,
                program.file_of(run).name,
                f"{run.ended.how}{ONE_WITH_FIRST if run.joined else ''}" if run.ended is not None else "not ended",
                f"{run.ended.took_s / 3600.0:.1f}" if run.ended is not None else "",
                run.ended.head if run.ended is not None else "",
            )
            for run in program.runs
        ],
        "found": [program.found[after].words for after in sorted(program.found)],
        "unit": "" if confirmed is None else confirmed.unit,
        "errors": [] if confirmed is None else shown_errors(confirmed),
        "sentences": [] if confirmed is None else list(sentences(confirmed)),
        "answers": [] if confirmed is None else shown_answers(confirmed),
        "for_person": [
            (one.do or "give it time", one.what, f"{one.hours:.1f}", one.decides) for one in program.for_person
        ],
        "wrote": [(one.what, one.why or ", ".join(one.files)) for one in program.wrote.values()],
    }
    span_s = sum(run.ended.took_s for run in program.runs if run.ended is not None)
    return Page("rig.loop", "loop.html.j2", table, span_s, {"columns": []}, contents)
