"""A plug-in of pytest: keeps what the tests print as JSON, to compare two states of the program.

ANSWERS=FOLDER .venv/bin/pytest -p proving.answers_of_tests -n 2 -q, then `proving.same_answers compare`.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from proving.same_answers import plain

FOLDER = Path(os.environ.get("ANSWERS", "answers"))


@pytest.fixture(autouse=True)
def _answers(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    kept: list[Any] = []
    dump = json.dump

    def keeping(value: Any, *arguments: Any, **options: Any) -> None:
        if options.get("indent") == 2:
            kept.append(json.loads(json.dumps(plain(value), default=str)))
        dump(value, *arguments, **options)

    monkeypatch.setattr(json, "dump", keeping)
    yield
    if kept:
        FOLDER.mkdir(parents=True, exist_ok=True)
        name = f"{request.node.path.stem}-{hashlib.sha256(request.node.nodeid.encode()).hexdigest()[:12]}.json"
        (FOLDER / name).write_text(json.dumps({request.node.nodeid: kept}, indent=1, sort_keys=True))
