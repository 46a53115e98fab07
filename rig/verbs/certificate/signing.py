"""Certificates of a laboratory with people: an approver, whose password was right, issues them."""

from __future__ import annotations

from dataclasses import replace

from rig.errors import UsageError
from rig.lab import Laboratory
from rig.run_file.events.laboratory import CertificateSigned
from rig.verbs.certificate.issue import Issue, Issued, issue
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import make
from rig.verbs.certificate.seals import hash_of
from rig.who import Operator


def issue_signed(laboratory: Laboratory, by: Operator, asked: CertificateRequest, how: Issue) -> Issued:
    """Issue a certificate that this person approves, and write that into the log.

    Args:
        laboratory: has the log.
        by: the approver; "Name (login)".
        asked: contents of the certificate.
        how: how it is issued.

    Raises:
        UsageError: another name was to approve it; others as of `issue`.
    """
    name = by.name.rpartition(" (")[0]
    if asked.approved_by not in ("", name):
        raise UsageError(f"--approved-by {asked.approved_by}: {name} signs it, and approves it by that")
    made = issue(make(replace(asked, approved_by=name)), how)
    files = {path.name: hash_of(path) for path in made.files}
    number = made.document.number
    laboratory.append(lambda _: [CertificateSigned(number=number, files=files, who=by.name, who_by=by.by)])
    return made
