"""Events of a laboratory, the records of its `log.sqlite`, which has the form of a run file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.run_file.bodies import Count, Table, Text, Texts
from rig.run_file.events.event import DECISION, Event, Status

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


@dataclass(frozen=True, kw_only=True)
class Proposed(Event, kind="laboratory", status="proposed", matters=DECISION):
    """A run is proposed, after its dry run.

    Attributes:
        number: ordinal of the proposal, from 1.
        procedure: path of its file.
        bench: likewise.
        documents: texts of everything that decides the run, by name of the document.
        run_list: hash of its run list.
        dry: what its dry run came to: `outcome`, `hours`, `points`, `extremes`, `left_on`, `warnings`, `head`, `world`.
        why: reason, "" without one.
        who: name of the person or program.
        who_by: source of the name.
    """

    number: Count
    procedure: Text
    bench: Text
    documents: Texts
    run_list: Text
    dry: Table
    why: Text = ""
    who: Text
    who_by: Text

    def sentence(self, record: Columns) -> str:
        """The files, and who proposed them."""
        why = f": {self.why}" if self.why else ""
        return f"proposal {self.number} by {self.who}: {self.procedure} on {self.bench}{why}"


@dataclass(frozen=True, kw_only=True)
class Decided(Event, kind="laboratory", matters=DECISION):
    """Somebody else, whose password was right, approved or declined a proposal.

    Attributes:
        decision: "approved" or "declined".
        number: of the proposal.
        digests: SHA-256 of its documents, by name.
        run_list: hash of its run list.
        why: reason, "" without one.
        who: name of the person.
        who_by: source of the name.
    """

    decision: Status
    number: Count
    digests: Texts
    run_list: Text
    why: Text = ""
    who: Text
    who_by: Text

    def sentence(self, record: Columns) -> str:
        """The decision, and by whom."""
        return f"proposal {self.number} {self.decision} by {self.who}{f': {self.why}' if self.why else ''}"


@dataclass(frozen=True, kw_only=True)
class ApprovalUsed(
    Event, kind="laboratory", status="used", matters=DECISION, says="the approval of proposal {number} is used by {run}"
):
    """A run is about to begin with an approval, which holds for no other run.

    Attributes:
        number: of the proposal.
        run: id of the run.
        who: operator of the run.
    """

    number: Count
    run: Text
    who: Text
