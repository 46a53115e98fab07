"""Acts on people: an administrator adds, changes, disables; everybody changes the own password and passkeys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import Field, SecretStr

from rig.acts.act import SECRET, Act, Told
from rig.acts.places import Places
from rig.errors import UsageError
from rig.lab.people import ROLES, Passkey, as_roles, check_login, hashed, new_password, new_token
from rig.procedures.present.shell import shell_word
from rig.who import Operator, login_of

PERSON = Field(description="login of the person", json_schema_extra={"of": "people"})
ROLE_LIST = Field(max_length=100, description="one or more, with commas: " + ", ".join(ROLES))
PASSKEY = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,39}$", description="name of the passkey, such as phone")
_PAGE = "people"


def _change(places: Places, by: Operator, act: Act, login: str, change: Callable[[dict[str, Any]], object]) -> None:
    """Change the entry of a person, and log it. Raises `UsageError` if there is none."""

    def of_people(people: dict[str, Any]) -> None:
        if login not in people:
            raise UsageError(f"there is nobody with the login {login!r:.40}")
        change(people[login])

    places.laboratory.change_people(of_people, f"rig act {shell_word(act.name)} login={shell_word(login)}", by)


class AddPerson(Act, act="add-person", role="administrator", again=True):
    """Add a person with a first password, or a program with a token; either is shown once."""

    login: str = Field(max_length=32, description="login, such as anna")
    full_name: str = Field(min_length=1, max_length=80, description="name, for people and run files")
    roles: str = ROLE_LIST
    program: bool = Field(False, description="yes: a program, with a token and no password")

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        login = check_login(self.login)
        secret, kept = _first(program=self.program)

        def add(people: dict[str, Any]) -> None:
            if login in people:
                raise UsageError(f"{login} is there already")
            people[login] = {"name": self.full_name, "roles": as_roles(self.roles), **kept}

        places.laboratory.change_people(add, f"rig act {shell_word(self.name)} login={shell_word(login)}", by)
        return _told(f"{self.full_name} ({login}) was added", secret, program=self.program)


class ChangeRoles(Act, act="change-roles", role="administrator", again=True):
    """Give a person other roles."""

    login: str = PERSON
    roles: str = ROLE_LIST

    @classmethod
    def proposed_values(cls, given: Mapping[str, str], places: Places) -> Mapping[str, str]:
        """The present roles."""
        person = places.laboratory.people().people.get(given.get("login", ""))
        return {} if person is None else {"roles": ", ".join(person.roles)}

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        roles = as_roles(self.roles)
        _change(places, by, self, self.login, lambda person: person.update(roles=roles))
        return Told(f"{self.login} is {', '.join(roles)}", page=_PAGE)


class Disable(Act, act="disable-person", role="administrator", again=True):
    """Let a person or program log in no more; sessions end at once, and the log keeps what was done."""

    login: str = PERSON

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        _change(places, by, self, self.login, lambda person: person.update(disabled=True))
        return Told(f"{self.login} may log in no more", page=_PAGE)


class Enable(Act, act="enable-person", role="administrator", again=True):
    """Let a disabled person or program log in again."""

    login: str = PERSON

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        _change(places, by, self, self.login, lambda person: person.pop("disabled", None))
        return Told(f"{self.login} may log in again", page=_PAGE)


class ResetPassword(Act, act="new-password", role="administrator", again=True):
    """Give a person a new first password, which is shown once."""

    login: str = PERSON

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        secret, kept = _first(program=False)
        _change(places, by, self, self.login, lambda person: person.update(kept))
        return _told(f"{self.login} has a new password", secret, program=False)


class IssueToken(Act, act="new-token", role="administrator", again=True):
    """Give a program a new token, which is shown once; the one before is worth nothing more."""

    login: str = PERSON

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        secret, kept = _first(program=True)
        _change(places, by, self, self.login, lambda person: person.update(kept))
        return _told(f"{self.login} has a new token", secret, program=True)


class RevokeToken(Act, act="revoke-token", role="administrator", again=True):
    """Take a program's token away."""

    login: str = PERSON

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        _change(places, by, self, self.login, lambda person: person.pop("token", None))
        return Told(f"{self.login} has no token", page=_PAGE)


class OwnPassword(Act, act="change-password", role="", again=True):
    """Change the own password; other sessions of yours end."""

    new_password: SecretStr = Field(
        description="the new password, 10 characters or more", json_schema_extra={SECRET: 1}
    )

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        new = hashed(self.new_password.get_secret_value())
        _change(places, by, self, login_of(by.name), lambda person: person.update(password=new))
        return Told("your password is changed", page=_PAGE)


class AddPasskey(Act, act="add-passkey", role="", again=True):
    """Add a passkey of yours, a second way to log in."""

    label: str = PASSKEY
    credential: str = Field(pattern=r"^[A-Za-z0-9_-]{1,1500}$", description="id of the credential, base64url")
    public_key: str = Field(pattern=r"^[A-Za-z0-9_-]{1,3000}$", description="its public key, COSE as base64url")

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""
        passkey = Passkey(id=self.credential, key=self.public_key).model_dump()

        def add(person: dict[str, Any]) -> None:
            if self.label in person.setdefault("passkeys", {}):
                raise UsageError(f"you have a passkey {self.label} already; choose another name")
            person["passkeys"][self.label] = passkey

        _change(places, by, self, login_of(by.name), add)
        return Told(f"the passkey {self.label} was added", page=_PAGE)


class RemovePasskey(Act, act="remove-passkey", role="", again=True):
    """Remove a passkey of yours."""

    label: str = PASSKEY

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it."""

        def remove(person: dict[str, Any]) -> None:
            if person.get("passkeys", {}).pop(self.label, None) is None:
                raise UsageError(f"you have no passkey {self.label}")

        _change(places, by, self, login_of(by.name), remove)
        return Told(f"the passkey {self.label} was removed", page=_PAGE)


def _first(*, program: bool) -> tuple[str, dict[str, str]]:
    """A new secret, and what the file has of it."""
    if program:
        token, digest = new_token()
        return token, {"token": digest}
    password = new_password()
    return password, {"password": hashed(password)}


def _told(words: str, secret: str, *, program: bool) -> Told:
    what = "token" if program else "first password"
    return Told(f"{words}; the {what}, shown this once: {secret}", {what.rpartition(" ")[2]: secret}, _PAGE)
