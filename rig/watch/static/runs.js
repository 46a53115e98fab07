// The list of runs, made again every 15 s: whoever reads it keeps place and focus, which a page loaded anew would take.
"use strict";

async function again() {
  const page = await (await fetch(location.href)).text();
  const old = document.querySelector("main");
  const at = document.activeElement?.getAttribute("href");
  old.replaceWith(new DOMParser().parseFromString(page, "text/html").querySelector("main"));
  if (at) document.querySelector(`main a[href="${CSS.escape(at)}"]`)?.focus();
}

setInterval(() => { if (!document.hidden) again().catch(() => {}); }, 15000);
