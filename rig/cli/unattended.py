"""Options of `rig run` and `rig resume` for log, notifications and service manager."""

from __future__ import annotations

import contextlib
import faulthandler
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, TypedDict

import typer

from rig.engine.session import Progress
from rig.errors import ConfigurationError, ExitCode
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState
from rig.unattended import Listeners, Log, RunFacts, ServiceManager
from rig.unattended.earlier import ended_without_a_word
from rig.unattended.logs import LogFormat, default_log, file_writer, logged_by_journal, stderr_writer
from rig.unattended.place_of_notify import find_settings

LogOption = Annotated[
    Path | None,
    typer.Option(
        "--log",
        help="append a log to this file; - is stderr. Default for a real bench: a log beside the run file",
        show_default=False,
    ),
]
LogFormatOption = Annotated[LogFormat, typer.Option("--log-format", help="lines of the log: text, or JSON objects")]
NotifyOption = Annotated[
    bool | None,
    typer.Option(
        "--notify/--no-notify",
        help="notify people by notify.toml; default: on a real bench, not in a dry run",
        show_default=False,
    ),
]
NotifyFileOption = Annotated[
    Path | None, typer.Option(help="path of notify.toml (also: RIG_NOTIFY)", show_default=False)
]


@dataclass(frozen=True)
class Listening:
    """Options of the command line.

    Attributes:
        log: a file, "-" for stderr, None for the default place.
        log_format: text or JSON lines.
        notify: whether people are notified; None for the default of this bench.
        notify_file: a file in place of the default one.
        dry: a dry run, without notifications by default.
        strict: whether a wrong notify file is an error instead of a warning.
    """

    log: Path | None
    log_format: LogFormat
    notify: bool | None
    notify_file: Path | None
    dry: bool
    strict: bool


@contextlib.contextmanager
def listening(facts: RunFacts, asked: Listening, warn: Callable[[str], None]) -> Iterator[Listeners]:
    """All listeners of a session, for its duration.

    Raises:
        ConfigurationError: notify.toml is wrong, and a person is present to correct it.
    """
    manager = ServiceManager()
    if manager.present and not faulthandler.is_enabled():
        with contextlib.suppress(OSError, ValueError, RuntimeError):
            faulthandler.enable()  # after a watchdog's SIGABRT the journal then shows where the program hung
    listeners = Listeners(replace(facts, served=manager.present), manager)
    try:
        _add_logs(listeners, asked)
        _add_notifier(listeners, asked, warn)
        yield listeners
    except Exception as error:
        listeners.failed(error)
        raise
    finally:
        for words in listeners.close():
            with contextlib.suppress(OSError):  # a closed terminal does not change the result of the run
                warn(words)


def heard(listeners: Listeners, show: Callable[[Progress], None]) -> Callable[[Progress], None]:
    """A function for the sequencer's progress: listeners first, then the terminal unless the log is there."""
    on_stderr = any(log.on_stderr for log in listeners.logs)

    def progress(news: Progress) -> None:
        listeners.progress(news)
        if not on_stderr:
            show(news)

    return progress


def facts_of(run_file: Path) -> RunFacts:
    """The run of a run file, and how its last session ended."""
    with RunReader.open(run_file) as reader:
        about = reader.about()
        return RunFacts(
            path=run_file,
            run_id=about.run_id,
            bench=about.bench or "",
            procedure=about.procedure or "",
            simulated=about.simulated,
            after_crash=ended_without_a_word(reader),
        )


class Remarks(TypedDict):
    """Additional arguments of `Listeners.ended`."""

    note: str
    lost: int


def remarks(code: int, state: RunState) -> Remarks:
    """Words for a log and a message besides the outcome."""
    lost = [f"{len(state.skipped)} of {state.points} points were lost"] if state.skipped else []
    outside = ["outside acceptance"] if code == ExitCode.OUTSIDE_ACCEPTANCE and not state.too_few else []
    return {"note": "; ".join([*lost, *outside]), "lost": len(state.skipped)}


def _add_logs(listeners: Listeners, asked: Listening) -> None:
    if logged_by_journal():
        listeners.logs.append(Log(stderr_writer(), asked.log_format, journal=True, on_stderr=True))
    if asked.log is not None and str(asked.log) == "-":
        if not listeners.logs:
            listeners.logs.append(Log(stderr_writer(), asked.log_format, on_stderr=True))
    elif asked.log is not None:
        listeners.logs.append(Log(file_writer(asked.log), asked.log_format))
    elif listeners.facts.path is not None:
        add_default_log(listeners, asked)


def add_default_log(listeners: Listeners, asked: Listening) -> None:
    """The log beside the run file, if no other was requested and this is a real bench."""
    if asked.log is None and not asked.dry and listeners.facts.path is not None:
        listeners.logs.append(Log(file_writer(default_log(listeners.facts.path)), asked.log_format))


def _add_notifier(listeners: Listeners, asked: Listening, warn: Callable[[str], None]) -> None:
    if not (not asked.dry if asked.notify is None else asked.notify):
        return
    path = find_settings(asked.notify_file)
    if path is None:
        if asked.notify:
            raise ConfigurationError("--notify: there is no notify.toml; docs/how_to/unattended.md shows one")
        return
    from rig.unattended.notify.channels import senders  # noqa: PLC0415 - mail and web take a while
    from rig.unattended.notify.notifier import Notifier  # noqa: PLC0415 - mail and web take a while
    from rig.unattended.notify.notify_file import read_settings  # noqa: PLC0415 - mail and web take a while

    try:
        settings = read_settings(path)
    except ConfigurationError as error:
        if asked.strict:
            raise
        text = f"nobody will be notified: {error}"
        listeners.say("warning", text)
        warn(text)
        return
    sends, wrong = senders(settings, str(path))
    if wrong and asked.strict:
        raise ConfigurationError("\n".join(wrong))
    for text in wrong:  # the other channels still work
        said = f"nobody will be notified{' there' if sends else ''}: {text}"
        listeners.say("warning", said)
        warn(said)
    listeners.notifier = Notifier(settings, sends, told=listeners.told, failed=listeners.not_told)
