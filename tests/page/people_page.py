"""People of a laboratory in a real Chromium, with a device for passkeys that its DevTools make: `make test-page`.

An administrator adds a person, who logs in, changes the password, adds a passkey, and logs in with that alone. Pictures
of all pages are left in the folder that PAGE_PICTURES names.
"""

from __future__ import annotations

import re
from pathlib import Path

from chromium import chromium
from lab_people import WORD, with_people
from serve_page import Visitor, served

from rig.lab import Laboratory


def test_a_person_is_added_and_logs_in_with_a_passkey(tmp_path: Path) -> None:
    lab = with_people(tmp_path / "laboratory")
    with served(lab) as address, chromium(tmp_path / "profile") as page:
        page.call("WebAuthn.enable")
        device = {"protocol": "ctap2", "transport": "internal", "hasResidentKey": True, "hasUserVerification": True}
        more = {"isUserVerified": True, "automaticPresenceSimulation": True}
        page.call("WebAuthn.addVirtualAuthenticator", options={**device, **more})
        page.size(1400, 900)
        olga = carl = Visitor(page, address.replace("127.0.0.1", "localhost"))
        olga.logs_in("olga")
        olga.goes("/people")
        olga.looks("people")
        olga.clicks("a[href='/act/add-person']")
        olga.looks("act-add-person")
        olga.fills(login="carl", full_name="Carl <b>Grün</b>", roles="operator", password=WORD["olga"])
        olga.clicks("main button.go")
        first = re.findall(r"shown this once: (\S+)", olga.text)[0]
        olga.looks("person-added")
        olga.clicks("header .who button")
        # --- the person: own password, and a passkey
        carl.fills(login="carl", password=first)
        carl.clicks("main button.go")
        carl.goes("/act/change-password")
        carl.fills(new_password="a better one", password=first)
        carl.clicks("main button.go")
        assert "your password is changed" in carl.text
        carl.goes("/people")
        assert "Olga" not in carl.text
        page.until("!document.getElementById('new-passkey').hidden")
        carl.fills(label="blue key")
        page.ask("document.getElementById('again').value = 'a better one'")
        carl.clicks("#new-passkey button.go")
        assert "was added" in carl.text, carl.text
        carl.goes("/people")
        carl.looks("people-own")
        carl.clicks("header .who button")
        page.until("!document.getElementById('by-passkey').hidden")
        carl.looks("login")
        carl.clicks("#by-passkey button.go")
        assert page.ask("document.querySelector('h1').innerText") == "Benches"
        carl.goes("/people")
        assert "logged in by passkey" in carl.text
        # --- a device without this passkey does not log in
        carl.clicks("header .who button")
        page.call("WebAuthn.disable")
        page.call("WebAuthn.enable")
        page.call("WebAuthn.addVirtualAuthenticator", options={**device, **more})
        page.until("!document.getElementById('by-passkey').hidden")
        page.ask("document.querySelector('#by-passkey button.go').click()")
        page.until("document.getElementById('passkey-said').textContent !== ''")
        assert "nobody answered" in carl.text
        assert page.complaints == []
    said = [one.sentence() for one in Laboratory(lab).log().records]
    assert "people.toml changed, by Carl <b>Grün</b> (carl): rig act add-passkey login=carl" in said
