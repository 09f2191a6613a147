// The fleet page: map, list of robots, cancelling of an order.

import { html, render, useLayoutEffect, useState } from "/vendor/preact-htm.js";
import { LANGUAGES, known, languageNow, loadTexts, setLanguage, suggestLanguage, t } from "/i18n.js";
import { addFonts } from "/fonts.js";
import { Link } from "/link.js";
import { FleetMap } from "/fleet_map.js";

const KINDS = {
  online: "good", driving: "good", working: "good", idle: "good", charging: "good",
  obstacle: "warn", paused: "warn", stale: "warn", no_state: "warn",
  emergency: "bad", fault: "bad", lost: "bad", offline: "off", unknown: "off",
};
const kindOf = (robot) => KINDS[robot.condition] ?? "off";

// A known value in words; another one as the robot sent it.
function words(family, value) {
  const key = `${family}.${value}`;
  return known(key) ? t(key) : html`<span lang="en">${value}</span>`;
}

function ErrorText({ error }) {
  const serious = error.level === "FATAL" || error.level === "CRITICAL";
  const family = ["error", "fault"].find((name) => known(`${name}.${error.type}`));
  return html`<p class=${serious ? "serious" : ""} data-error=${error.type}>
    ${family ? t(`${family}.${error.type}`) : html`<span lang="en">${error.type || t("app.unknown")}</span>`}
    ${error.description && html`<small lang="en"> ${error.description}</small>`}
  </p>`;
}

function OrderText({ robot }) {
  if (!robot.order) return html`<p>${t("fleet.no_order")}</p>`;
  return html`<p>${t("fleet.order", { id: robot.order })}${" "}
      ${robot.open ? t("fleet.left", { count: robot.left }) : t("fleet.ended")}</p>
    ${robot.open && html`<progress max="1" value=${robot.progress} aria-label=${t("fleet.progress")}></progress>`}
    ${robot.cancel && html`<p data-cancel=${robot.cancel}>${t(`cancel.${robot.cancel}`)}</p>`}`;
}

function CancelOrder({ link, prefix, robot, right }) {
  const [asked, ask] = useState(null); // the order as it was when its cancellation was begun
  const [pin, setPin] = useState("");
  const [why, setWhy] = useState("");
  if (!robot.order || !robot.open || robot.condition === "offline" || robot.condition === "lost") return null;
  if (right === "none") return html`<p>${t("fleet.read_only")}</p>`;
  const send = async () => {
    const answer = await link.ask({ t: "cancel", robot: prefix, order: asked, pin });
    setPin("");
    if (answer.ok) ask(null);
    setWhy(answer.ok ? "" : answer.why);
  };
  if (asked === null) {
    const begin = () => { setWhy(""); ask(robot.order); };
    return html`<button class="danger" data-do="cancel" onClick=${begin}>${t("fleet.cancel")}</button>`;
  }
  return html`<div class="sure" role="alertdialog" aria-label=${t("fleet.cancel")}>
    <p>${t("fleet.sure", { id: asked, serial: robot.serial })}</p>
    ${right === "pin" && html`<label class="field"><span>${t("fleet.pin")}</span>
      <input type="password" inputmode="numeric" autocomplete="off" maxlength="12" value=${pin}
        onInput=${(event) => setPin(event.target.value.replace(/\D/g, ""))} /></label>`}
    ${why && html`<p class="problem" role="alert" data-why=${why}>${t(why)}</p>`}
    <div class="tools">
      <button class="danger" data-do="yes" disabled=${link.lost || (right === "pin" && pin.length < 4)} onClick=${send}>${t("fleet.yes")}</button>
      <button data-do="no" onClick=${() => ask(null)}>${t("fleet.no")}</button>
    </div>
  </div>`;
}

function Robot({ link, prefix, robot, selected, select, right, site }) {
  const battery = robot.battery === null ? t("app.battery_unknown") : t("app.battery", { percent: robot.battery });
  const serious = robot.errors.filter((error) => error.level !== "WARNING").length;
  return html`<li class=${`robot ${kindOf(robot)}`} data-robot=${robot.serial} data-condition=${robot.condition}>
    <button aria-expanded=${selected} onClick=${() => select(selected ? null : prefix)}>
      <strong>${robot.serial}</strong>
      ${t(`condition.${robot.condition}`)}${robot.age_s > 0 && ` (${t("fleet.age", { seconds: robot.age_s })})`}
      ${" · "}${battery}${robot.charging && ` · ${t("condition.charging")}`}
      ${robot.loaded && ` · ${t("fleet.loaded")}`}
      ${serious > 0 && html`<span class="serious"> · ${t("fleet.errors", { count: robot.errors.length + robot.errors_more })}</span>`}
    </button>
    ${robot.open && !selected && html`<div class="more"><progress max="1" value=${robot.progress} aria-label=${t("fleet.progress")}></progress></div>`}
    ${selected && html`<div class="more">
      ${robot.mode && html`<p>${t("fleet.mode")} ${words("mode", robot.mode)}</p>`}
      <p>${robot.pose ? t("fleet.position", { x: robot.pose[0].toFixed(2), y: robot.pose[1].toFixed(2) }) : t("fleet.no_position")}
        ${robot.pose && site?.map && robot.map !== site.map.id && ` ${t("fleet.other_map", { map: robot.map })}`}</p>
      <${OrderText} robot=${robot} />
      ${robot.errors.map((error) => html`<${ErrorText} error=${error} />`)}
      ${robot.errors_more > 0 && html`<p>${t("fleet.more_errors", { count: robot.errors_more })}</p>`}
      <${CancelOrder} link=${link} prefix=${prefix} robot=${robot} right=${right} />
      <p class="code">${robot.maker}</p>
    </div>`}
  </li>`;
}

function App({ link, listen }) {
  const [, setTurn] = useState(0);
  const change = () => setTurn((turn) => turn + 1);
  const [selected, select] = useState(null);
  useLayoutEffect(() => { listen(change); change(); }, []);
  const { site, shown, broker, rights } = link.state;
  const robots = (shown?.prefixes ?? []).map((prefix) => ({ prefix, robot: link.state[`robot:${prefix}`] })).filter(({ robot }) => robot);
  const old = link.lost || broker?.lost;
  return html`<div class=${`fleet ${site?.map ? "" : "no-map"}`}>
    <header>
      <h1>${t("app.title")}</h1>
      <div class="languages" role="group" aria-label=${t("app.language")}>
        ${LANGUAGES.map(([code, name]) => html`<button lang=${code === "zh" ? "zh-Hans" : code}
          aria-pressed=${languageNow() === code} onClick=${() => { setLanguage(code); change(); }}>${name}</button>`)}
      </div>
    </header>
    ${old && html`<p class="notice bad broker-lost" role="alert">
      ${link.lost ? t(link.connectedOnce ? "fleet.page_lost" : "fleet.connecting") : t("fleet.broker_lost")}
      ${!link.lost && html`<small lang="en"> ${broker.why}</small>`}
    </p>`}
    <main>
    ${site?.map && html`<${FleetMap} site=${site} robots=${robots} selected=${selected} select=${select} kindOf=${kindOf} />`}
    <ul class=${`list ${old ? "old" : ""}`}>
      ${robots.length === 0 && !old && html`<li>${t("fleet.no_robots")}</li>`}
      ${robots.map(({ prefix, robot }) => html`<${Robot} key=${prefix} link=${link} prefix=${prefix} robot=${robot}
        selected=${selected === prefix} select=${select} right=${rights?.cancel} site=${site} />`)}
      ${shown?.more > 0 && html`<li>${t("fleet.more_robots", { count: shown.more })}</li>`}
    </ul>
    </main>
  </div>`;
}

async function main() {
  await loadTexts();
  let changed = () => {};
  const link = new Link(() => {
    if (link.state?.site) suggestLanguage(link.state.site.language);
    changed();
  });
  window.touchUi = { link }; // start.js asks for a page again that has not come up
  render(html`<${App} link=${link} listen=${(listener) => { changed = listener; }} />`, document.getElementById("app"));
  addFonts();
}

main();
