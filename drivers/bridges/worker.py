"""The process of a bridge: makes a driver of another library, reads and sets its attributes as told.

Requests come at standard input, a JSON object a line; so do answers at standard output. What the library prints goes to
standard error. The process ends when its input ends, however busy the library is.
"""

from __future__ import annotations

import importlib
import json
import os
import queue
import sys
import threading
import warnings
from typing import Any

from rig.drivers.bridges.objects import Library, Wrong, printed

_LAST_S = 3.0  # for a library to end what it does, when nobody listens any more


def main() -> None:
    """Serve requests until the input ends."""
    warnings.simplefilter("ignore")
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what the library prints is no answer
    requests: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    library: Library | None = None
    while (request := requests.get()) is not None:
        try:
            if request["do"] == "open":
                library = _opened(request)
                answer: dict[str, Any] = {}
            else:
                assert library is not None
                answer = _done(library, request)
        except Wrong as wrong:
            answer = {"wrong": str(wrong), "kind": wrong.kind}
        except Exception as error:  # whatever a library raises
            answer = {"wrong": _said(error), "kind": "timeout" if _is_timeout(error) else "raised"}
        answers.write(json.dumps(answer).encode() + b"\n")
        if request["do"] == "close":
            break
    os._exit(0)  # threads and handlers of libraries do not end by themselves


def _listen(requests: queue.SimpleQueue[dict[str, Any] | None]) -> None:
    for line in sys.stdin.buffer:
        requests.put(json.loads(line))
    requests.put(None)
    threading.Event().wait(_LAST_S)
    os._exit(0)


def _opened(request: dict[str, Any]) -> Library:
    """The driver. Raises `Wrong`."""
    kind = request["kind"]
    try:
        importlib.import_module(kind)
    except ImportError as error:
        raise Wrong(_said(error), "missing library") from None
    host = importlib.import_module(f"rig.drivers.bridges.of_{kind}")
    try:
        made: Library = host.opened(request["what"], request["address"], request["arguments"])
    except Wrong as wrong:
        raise Wrong(str(wrong), "open") from None
    except Exception as error:
        raise Wrong(_said(error), "open") from None
    return made


def _done(library: Library, request: dict[str, Any]) -> dict[str, Any]:
    match request["do"]:
        case "identity":
            return {"identity": library.identity()}
        case "read":
            value, unit, stamp = library.read(request["path"])
            text, own = printed(value, request["path"])
            return {"text": text, "unit": _plain(unit or own), "stamp": stamp}
        case "write":
            library.write(request["path"], request["text"])
        case "call":
            library.call(request["path"])
        case "close":
            library.close()
    return {}


def _plain(unit: str) -> str:
    """A unit in letters that every form of an answer reads."""
    for sign, letters in (("\u03a9", "ohm"), ("\u2126", "ohm"), ("\u00b5", "u"), ("\u03bc", "u"), ("\u00b0", "deg")):
        unit = unit.replace(sign, letters)
    return "" if unit in ("", "1", "dimensionless", "None") else unit


def _is_timeout(error: BaseException) -> bool:
    return isinstance(error, TimeoutError) or "timeout" in type(error).__name__.lower() or "VI_ERROR_TMO" in str(error)


def _said(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}"[:500] if text else type(error).__name__


if __name__ == "__main__":
    main()
