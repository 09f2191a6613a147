// A new zone from corners that were touched on the map, and the deletion of zones.

import { html, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";

const KINDS = ["keepout", "speed", "one_way"];
export const SPEEDS = [0.2, 0.4, 0.6, 0.8];

function freeName(zones, kind) {
  const taken = new Set(zones.map((zone) => zone.name));
  for (let number = 1; ; number += 1) {
    if (!taken.has(`${kind} ${number}`)) return `${kind} ${number}`;
  }
}

// A one-way zone is driven through from its first corner towards its second.
function zoneOf(site, kind, corners, speed) {
  const zone = { t: "zone_save", name: freeName(site.zones, kind), type: kind, points: corners, revision: site.revision };
  if (kind === "speed") zone.speed_limit_mps = speed;
  if (kind === "one_way") {
    const [[ax, ay], [bx, by]] = corners;
    zone.heading_deg = Math.round((Math.atan2(by - ay, bx - ax) * 180) / Math.PI);
  }
  return zone;
}

// Deletes at the second touch.
export function DeleteButton({ name, label, remove }) {
  const [asked, setAsked] = useState(false);
  return asked
    ? html`<button class="danger" data-delete-yes=${name} onBlur=${() => setAsked(false)} onClick=${remove}>${t("zone.delete_sure", { name: label })}</button>`
    : html`<button data-delete=${name} onClick=${() => setAsked(true)}>${t("zone.delete", { name: label })}</button>`;
}

export function ZoneForm({ link, site, say, corners, setCorners, kind, setKind, close }) {
  const [speed, setSpeed] = useState(0.4);
  if (!site) return null;
  const save = async () => {
    const answer = await link.ask(zoneOf(site, kind, corners, speed));
    say(answer);
    if (answer.ok) setCorners([]);
  };
  const remove = async (name) => say(await link.ask({ t: "zone_delete", name, revision: site.revision }));
  return html`<div class="zone-form">
    <div class="tools" role="group" aria-label=${t("map.zone")}>
      ${KINDS.map((name) => html`<button data-kind=${name} aria-pressed=${kind === name} onClick=${() => setKind(name)}>${t(`zone_kind.${name}`)}</button>`)}
      ${kind === "speed" && SPEEDS.map((value) => html`<button data-speed=${value} aria-pressed=${speed === value} onClick=${() => setSpeed(value)}>${t("zone.speed", { speed: value })}</button>`)}
    </div>
    <p role="status">${t("zone.corners", { count: corners.length })} ${kind === "one_way" && t("zone.direction")}</p>
    <div class="tools">
      <button class="primary" id="zone-save" disabled=${corners.length < 3} onClick=${save}>${t("zone.save")}</button>
      <button id="zone-undo" disabled=${!corners.length} onClick=${() => setCorners(corners.slice(0, -1))}>${t("zone.undo")}</button>
      <button onClick=${close}>${t("app.cancel")}</button>
    </div>
    ${site.file && html`<p class="file" lang="en">${site.file}</p>`}
    <div class="tools">
      ${site.zones.map(({ name }) => html`<${DeleteButton} key=${name} name=${name} label=${name} remove=${() => remove(name)} />`)}
    </div>
  </div>`;
}
