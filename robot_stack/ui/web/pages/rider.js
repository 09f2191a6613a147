// What a rider needs: where to, start, pause, what happens now, why the robot stands, when we arrive.

import { html, useEffect, useState } from "/vendor/preact-htm.js";
import { duration, known, languageNow, t } from "/i18n.js";

export function reasonText(code) {
  return known(`fault.${code}`) ? t(`fault.${code}`) : known(`reason.${code}`) ? t(`reason.${code}`) : code;
}

export function RiderPage({ link, state, say }) {
  const ride = state.ride ?? {};
  useEffect(() => { link.show([]); }, []);
  if (state.safety?.emergency) return html`<${Emergency} link=${link} state=${state} say=${say} />`;
  if (ride.active) return html`<${Ride} link=${link} state=${state} say=${say} />`;
  return html`<${Destinations} link=${link} state=${state} say=${say} />`;
}

function Emergency({ link, state, say }) {
  const called = state.staff?.called;
  const call = async () => say(await link.ask({ t: "call", on: true }));
  return html`<section class="page rider emergency" data-page="emergency">
    <h2>${t("rider.emergency")}</h2>
    <p class="large">${t("rider.emergency_text")}</p>
    <${Reasons} state=${state} />
    <div class="actions">
      <button class="primary" id="call-now" disabled=${called} onClick=${call}>${called ? t("app.called") : t("app.call")}</button>
    </div>
  </section>`;
}

function Reasons({ state }) {
  const reasons = state.stand?.reasons ?? [];
  if (!reasons.length) return null;
  return html`<div class="reasons" role="status">
    <h3>${t("stand.title")}</h3>
    ${reasons.map((code) => html`<p data-reason=${code}>${reasonText(code)}</p>`)}
  </div>`;
}

function happensNow(state) {
  const ride = state.ride;
  const docking = state.docking?.state;
  if (ride.state === "PAUSED") return t("rider.paused");
  if (["SEARCH", "SERVOING", "FINE_ALIGN"].includes(docking)) return t("rider.docking");
  if (!ride.waypoint) return t(ride.state === "WAITING" ? "rider.stopover" : "rider.under_way");
  return t(ride.state === "WAITING" ? "rider.waiting" : "rider.to", { place: placeName(state, ride) });
}

function placeName(state, ride) {
  const mission = (state.missions?.list ?? []).find((item) => item.id === ride.mission);
  const stop = mission?.stops.find((item) => item.en === ride.waypoint);
  return stop ? stop[languageNow()] : ride.waypoint === "home" ? t("rider.home") : ride.waypoint;
}

export function missionName(state, id) {
  const mission = (state.missions?.list ?? []).find((item) => item.id === id);
  return mission ? mission.name[languageNow()] : id;
}

function Ride({ link, state, say }) {
  const [ending, setEnding] = useState(false);
  const ride = state.ride;
  const paused = ride.state === "PAUSED";
  const ask = async (verb) => {
    setEnding(false);
    const answer = await link.ask({ t: verb });
    if (!answer.ok) say(answer);
  };
  return html`<section class="page rider" data-page="ride" data-state=${ride.state}>
    <p class="eyebrow">${missionName(state, ride.mission)}${ride.passenger ? ` · ${t("rider.passenger")}` : ""}</p>
    <h2 aria-live="polite">${happensNow(state)}</h2>
    <div class="progress" role="progressbar" aria-valuemin="0" aria-valuemax="100"
      aria-label=${t("docking.progress")} aria-valuenow=${Math.round(100 * (ride.progress ?? 0))}>
      <div style=${{ width: `${Math.round(100 * (ride.progress ?? 0))}%` }}></div>
    </div>
    <p class="figures">
      <span>${ride.eta_s === null ? t("rider.eta_unknown") : t("rider.eta", { time: duration(ride.eta_s) })}</span>
      <span>${t("rider.progress", { done: ride.completed, total: ride.total })}</span>
    </p>
    <${Refused} state=${state} commands=${["PAUSE", "RESUME", "ABORT"]} />
    <${Reasons} state=${state} />
    <${RideReason} state=${state} />
    ${ending
      ? html`<div class="sure" role="alertdialog" aria-label=${t("rider.abort")}>
          <p class="large">${t("rider.abort_sure")}</p>
          <div class="actions">
            <button class="primary" onClick=${() => setEnding(false)}>${t("rider.abort_no")}</button>
            <button class="danger" id="abort-yes" onClick=${() => ask("abort")}>${t("rider.abort_yes")}</button>
          </div></div>`
      : html`<div class="actions">
          ${paused
            ? html`<button class="primary" id="resume" onClick=${() => ask("resume")}>${t("rider.resume")}</button>`
            : html`<button class="primary" id="pause" onClick=${() => ask("pause")}>${t("rider.pause")}</button>`}
          ${paused && state.queue?.paused_by
            && html`<button id="keep" onClick=${() => ask("pause")}>${t("rider.keep")}</button>`}
          <button id="abort" onClick=${() => setEnding(true)}>${t("rider.abort")}</button>
        </div>`}
  </section>`;
}

// The mission manager's answer to a command; the hub's only says that the command was sent.
export function Refused({ state, commands }) {
  const ride = state.ride;
  if (!commands.includes(ride?.last_command) || ride.accepted !== false) return null;
  return html`<p class="notice bad" role="status">${t("rider.not_accepted")} <span lang="en">${ride.reason}</span></p>`;
}

// The mission manager's own words: why the ride stands, or how it ended. After a refused command they are the refusal.
export function RideReason({ state }) {
  const ride = state.ride;
  if (!ride?.reason || (ride.last_command && ride.accepted === false)) return null;
  return html`<p class="code" data-why lang="en">${ride.reason}</p>`;
}

const ENDS = { COMPLETED: "rider.completed", ABORTED: "rider.aborted", FAILED: "rider.failed" };

function Destinations({ link, state, say }) {
  const [chosen, setChosen] = useState(null);
  const missions = state.missions?.list ?? [];
  const mission = missions.find((item) => item.id === chosen);
  if (mission) return html`<${Departure} link=${link} state=${state} say=${say} mission=${mission} back=${() => setChosen(null)} />`;
  const ended = ENDS[state.ride?.state];
  return html`<section class="page rider" data-page="destinations">
    ${ended && html`<p class="notice" data-end=${state.ride.state}>${t(ended)}</p>`}
    <${RideReason} state=${state} />
    <${Refused} state=${state} commands=${["START_MISSION"]} />
    <h2>${t("rider.where")}</h2>
    <p class="large">${missions.length ? t("rider.choose") : t("rider.no_destinations")}</p>
    <${BlockedBy} state=${state} />
    <${HeldOrders} link=${link} state=${state} say=${say} />
    <div class="cards">
      ${missions.map((item) => html`
        <button class="card" data-mission=${item.id} onClick=${() => setChosen(item.id)}>
          <strong>${item.name[languageNow()]}</strong>
          <span>${t("rider.stops", { count: item.stops.length })}${item.carries ? ` · ${t("rider.with_chair")}` : ""}</span>
        </button>`)}
    </div>
  </section>`;
}

// Orders that wait for a person: one touch lets them start.
export function HeldOrders({ link, state, say }) {
  const queue = state.queue ?? {};
  if (!queue.orders?.length || queue.held_by === "NOTHING") return null;
  const release = async () => say(await link.ask({ t: "queue_release" }));
  return html`<div class="reasons" role="status" data-held=${queue.held_by}>
    <h3>${t("queue.waiting", { count: queue.orders.length, name: missionName(state, queue.orders[0].mission) })}</h3>
    <p>${t(`held.${queue.held_by}`)}</p>
    ${queue.held_by !== "STAFF" && html`
      <div class="actions"><button class="primary" id="release" onClick=${release}>${t("queue.release")}</button></div>`}
  </div>`;
}

// The end of a ride is shown above; here is what keeps the next from starting.
function BlockedBy({ state }) {
  const reasons = (state.stand?.reasons ?? []).filter((code) => !code.startsWith("RIDE_"));
  return html`<${Reasons} state=${{ stand: { reasons } }} />`;
}

function Departure({ link, state, say, mission, back }) {
  const start = async () => {
    link.send({ t: "language", code: languageNow() });
    const answer = await link.ask({ t: "start", mission: mission.id });
    if (!answer.ok) say(answer);
    back();
  };
  const names = mission.stops.slice(0, 8).map((stop) => stop[languageNow()]).join(" → ") + (mission.stops.length > 8 ? " …" : "");
  return html`<section class="page rider" data-page="departure">
    <p class="eyebrow">${t("rider.ready_to_go")}</p>
    <h2>${mission.name[languageNow()]}</h2>
    <p class="large">${t("rider.via", { names })}</p>
    <${BlockedBy} state=${state} />
    <div class="actions">
      <button class="primary" id="start" onClick=${start}>${t("rider.start")}</button>
      <button id="other" onClick=${back}>${t("rider.other")}</button>
    </div>
  </section>`;
}
