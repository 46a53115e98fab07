// The first page renews itself; forms are sent once. The server escapes what it sends.
const live = document.getElementById("live");
const lost = document.getElementById("lost");

if (live) {
  let heard = Date.now();
  const source = new EventSource("/events");
  const show = (words) => {
    lost.hidden = words === "";
    if (lost.textContent !== words) lost.textContent = words;
    live.classList.toggle("old", words !== "");
  };
  source.addEventListener("live", (event) => {
    heard = Date.now();
    show("");
    const at = document.activeElement?.getAttribute?.("href");
    const inside = live.contains(document.activeElement);
    live.innerHTML = JSON.parse(event.data).html;
    if (inside && at) live.querySelector(`a[href="${CSS.escape(at)}"]`)?.focus();
  });
  source.addEventListener("beat", () => { heard = Date.now(); show(""); });
  source.addEventListener("over", () => { source.close(); location.assign("/login"); });
  setInterval(() => { if (Date.now() - heard > 12000) show("This page has lost its server, and shows what it last knew."); }, 1000);
}

for (const form of document.querySelectorAll("form")) {
  form.addEventListener("submit", (event) => {
    const button = event.submitter?.classList.contains("go") ? event.submitter : form.querySelector("button.go");
    if (button) setTimeout(() => { button.disabled = true; button.textContent = "Working \u2026"; }, 0);
  });
}

// A form with a live plan: after each answer the server says what it asks next, and then what the plan is.
const asking = document.querySelector("form[data-live]");
if (asking) {
  let newest = 0;
  const part = async (name, number) => {
    const body = new URLSearchParams(new FormData(asking));
    body.set("part", name);
    const before = Object.fromEntries(body);
    const answer = await fetch(asking.action, { method: "POST", body }).catch(() => null);
    if (number !== newest || !answer?.headers.get("content-type")?.startsWith("text/html")) return;
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    const id = name === "plan" ? "plan" : "questions";
    const come = page.getElementById(id);
    if (!come || number !== newest) return;
    const at = document.activeElement?.id;
    const typed = document.activeElement?.name && document.activeElement.value !== before[document.activeElement.name]
      ? document.activeElement.value : null;
    document.getElementById(id).replaceWith(come);
    const again = at && document.getElementById(at);
    if (again && again !== document.activeElement) {
      if (typed !== null) again.value = typed;
      again.focus({ preventScroll: true });
    }
  };
  const renew = async () => {
    const number = ++newest;
    document.getElementById("plan").classList.add("old");
    await part("questions", number);
    if (number === newest) await part("plan", number);
  };
  asking.addEventListener("change", renew);
}
