"""A hook: a small Python file beside an instrument's file, for what a file cannot say.

It may have `parse(question, answer)`, which gives an answer in a form of the file; `settled(setpoint, readings)`, which
decides whether a source has arrived, from its readings as (seconds since it was set, value); and, for the twin,
`say(question, answer)`, which makes of an answer of the file what the instrument would say.

A run file has the place of the hook and its SHA-256, never its code: what a run file says is not carried out.
"""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

_KEY = re.compile(r'^hook *= *"([^"\n]+)"', re.MULTILINE)
NAMES = ("parse", "settled", "say")

LONGEST_S = 10.0
"""Real seconds that one call may take; chosen: the longest that an operator waits without a word."""

Function = Callable[..., Any]


def placed(text: str, folder: Path) -> str:
    """The text of an instrument's file in a folder, with its hook by whole path and SHA-256.

    Raises:
        OSError: the hook cannot be read.
        ValueError: it does not stand beside the file.
    """
    found = _KEY.search(text)
    if found is None or "hook_sha256" in text:
        return text
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*\.py", found[1]):
        raise ValueError(f'its hook {found[1]!r} has to be a Python file beside it: hook = "my_bath.py"')
    path = (folder / found[1]).resolve()
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return f'{text[: found.start()]}hook = {json.dumps(str(path))}\nhook_sha256 = "{digest}"{text[found.end() :]}'


def hooks(path: str, sha256: str) -> Mapping[str, Function]:
    """Functions of a hook by name; its code is run once.

    Raises:
        ValueError: it is not there, was changed, cannot be run, or has none of the functions.
    """
    try:
        code = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"its hook {path} cannot be read ({error.strerror}): put it back") from None
    if hashlib.sha256(code).hexdigest() != sha256:
        raise ValueError(f"its hook {path} is not the one that was read at the begin: it has been changed since")
    return _functions(path, code)


@cache
def _functions(path: str, code: bytes) -> Mapping[str, Function]:
    names: dict[str, Any] = {"__name__": "hook"}
    try:
        _Bounded(exec)(compile(code, path, "exec"), names)
    except Exception as error:  # whatever somebody's code raises
        raise ValueError(f"its hook {path} cannot be run: {type(error).__name__}: {error}") from error
    found = {name: _Bounded(names[name]) for name in NAMES if callable(names.get(name))}
    if not found:
        raise ValueError(f"its hook {path} has none of the functions {', '.join(NAMES)}")
    return found


class _Bounded:
    """A function of a hook that is given up after a while, so that a run goes to its safe state.

    Nothing ends what it does: its thread goes on, and it is not called again.
    """

    def __init__(self, function: Function) -> None:
        self._function, self._hangs = function, False

    def __call__(self, *given: Any) -> Any:
        outcome: list[tuple[bool, Any]] = []

        def carried_out() -> None:
            try:
                outcome.append((True, self._function(*given)))
            except BaseException as error:  # it is raised where the function was called
                outcome.append((False, error))

        if not self._hangs:
            thread = threading.Thread(target=carried_out, name="hook", daemon=True)
            thread.start()
            thread.join(LONGEST_S)
        if not outcome:
            self._hangs = True
            raise TimeoutError(f"it takes longer than {LONGEST_S:g} s, and is not called again")
        done, found = outcome[0]
        if not done:
            raise found
        return found
