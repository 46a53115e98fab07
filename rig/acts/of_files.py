"""Acts on settings files: the first files of a bench by questions, and changes of a file, each written into the log."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import Field, field_validator
from rich.text import Text

from rig.acts.act import KEPT, LINES, Act, Told
from rig.acts.places import CERTIFICATE, FOLDERS, Places
from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench, parse_procedure, parse_toml, read_text, validated
from rig.bench.contract_files import files_beside, with_files
from rig.bench.plugins import driver_class, is_file
from rig.errors import UsageError
from rig.files.atomic import write_whole
from rig.lab import without_secrets
from rig.procedures.present.blocks import Block, Grid
from rig.procedures.present.shell import shell_word
from rig.register import parse_register
from rig.who import Operator

FOLDER = r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}"
_TWO_KEYS = "approval = true"


class New(Act, act="new", slow=True, brief=True):
    """Write bench, procedure, register and certificate settings of a new bench, by the answers to questions."""

    folder: str = Field(description="folder of the files, new in the laboratory: letters, digits, - and _")
    answers: dict[str, Any] = Field(
        {}, description="answers by the keys of the questions, as in answers.toml; assumed where left out"
    )
    show: bool = Field(False, description="plan and show the files, write nothing")
    sha256: str = Field("", max_length=64, description="of the files as they were shown; other ones are not written")

    @field_validator("answers", mode="before")
    @classmethod
    def _from_text(cls, given: object) -> object:
        try:
            return json.loads(given) if isinstance(given, str) else given
        except (ValueError, RecursionError):
            raise ValueError('should be a JSON object, such as {"quantity": "force"}') from None

    def will(self, places: Places) -> str:
        """Where. Raises `UsageError` if the folder has a meaning, or is there."""
        return f"{self._checked_folder(places).name} gets its first files."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Plan the files, and write them, or show them."""
        from rig.new.files import texts, write  # noqa: PLC0415 - loads all drivers
        from rig.new.planned import before_run, planned  # noqa: PLC0415
        from rig.new.questions import completed  # noqa: PLC0415

        folder = self._checked_folder(places)
        given = {key: value for key, value in self.answers.items() if value is not None}
        answers = completed(located(given, places), "answers")
        files = texts(answers)
        if needs_two_keys(places):
            files["bench.toml"] = f"{_TWO_KEYS}\n{files['bench.toml']}"
        digest = hashlib.sha256(json.dumps(files).encode()).hexdigest()
        plan, blocks = planned(files, lambda _: None)
        about = {"files": files, "plan": [*map(plain, blocks)], "notes": list(plan.notes()), "sha256": digest}
        if self.show:
            return Told("nothing was written", about)
        if self.sha256 and self.sha256 != digest:
            raise UsageError("these are not the files that were shown; look at them again")
        with places.laboratory.changing(f"rig new {shell_word(self.folder)}", by):
            write(folder, files)
        said = f"{', '.join(files)} are written into {self.folder}"
        return Told("; ".join([said, *before_run(answers)]), {"folder": self.folder, "sha256": digest})

    def _checked_folder(self, places: Places) -> Path:
        if not re.fullmatch(FOLDER, self.folder) or self.folder in FOLDERS:
            raise UsageError(f"{self.folder!r:.80} is no name for a folder of a bench: letters, digits, - and _")
        folder = places.folder / self.folder
        if folder.exists() or folder.is_symlink():
            raise UsageError(f"{self.folder} is there already, and nothing is overwritten; name another folder")
        return folder


class Ports(Act, act="ports", slow=True, brief=True):
    """List serial ports, or ask at an address who is there; nothing else is sent."""

    address: str = Field("", max_length=200, description="address; empty: list the ports")

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Ask only for identities."""
        from rig.new.wires import who_is_there  # noqa: PLC0415 - few acts need it

        found = who_is_there(self.address)
        return Told("\n".join(found), {"found": found})


class Edit(Act, act="edit"):
    """Change a settings file: bench, procedure, register, certificate settings; a wrong one is refused."""

    file: str = Field(description="settings file", json_schema_extra={"of": "settings"})
    text: str = Field(max_length=60_000, description="its new text", json_schema_extra={LINES: True})
    before: str = Field(
        max_length=64, description="SHA-256 of the file that the text is for", json_schema_extra={KEPT: True}
    )

    @classmethod
    def proposed_values(cls, given: Mapping[str, str], places: Places) -> Mapping[str, str]:
        """The present text, and its hash."""
        path = places.settings().get(given.get("file", ""))
        if path is None or "text" in given:
            return {}
        text = read_text(path, "settings")
        return {"before": _hash(text)} if without_secrets(text) != text else {"text": text, "before": _hash(text)}

    def will(self, places: Places) -> str:
        """Which file. Raises `UsageError` if there is no such one."""
        return f"{places.setting(self.file).name} is changed."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Check the text, and write it."""
        path = places.setting(self.file)
        text = self.text.replace("\r\n", "\n").rstrip("\n") + "\n"
        with places.laboratory.changing(f"rig act edit file={shell_word(self.file)}", by):
            now = read_text(path, "settings")
            if without_secrets(now) != now:
                raise UsageError(f"{self.file} may have secrets, and is not changed here")
            if _hash(now) != self.before:
                raise UsageError(f"somebody changed {self.file} meanwhile; look at it again")
            check_text(places, self.file, text)
            write_whole(path, lambda file: file.write(text))
        return Told(f"{self.file} is changed", {"file": self.file, "sha256": _hash(text)}, "files")


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def located(answers: Mapping[str, Any], places: Places) -> dict[str, Any]:
    """Answers with own instrument files, named by their path in the laboratory, found. Raises `UsageError`."""
    known, found = places.instruments(), dict(answers)
    for key, value in answers.items():
        if isinstance(value, str) and is_file(value):
            if value not in known:
                raise UsageError(
                    f"there is no file of an instrument {value!r:.80} (known: {', '.join(known) or 'none'})"
                )
            found[key] = str(known[value])
        else:
            _inside(value)
    return found


def needs_two_keys(places: Places) -> bool:
    """Whether a bench of the laboratory needs two keys: every file that a page writes then needs them, too.

    A second file for the same instruments would be a way around them.
    """
    return any(parse_toml(read_text(path, "bench"), name).get("approval") for name, path in places.benches().items())


def check_text(places: Places, name: str, text: str) -> None:
    """Check the new text of a settings file: its sort stays, its values are right, no path leaves the laboratory.

    Raises:
        ConfigurationError: it is wrong; the message has the line.
        UsageError: it may not say that.
    """
    values = parse_toml(text, name)
    _inside(values)
    sort = places.sort_of(values)
    if sort != places.sort_of(parse_toml(read_text(places.setting(name), "settings"), name)):
        raise UsageError(f"{name} would be a file of another sort")
    if sort == "bench":
        config = parse_bench(text, name)
        check_options(with_files(config, files_beside(config, places.setting(name)), name), name)
        if not config.approval and needs_two_keys(places):
            raise UsageError(f"{name}: a bench of this laboratory needs two keys, so it says {_TWO_KEYS}")
    elif sort == "procedure":
        parse_procedure(text, name)
    elif sort == "register":
        parse_register(text, name)
    elif sort == "instrument":
        driver_class(text)
    elif Path(name).name == CERTIFICATE:
        from rig.verbs.certificate.settings import CertificateSettings  # noqa: PLC0415 - few acts need it

        validated(CertificateSettings, values, name)


def _inside(value: Any) -> None:
    """Refuse a path that leaves the laboratory. Raises `UsageError`."""
    for text in _texts(value):
        parts = re.split(r"[/\\]", text)
        # a command such as "/1ZR" begins like a path, and is none: there is no such folder
        absolute = text.startswith("/") and parts[1] != "dev" and Path("/", parts[1][:100]).exists()
        if absolute or text.startswith("~") or ".." in parts:
            raise UsageError(f"{text!r:.80} leads out of the laboratory's folder; name a file beside this one")


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for one in value.values():
            yield from _texts(one)
    elif isinstance(value, list):
        for one in value:
            yield from _texts(one)


def plain(block: Block) -> dict[str, Any]:
    """A block of output as plain values."""
    if isinstance(block, Grid):
        rows = [[_plain(cell) for cell in row] for row in block.rows]
        return {"title": _plain(block.title), "columns": [_plain(one) for one in block.columns], "rows": rows}
    return {"line": _plain(block.text)}


def _plain(markup: str) -> str:
    return Text.from_markup(markup).plain.strip()
