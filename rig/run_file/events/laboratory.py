"""Events of a laboratory, the records of its `log.sqlite`, which has the form of a run file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.run_file.bodies import Text, Texts
from rig.run_file.events.event import DECISION, Event

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


@dataclass(frozen=True, kw_only=True)
class FileChanged(Event, kind="laboratory", status="changed", matters=DECISION):
    """A file of the laboratory changed: of people, of equipment, of settings.

    Attributes:
        file: its path in the laboratory.
        before: SHA-256 of what it was, "" if there was none.
        after: SHA-256 of what it is, "" if it is gone.
        text: what it is, without passwords; "" if it is gone or long.
        why: the command that changed it; "" if the change was only found, and `who` found it.
        who: name of the person.
        who_by: source of the name.
    """

    file: Text
    before: Text
    after: Text
    text: Text
    why: Text
    who: Text
    who_by: Text

    def sentence(self, record: Columns) -> str:
        """What happened to the file, by whom."""
        did = "came" if not self.before else "changed" if self.after else "was removed"
        how = f"by {self.who}: {self.why}" if self.why else f"by an editor, found by {self.who}"
        return f"{self.file} {did}, {how}"


@dataclass(frozen=True, kw_only=True)
class CertificateSigned(Event, kind="laboratory", status="signed", matters=DECISION):
    """A person gave the password again, and a certificate was issued.

    Attributes:
        number: of the certificate.
        files: SHA-256 by file name.
        who: name of the person.
        who_by: source of the name.
    """

    number: Text
    files: Texts
    who: Text
    who_by: Text

    def sentence(self, record: Columns) -> str:
        """Which, by whom."""
        return f"certificate {self.number} was issued and signed by {self.who}"
