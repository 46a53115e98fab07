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
  form.addEventListener("submit", () => {
    const button = form.querySelector("button.go");
    if (button) setTimeout(() => { button.disabled = true; button.textContent = "Working \u2026"; }, 0);
  });
}
