// Passkeys: a form is sent once the browser has its answer; without passkeys in the browser the form stays hidden.
const able = window.PublicKeyCredential?.parseRequestOptionsFromJSON && window.isSecureContext;

const ready = (form, asks, field, make) => {
  if (!form || !able) return;
  form.hidden = false;
  const said = form.querySelector("#passkey-said");
  const button = form.querySelector("button.go");
  const words = button.textContent;
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    button.disabled = true;
    said.textContent = "";
    try {
      const csrf = form.elements.csrf?.value ?? "";
      const body = new URLSearchParams({ csrf });
      const answer = await fetch(asks, { method: "POST", body });
      if (!answer.ok) throw new Error((await answer.text()).match(/role="alert">([^<]*)/)?.[1] ?? `status ${answer.status}`);
      form.elements[field].value = JSON.stringify((await make(await answer.json())).toJSON());
      form.submit();
    } catch (error) {
      said.textContent = error.name === "NotAllowedError" ? "The browser asked, and nobody answered." : `It did not work: ${error.message}`;
      button.disabled = false;
      button.textContent = words;
    }
  });
};

ready(document.getElementById("new-passkey"), "/passkey", "passkey", (asked) =>
  navigator.credentials.create({ publicKey: PublicKeyCredential.parseCreationOptionsFromJSON(asked) }));
ready(document.getElementById("by-passkey"), "/login/challenge", "credential", (asked) =>
  navigator.credentials.get({ publicKey: PublicKeyCredential.parseRequestOptionsFromJSON(asked) }));
