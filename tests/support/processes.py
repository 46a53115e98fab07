"""Tests in several processes, forked when all are collected: what they import and their parameters are made once."""

from __future__ import annotations

import gc
import itertools
import multiprocessing
from collections.abc import Generator, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from types import SimpleNamespace

import pytest


class Processes:
    """Hands out files of tests to so many processes, the next file to the first that has nothing left.

    Args:
        count: how many processes.

    """

    def __init__(self, count: int) -> None:
        self._count = count

    @pytest.hookimpl(wrapper=True)
    def pytest_runtestloop(self, session: pytest.Session) -> Generator[None, object, object]:
        """Run all tests, unless the collection failed or is all that was asked for."""
        items, session.items = session.items, []
        done = yield  # pytest's own loop, here of no tests
        session.items = items
        if not session.config.option.collectonly:
            self._run(session)
        return done

    def _run(self, session: pytest.Session) -> None:
        files: dict[Path, list[pytest.Item]] = {}
        for item in session.items:
            files.setdefault(item.path, []).append(item)
        folder: Path = session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
        context = multiprocessing.get_context("fork")
        given = context.Value("i", 0)
        gc.collect()
        gc.freeze()  # or each process would look through all that was collected, and with that copy it
        processes, at = [], {}
        for k in range(self._count):
            pipe, theirs = context.Pipe(duplex=False)
            at[pipe] = ""
            work = (session, [*files.values()], given, folder / str(k), [*at], theirs)
            processes.append(context.Process(target=_work, args=work))
            processes[-1].start()
            theirs.close()  # so that the pipe ends with the process
        try:
            finished = _report(session, at)
        except BaseException:
            for process in processes:
                process.terminate()
            raise
        finally:
            for process in processes:
                process.join(10.0)
                process.kill()  # a test may have left a handler of the signal, or a thread that does not end
        if finished < len(session.items):
            died = [name for name in at.values() if name]
            session.shouldfail = f"{len(session.items) - finished} tests have no result: processes died at {died}"
            raise session.Failed(session.shouldfail)


def _report(session: pytest.Session, at: dict[Connection, str]) -> int:
    """Pass on what the processes say of their tests, until all have ended; return how many tests have finished.

    Args:
        session: pytest's.
        at: the pipe of each process, and the name of the test that it is at.

    """
    hook, finished, working = session.config.hook, 0, [*at]
    while working:
        for pipe in wait(working):
            assert isinstance(pipe, Connection)
            try:
                name, location, report = pipe.recv()
            except EOFError:
                working.remove(pipe)
                continue
            at[pipe] = "" if location else name
            if report is not None:
                report = hook.pytest_report_from_serializable(config=session.config, data=report)
                hook.pytest_runtest_logreport(report=report)
            elif location:
                hook.pytest_runtest_logfinish(nodeid=name, location=location)
                finished += 1
            if session.shouldfail:
                raise session.Failed(session.shouldfail)
            if session.shouldstop:
                raise session.Interrupted(session.shouldstop)
    return finished


def _work(
    session: pytest.Session,
    files: list[list[pytest.Item]],
    given: Synchronized[int],
    folder: Path,
    read: list[Connection],
    pipe: Connection,
) -> None:
    """Run tests in a process of its own, file by file, until none is left."""
    for end in read:
        end.close()  # or nothing would tell this process that nobody reads what it says
    config = session.config
    config._tmp_path_factory._basetemp = folder  # type: ignore[attr-defined]
    folder.mkdir()
    capture = config.pluginmanager.getplugin("capturemanager")
    capture.stop_global_capturing()  # its files are those of all processes
    capture.start_global_capturing()
    # Nothing but what is said at a timeout is written from here.
    terminal = config.pluginmanager.unregister(name="terminalreporter")
    config.pluginmanager.register(SimpleNamespace(_tw=terminal._tw), "terminalreporter")
    config.pluginmanager.register(_Telling(config, pipe))
    parent = multiprocessing.parent_process()
    assert parent is not None

    def handed_out() -> Iterator[pytest.Item]:
        while parent.is_alive():
            with given:
                place, given.value = given.value, given.value + 1
            if place >= len(files):
                return
            yield from files[place]

    with suppress(KeyboardInterrupt, BrokenPipeError):
        for item, following in itertools.pairwise(itertools.chain(handed_out(), [None])):
            assert item is not None
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)


class _Telling:
    """Sends the reports of a process: a test's name, then each of its reports, then where it stands, as it is over."""

    def __init__(self, config: pytest.Config, pipe: Connection) -> None:
        self._config, self._pipe = config, pipe

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._pipe.send((nodeid, None, None))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        data = self._config.hook.pytest_report_to_serializable(config=self._config, report=report)
        self._pipe.send((report.nodeid, None, data))

    def pytest_runtest_logfinish(self, nodeid: str, location: tuple[str, int | None, str]) -> None:
        self._pipe.send((nodeid, location, None))
