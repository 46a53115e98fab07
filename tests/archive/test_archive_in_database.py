"""The index of a laboratory in a PostgreSQL database: it says what the index in the folder's file says."""

from __future__ import annotations

import json
import random
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from postgres import MISSING, Server
from test_archive import register, write

from rig.archive import Lab, affected, due, history
from rig.archive import index as archive_index
from rig.archive.documents import read_kept
from rig.errors import StorageError, UsageError
from rig.lab import Laboratory
from rig.serve.drift import of_item
from tests.support.command import rig

pytestmark = pytest.mark.skipif(MISSING is not None, reason=str(MISSING))


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server.made()
    yield server
    server.end()


@pytest.fixture(scope="module")
def database(server: Server) -> str:
    return server.database("laboratory")


@contextmanager
def both(folder: Path, database: str) -> Iterator[tuple[Lab, Lab]]:
    with Lab.open(folder) as one, Lab.open(folder, database=database) as other:
        yield one, other


def answers(lab: Lab) -> dict[str, Any]:
    """All that is said of a laboratory."""
    found: dict[str, Any] = {"due": [asdict(one) for one in due(lab)], "problems": lab.problems()}
    for name in ("S-1", "S-2", "DVM-1", "REF-7", "E-7"):
        for ask in (history, affected):
            try:
                told = ask(lab, name)
            except UsageError as error:
                found[f"{ask.__name__} {name}"] = str(error)
            else:
                found[f"{ask.__name__} {name}"] = [asdict(one) for one in (told if isinstance(told, list) else [told])]
    return found


def a_laboratory(folder: Path, rng: random.Random) -> Iterator[None]:
    """Files come, go, move and are copied; a step between any two of them."""
    folders = [folder, folder / "2024", folder / "2025"]
    for one in folders[1:]:
        one.mkdir()
    made: list[Path] = []
    for step in range(14):
        match rng.randrange(5):
            case 0 if made:
                made.pop(rng.randrange(len(made))).unlink()
            case 1 if made:
                copied = rng.choice(made)
                made.append(rng.choice(folders) / f"again-{step}.json")
                made[-1].write_bytes(copied.read_bytes())
            case 2:
                serial = rng.choice(("", "1", "REF"))
                register(rng.choice(folders), rng.choice(("DVM-1", "REF-7")), f"2026-0{rng.randrange(1, 9)}-01", serial)
            case _:
                day = date(2020, 1, 1) + timedelta(rng.randrange(2000))
                made.append(
                    write(
                        rng.choice(folders),
                        f"Ü-{step}" if rng.random() < 0.2 else f"C-{step}",
                        day,
                        value=rng.gauss(5.0, 0.01),
                        serial=rng.choice(("S-1", "S-2", "REF")),
                        used=rng.choice(("DVM-1", "REF-7")),
                        next_due=rng.choice((None, day + timedelta(365))),
                        replaces=rng.choice(("", "", f"C-{step - 1}")),
                        simulated=rng.random() < 0.3,
                    )
                )
        yield


@pytest.mark.parametrize("seed", range(3))
def test_all_answers_are_those_of_the_file(tmp_path: Path, database: str, seed: int) -> None:
    print("seed", seed)
    rng = random.Random(seed)
    for _ in a_laboratory(tmp_path, rng):
        if rng.random() < 0.5:
            with both(tmp_path, database) as (one, other):
                assert answers(other) == answers(one)
    with both(tmp_path, database) as (one, other):
        before = answers(other)
        assert before == answers(one)
        assert before["due"]
    with Lab.open(tmp_path, rebuild=True, database=database) as lab:
        assert answers(lab) == before


def test_a_kill_in_a_refresh_leaves_the_index_as_it_was(
    tmp_path: Path, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))
    with Lab.open(tmp_path, database=database) as lab:
        before = answers(lab)
    for i in range(2, 6):
        write(tmp_path, f"C-{i}", date(2025, i, 10))
    calls: list[Path] = []

    def killed(path: Path) -> Any:
        calls.append(path)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return read_kept(path)

    monkeypatch.setattr(archive_index, "read_kept", killed)
    with pytest.raises(KeyboardInterrupt), Lab.open(tmp_path, database=database):
        pass
    monkeypatch.undo()
    with both(tmp_path, database) as (one, other):
        assert before != answers(other) == answers(one)


def test_several_at_once_wait_for_one_another(tmp_path: Path, database: str) -> None:
    for i in range(1, 9):
        write(tmp_path, f"C-{i}", date(2025, i, 10))
    told: list[int] = []

    def look() -> None:
        with Lab.open(tmp_path, database=database) as lab:
            told.append(len(lab.rows("SELECT * FROM certificate")))

    threads = [threading.Thread(target=look) for _ in range(6)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert told == [8] * 6


def test_two_laboratories_of_one_database_are_apart(tmp_path: Path, database: str) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write(tmp_path / name, f"C-{name}", date(2025, 1, 10), serial=f"S-{name}")
    for name in ("a", "b", "a"):
        with Lab.open(tmp_path / name, database=database) as lab:
            assert [one.certificate for one in due(lab)] == [f"C-{name}"]


def test_the_page_of_an_item_is_by_the_same_index(tmp_path: Path, database: str) -> None:
    for year in (2021, 2022, 2023):
        write(tmp_path, f"C-{year}", date(year, 1, 1), value=5.0 + 0.01 * (year - 2021))
    of_file, of_database = (of_item(Laboratory(tmp_path, kept), "EXAMPLE 10 kN S-1") for kept in ("", database))
    assert of_file is not None
    assert of_database is not None
    one, other = (re.sub(r"<svg.*?</svg>", "<svg>", str(found)) for found in (of_file, of_database))
    assert one == other
    assert "<svg>" in one
    assert of_item(Laboratory(tmp_path, "postgresql://rig@127.0.0.1:1/lab"), "EXAMPLE 10 kN S-1") is None


def test_the_command_takes_its_address_and_never_shows_the_password(tmp_path: Path, database: str) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10), next_due=date(2026, 1, 10))
    asked = ("lab", "--folder", tmp_path, "--today", "2026-02-01", "--check", "--json")
    late = rig(*asked, env={"RIG_DATABASE": database})
    assert (late.returncode, json.loads(late.stdout)["answer"][0]["days"]) == (3, -22)
    assert not list(tmp_path.glob(".rig-lab*"))
    gone = rig(*asked, "--database", "postgresql://rig:secret@127.0.0.1:1/lab")
    assert gone.returncode == 1
    assert "the index of the laboratory in postgresql://rig:***@127.0.0.1:1/lab cannot be reached" in gone.stderr


def test_a_database_that_stops_meanwhile_is_told(tmp_path: Path, server: Server, database: str) -> None:
    write(tmp_path, "C-1", date(2025, 1, 10))

    def ask_a_stopped_one() -> None:
        with Lab.open(tmp_path, database=database) as lab:
            server.stop()
            due(lab)

    try:
        with pytest.raises(StorageError, match="the index of the laboratory"):
            ask_a_stopped_one()
    finally:
        server.start()
    with Lab.open(tmp_path, database=database) as lab:
        assert [one.certificate for one in due(lab)] == ["C-1"]
