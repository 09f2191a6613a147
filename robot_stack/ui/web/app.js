// Frame of all pages: what is always on screen, and which page is shown.

import { html, render, useEffect, useLayoutEffect, useState } from "/vendor/preact-htm.js";
import { LANGUAGES, known, languageNow, loadTexts, setLanguage, suggestLanguage, t } from "/i18n.js";
import { addFonts } from "/fonts.js";
import { Link } from "/link.js";
import { RiderPage } from "/pages/rider.js";
import { PinDialog, StaffPages } from "/pages/staff.js";
import { applySettings } from "/pages/settings.js";

// A rider's choice is also for the external display; staff change their own page only.
function chooseLanguage(code, link, page) {
  setLanguage(code);
  if (page === "rider") link.send({ t: "language", code });
}

function TopBar({ link, state, page, setPage, change }) {
  const percent = state.battery?.percent;
  return html`<header>
    <h1>${t("app.title")}</h1>
    <span class=${`battery ${percent !== null && percent < 30 ? "low" : ""}`}>
      ${percent === null || percent === undefined ? t("app.battery_unknown") : t("app.battery", { percent })}
    </span>
    <div class="languages" role="group" aria-label=${t("app.language")}>
      ${LANGUAGES.map(([code, name]) => html`
        <button lang=${code === "zh" ? "zh-Hans" : code} aria-pressed=${languageNow() === code}
          onClick=${() => { chooseLanguage(code, link, page); change(); }}>${name}</button>`)}
    </div>
    <button class="plain" id="to-staff" onClick=${() => setPage(page === "rider" ? "staff" : "rider")}>
      ${page === "rider" ? t("app.staff") : t("app.to_rider")}
    </button>
  </header>`;
}

function SideBar({ link, state, say }) {
  const called = state.staff?.called;
  const contact = state.site?.staff_contact;
  const call = async () => say(await link.ask({ t: "call", on: true }));
  return html`<aside>
    <button class="call" id="call" disabled=${called || link.lost} onClick=${call}>
      ${called ? t("app.called") : t("app.call")}
    </button>
    ${contact && html`<p class="contact">${t("app.call_by_phone", { number: contact })}</p>`}
    <button class="stop" id="stop" aria-label=${t("app.stop_long")} onPointerDown=${() => link.stop()}
      onClick=${(event) => event.detail === 0 && link.stop()}>
      <span>${t("app.stop")}</span>
    </button>
    <p class="stop-note" role="status">${link.stopWaits ? t("app.stop_sent") : t("app.stop_long")}</p>
  </aside>`;
}

function Lost({ link }) {
  return html`<section class="lost" role="alert">
    <h2>${link.connectedOnce ? t("lost.title") : t("app.loading")}</h2>
    ${link.connectedOnce && html`<p>${t("lost.text")}</p>`}
    ${link.stopWaits && html`<p><strong>${t("lost.stop_waits")}</strong></p>`}
  </section>`;
}

function useToast() {
  const [toast, setToast] = useState(null);
  useEffect(() => {
    if (!toast) return undefined;
    const timer = setTimeout(() => setToast(null), 5000);
    return () => clearTimeout(timer);
  }, [toast]);
  const say = (answer) => {
    const text = answer.ok ? t("answer.done") : known(answer.why) ? t(answer.why) : answer.why;
    setToast({ ok: answer.ok, text, detail: answer.detail });
    return answer;
  };
  return [toast, say];
}

function App({ link, listen }) {
  const [, setTurn] = useState(0);
  const change = () => setTurn((turn) => turn + 1);
  const [page, setPage] = useState("rider");
  const [toast, say] = useToast();
  // What came between the first drawing and here has been missed.
  useLayoutEffect(() => { listen(change); change(); }, []);
  const state = link.state;
  const staff = state.access?.role === "staff";
  const leave = () => { setPage("rider"); link.show([]); };
  const choose = (next) => (next === "rider" ? leave() : setPage(next));
  return html`<div class="frame">
    <${TopBar} link=${link} state=${state} page=${page} setPage=${choose} change=${change} />
    <main class=${link.lost ? "behind" : ""} inert=${link.lost}>
      ${page === "rider" || (link.lost && !staff)
        ? html`<${RiderPage} link=${link} state=${state} say=${say} />`
        : staff
          ? html`<${StaffPages} link=${link} state=${state} say=${say} change=${change} />`
          : html`<${PinDialog} link=${link} state=${state} onCancel=${leave} />`}
    </main>
    ${link.lost && html`<${Lost} link=${link} />`}
    <${SideBar} link=${link} state=${state} say=${say} />
    <div class="toasts" role="status" aria-live="polite">
      ${toast && html`<p class=${toast.ok ? "toast" : "toast bad"}>
        ${toast.text}${toast.detail && html`<small lang="en">${toast.detail}</small>`}
      </p>`}
    </div>
  </div>`;
}

async function main() {
  await loadTexts();
  applySettings();
  let changed = () => {};
  const link = new Link(() => {
    if (link.state?.site) suggestLanguage(link.state.site.language);
    changed();
  });
  window.touchUi = { link };
  render(html`<${App} link=${link} listen=${(listener) => { changed = listener; }} />`, document.getElementById("app"));
  addFonts();
}

main();
