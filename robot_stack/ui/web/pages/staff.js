// Behind the PIN: the pages of those who look after the robot.

import { html, useEffect, useState } from "/vendor/preact-htm.js";
import { known, t } from "/i18n.js";
import { DisplayPage } from "/pages/display.js";
import { DockingPage } from "/pages/docking.js";
import { DrivePage } from "/pages/drive.js";
import { MapPage } from "/pages/map.js";
import { MissionsPage } from "/pages/missions.js";
import { SelfTestDue, SelfTestPage } from "/pages/self_test.js";
import { SettingsPage } from "/pages/settings.js";
import { DiagnosticsPage, EventsPage, FaultsPage, HistoryPage, RecordingsPage } from "/pages/tables.js";

const PAGES = {
  map: MapPage,
  drive: DrivePage,
  docking: DockingPage,
  display: DisplayPage,
  faults: FaultsPage,
  self_test: SelfTestPage,
  diagnostics: DiagnosticsPage,
  missions: MissionsPage,
  history: HistoryPage,
  recordings: RecordingsPage,
  events: EventsPage,
  settings: SettingsPage,
};

export function PinDialog({ link, state, onCancel }) {
  const [pin, setPin] = useState("");
  const [wrong, setWrong] = useState("");
  const access = state.access ?? {};
  const enter = async () => {
    const answer = await link.ask({ t: "login", pin });
    setPin("");
    setWrong(answer.ok ? "" : answer.why);
  };
  const press = (digit) => pin.length < 12 && setPin(pin + digit);
  const hint = access.pin_set === false ? "answer.no_pin" : wrong || "pin.hint";
  return html`<section class="page pin" data-page="pin" aria-label=${t("pin.title")}>
    <h2>${t("pin.title")}</h2>
    <p role="status">${known(hint) ? t(hint) : hint}</p>
    <p class="dots" aria-hidden="true">${"●".repeat(pin.length) || "–"}</p>
    <div class="keys">
      ${[1, 2, 3, 4, 5, 6, 7, 8, 9].map((digit) => html`<button data-key=${digit} onClick=${() => press(digit)}>${digit}</button>`)}
      <button onClick=${() => setPin(pin.slice(0, -1))}>${t("pin.delete")}</button>
      <button data-key="0" onClick=${() => press(0)}>0</button>
      <button class="primary" id="unlock" disabled=${pin.length < 4} onClick=${enter}>${t("pin.enter")}</button>
    </div>
    <button class="plain" onClick=${onCancel}>${t("app.cancel")}</button>
  </section>`;
}

function Door({ link, name, say }) {
  const confirm = async () => say(await link.ask({ t: "confirm_door", name }));
  return html`<div class="fault WARN" data-door=${name}><p class="large">${t("door.waits", { name })}</p>
    <button class="primary" id="door-open" onClick=${confirm}>${t("door.open", { name })}</button></div>`;
}

export function StaffPages({ link, state, say, change }) {
  const [page, setPage] = useState("map");
  useEffect(() => () => link.show([]), []);
  useEffect(() => document.querySelector("nav [aria-current]").scrollIntoView({ inline: "nearest", block: "nearest" }), [page]);
  const Page = PAGES[page];
  const faults = (state.safety?.faults ?? []).length + (state.staff?.called ? 1 : 0);
  return html`<div class="staff">
    <nav aria-label=${t("nav.label")}>
      ${Object.keys(PAGES).map((name) => html`
        <button data-nav=${name} aria-current=${page === name ? "page" : null} onClick=${() => setPage(name)}>
          ${t(`nav.${name}`)}${name === "faults" && faults ? html` <b class="count">${faults}</b>` : null}
        </button>`)}
      <button class="plain" id="lock" onClick=${() => link.ask({ t: "logout" })}>${t("pin.lock")}</button>
    </nav>
    <div class="staff-page">
      ${page !== "self_test" && html`<${SelfTestDue} age=${state.self_test_age} open=${() => setPage("self_test")} />`}
      ${state.door?.name && html`<${Door} link=${link} name=${state.door.name} say=${say} />`}
      <${Page} key=${page} link=${link} state=${state} say=${say} change=${change} />
    </div>
  </div>`;
}
