"""Contents of the pages of a laboratory, from its files, as plain values."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

from rig.acts import Places, is_loop
from rig.bench.config import parse_bench, parse_toml, read_text
from rig.errors import RigError, RunFileError
from rig.lab import Laboratory, differences
from rig.lab.laboratory import Log, Proposal
from rig.loop import open_program
from rig.procedures.present.durations import duration
from rig.run_file.events.sessions import RunCreated
from rig.run_file.live import asked_by_hand, live_path, read_json
from rig.serve.equipment import EquipmentList, moment, print_of
from rig.watch import Shelf
from rig.who import login_of

_FRESH_S, _LOOKED_S = 0.9, 300.0
_MOST_RECORDS, _MOST_LINES = 200, 200
SOON_DAYS = 30
Link = tuple[str, str]
TELLS = {
    "benches": "Benches: state, what runs, since when, until when.",
    "queue": "The queue.",
    "runs": "Runs and loops, the newest first.",
    "proposals": "Proposals, with their dry runs, hashes and decisions.",
    "equipment": "Equipment and items, with due dates.",
    "people": "People and programs: names, roles, and how they log in.",
}
"""What programs may ask, with the words of its description."""


@dataclass
class Site:
    """The laboratory as pages show it. May be called from several threads.

    Attributes:
        places: its files.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.
        shelf: its runs.
        equipment: its equipment and items.
    """

    places: Places
    stopwatch: Callable[[], float]
    utc: Callable[[], float]
    shelf: Shelf = field(init=False)
    equipment: EquipmentList = field(init=False)

    def __post_init__(self) -> None:
        self.shelf = Shelf(self.places.runs, None, self.stopwatch, self.utc)
        self._lock = threading.Lock()
        self._made_s, self._benches = -1e9, list[dict[str, Any]]()
        self._log: tuple[object, Log] = (None, Log())
        self.problem = ""
        self._comparing = threading.Lock()  # of its own: to compare long texts takes seconds
        self._changes: tuple[object, list[dict[str, Any]]] = (None, [])
        self.equipment = EquipmentList(self.places, self.stopwatch, self.utc)

    @property
    def laboratory(self) -> Laboratory:
        """The laboratory."""
        return self.places.laboratory

    def log(self) -> Log:
        """State of the log, verified; read again after a change only. Empty if it was edited: `problem` says so."""
        path = self.laboratory.log_file
        now = tuple(print_of(one) for one in (path, path.with_name(path.name + "-wal")))
        with self._lock:
            if self._log[0] != now:
                try:
                    self._log, self.problem = (now, self.laboratory.verified_log()), ""
                except RunFileError as error:  # benches are shown all the same; no approval in it is
                    self._log, self.problem = (now, Log()), str(error)
            return self._log[1]

    def changes(self) -> list[dict[str, Any]]:
        """The last records of the log, the newest first, with changed lines; compared again after a change only."""
        log = self.log()
        with self._comparing:
            if self._changes[0] is not log:
                found = [
                    {"when": moment(record.utc_s), "says": record.sentence(), "lines": lines[:_MOST_LINES]}
                    for record, lines in differences(log, _MOST_RECORDS)
                    if not isinstance(record.event, RunCreated)
                ]
                self._changes = (log, found[::-1])
            return self._changes[1]

    def benches(self) -> list[dict[str, Any]]:
        """Benches: state, what runs, since when, until when; at most once a second, however many pages are open."""
        with self._lock:
            if self.stopwatch() - self._made_s >= _FRESH_S:
                self._benches, self._made_s = self._read_benches(), self.stopwatch()
            return self._benches

    def _read_benches(self) -> list[dict[str, Any]]:
        entries = self.shelf.entries()
        file, queue = self.places.queue()
        folders = {file.folder_of(number): item.bench for number, item in queue.items.items()}
        started = {name: folders[path.parent] for name, path in self.places.runs().items() if path.parent in folders}
        found = []
        for name, path in self.places.benches().items():
            try:
                config = parse_bench(read_text(path, "bench"), name)
                title, problem, approval = config.name, "", config.approval
            except RigError as error:
                title, problem, approval = name, str(error), False
            # Two benches may have one name: a run of the queue belongs to the bench file of its item.
            own = [one for one in entries if started.get(one.name, str(path)) == str(path) and one.bench == title]
            work = [self._at_work(one.name) for one in own if one.running]
            waiting = [one for one in queue.waiting if one.bench == str(path)]
            last = next((one for one in own if not one.running), None)
            found.append(
                {
                    "name": name,
                    "title": title,
                    "problem": problem,
                    "approval": approval,
                    "work": work,
                    "held": queue.held.get(str(path)),
                    "paused": queue.paused,
                    "waiting": [Path(one.asked.procedure).name for one in waiting],
                    "last": None if last is None else {"name": last.name, "what": last.procedure, "state": last.state},
                }
            )
        return found

    def _at_work(self, name: str) -> dict[str, Any]:
        feed = self.shelf.feed(name)
        assert feed is not None
        feed.refresh()
        view = feed.view()
        state, about = view["state"], view["about"]
        left_s, end_s = state["remaining_s"], state["end_utc_s"]
        return {
            "name": name,
            "what": about.get("procedure", name),
            "simulated": about.get("simulated", False),
            "word": state["word"],
            "doing": state["doing"],
            "tone": state["tone"],
            "done": state["done"],
            "points": state["points"],
            "since": moment(about.get("began_utc_s")),
            "by": about.get("operator", ""),
            "until": moment(end_s),
            "left": "" if left_s is None else duration(left_s),
            "faults": state["faults"],
        }

    def acts_of_run(self, name: str, view: Mapping[str, Any]) -> list[Link]:
        """What may be done with a run: address and words. Whether somebody may do it is asked at the act."""
        state = view["state"]
        try:
            path = self.places.run(name)
        except RigError:
            return []
        links: list[Link] = []
        if state["running"]:
            asked = asked_by_hand(read_json(live_path(path)) or {})
            if asked is not None:
                links.append((act("done", run=name, step=asked.step), f"Done: {asked.say.rstrip('. ')}"))
            elif state["word"] == "holding":
                links.append((act("release", run=name), "Release"))
            if state["word"] != "holding":
                links.append((act("hold", run=name), "Hold"))
            links.append((act("stop", run=name), "Stop"))
        elif not state["ended"]:
            links.append((act("resume", run=name), "Resume"))
        if state["accepted"] and not is_loop(path) and not state["running"]:
            links += [(act("report", run=name), "Report"), (act("calibrate", run=name), "Calibration")]
            if state["ended"]:
                links.append((act("sign", run=name), "Certificate"))
        return links

    def runs(self) -> list[dict[str, Any]]:
        """Runs and loops, the newest first."""
        paths = self.places.runs()
        found = []
        for entry in self.shelf.entries():
            row = dict(vars(entry), loop="", began=moment(entry.began_utc_s))
            path = paths.get(entry.name)
            if path is not None and is_loop(path) and not entry.problem:
                try:
                    program = open_program(path)
                    row["loop"] = f"loop of {len(program.runs)} run{'s' if len(program.runs) != 1 else ''}"
                    row["state"] = "closed" if program.closed is not None else "open"
                except RigError as error:
                    row["problem"] = str(error)
            found.append(row)
        return found

    def queue(self) -> dict[str, Any]:
        """The queue: its items, at work and waiting first."""
        _, now = self.places.queue()
        runs = {path.parent: name for name, path in reversed(self.places.runs().items())}
        file, rows = self.places.queue()[0], []
        ended = [one for one in reversed(now.items.values()) if one.ended is not None]
        for one in [*now.at_work, *now.waiting, *ended[:50]]:
            asked, links = one.asked, list[Link]()
            if one.state == "waiting":
                links = [
                    (act("move", item=one.number, priority=one.priority + 1), "First"),
                    (act("remove", item=one.number), "Remove"),
                ]
            waits = [*asked.needs, *([f"until {moment(asked.not_before_s)}"] if asked.not_before_s else [])]
            rows.append(
                {
                    "number": one.number,
                    "state": one.state,
                    "what": Path(asked.procedure).name,
                    "command": asked.command,
                    "dry": "--dry" in asked.options,
                    "bench": Path(asked.bench).name,
                    "priority": one.priority,
                    "who": asked.who or "",
                    "waits": ", ".join(waits) if one.state == "waiting" else "",
                    "held": one.state == "waiting" and one.bench in now.held,
                    "run": runs.get(file.folder_of(one.number), ""),
                    "acts": links,
                }
            )
        return {"paused": now.paused, "held": sorted(Path(one).name for one in now.held), "items": rows}

    def proposals(self) -> list[dict[str, Any]]:
        """Proposals, the newest first."""
        return [proposal_row(one) for one in reversed(self.log().proposals.values())]

    def for_person(self, login: str, roles: tuple[str, ...]) -> list[Link]:
        """What waits for a person: address and words."""
        found: list[Link] = []
        log = self.log()
        if self.problem:
            found.append(("/log", self.problem))
        if "operator" in roles:
            for bench in self.benches():
                for work in bench["work"]:
                    asked = asked_by_hand(read_json(live_path(self.places.run(work["name"]))) or {})
                    if asked is not None:
                        found.append((f"/run/{quote(work['name'], safe='')}", f"{bench['title']}: {asked.say}"))
                    elif work["word"] == "holding":
                        found.append(
                            (f"/run/{quote(work['name'], safe='')}", f"{bench['title']} holds: {work['what']}")
                        )
                if bench["held"]:
                    found.append(("/queue", f"{bench['title']}: item {bench['held']} of the queue holds it"))
        for one in log.proposals.values():
            if "approver" in roles and one.state == "waiting" and login_of(one.asked.who) != login:
                found.append((f"/proposal/{one.number}", f"Proposal {one.number} waits for an approver"))
            if "operator" in roles and one.state == "approved":
                found.append((f"/proposal/{one.number}", f"Proposal {one.number} is approved, and not started"))
        found += [("/equipment", words) for words in self._overdue()]
        return found

    def _overdue(self) -> list[str]:
        return [f"{row['what']} was due on {row['due']}" for row in self.equipment.rows() if row["tone"] == "bad"]

    def tells(self) -> dict[str, Callable[[], Any]]:
        """What programs may ask, by the names of `TELLS`."""
        tells: list[Callable[[], Any]] = [self.benches, self.queue, self.runs, self.proposals]
        tells.append(
            lambda: [
                {k: v for k, v in row.items() if k not in ("date", "tone", "page")} for row in self.equipment.rows()
            ]
        )
        return dict(zip(TELLS, [*tells, self.people], strict=True))

    def run(self, name: str) -> dict[str, Any] | None:
        """All contents of the page of a run; None if there is none of this name."""
        feed = self.shelf.feed(name)
        if feed is None:
            return None
        feed.refresh()
        return {**feed.view(), "story": feed.lines(0)}

    def people(self) -> list[dict[str, Any]]:
        """People and programs: who they are, what they may do, and how they log in."""
        return [
            {
                "login": login,
                "name": one.name,
                "roles": list(one.roles),
                "by": [what for what, there in (("password", one.password), ("token", one.token)) if there],
                "passkeys": list(one.passkeys),
                "disabled": one.disabled,
            }
            for login, one in self.laboratory.people().people.items()
        ]

    def settings(self) -> dict[str, list[dict[str, str]]]:
        """Settings files by folder."""
        found: dict[str, list[dict[str, str]]] = {}
        for name, path in self.places.settings().items():
            folder, _, title = name.rpartition("/")
            about = {"name": name, "title": title, "sort": self.places.sort_of_file(path), "when": changed(path)}
            found.setdefault(folder, []).append(about)
        return found

    def documents(self, folder: str, *forms: str) -> list[dict[str, str]]:
        """Files of a folder with these endings, the newest first."""
        found = []
        for name, path in self.places.documents().items():
            if name.startswith(folder) and path.suffix[1:] in forms:
                found.append({"name": name, "title": path.name, "when": changed(path)})
        return found


def proposal_row(one: Proposal) -> dict[str, Any]:
    """A proposal for pages and API, without the texts of its files."""
    documents = one.asked.documents
    two_keys = parse_toml(documents.get("bench.toml", ""), "bench.toml").get("approval") is True
    return {**one.to_json(), "when": moment(one.asked_utc_s), "two_keys": two_keys}


def act(name: str, **values: object) -> str:
    """Address of the page of an act, with some of its values."""
    return f"/act/{name}?{urlencode(values)}"


def changed(path: Path) -> str:
    """When a file was changed, for people; "" if it is gone."""
    try:
        return moment(path.stat().st_mtime)
    except OSError:
        return ""
