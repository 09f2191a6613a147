// The queue of orders on the missions page: what comes next, why nothing starts, and the order's place.

import { html } from "/vendor/preact-htm.js";
import { languageNow, t } from "/i18n.js";
import { missionName } from "/pages/rider.js";

const NORMAL = 100;
const HIGH = 200;
const DELAYS_MIN = [0, 15, 30, 60];

export function newOrder(mission, options, now) {
  return now ? { t: "order", mission, now } : { t: "order", mission, ...options };
}

function clock(seconds) {
  return new Date(1000 * seconds).toLocaleString(languageNow(), { dateStyle: "short", timeStyle: "short" });
}

function facts(order) {
  const priority = order.priority === NORMAL ? [] : [t("queue.priority", { number: order.priority })];
  const time = order.earliest_s ? [t("queue.not_before", { time: clock(order.earliest_s) })] : [];
  const open = order.open ? [t("queue.open")] : [];
  return [t(`origin.${order.origin}`), ...priority, ...time, ...open].join(" · ");
}

export function OrderQueue({ link, state, say }) {
  const queue = state.queue ?? { orders: [], held_by: "NOTHING" };
  const held = queue.held_by !== "NOTHING";
  const ask = async (message) => say(await link.ask(message));
  return html`<article class="mission" id="queue" data-held=${queue.held_by}>
    <div class="toolbar">
      <h3>${t("queue.title")}</h3>
      ${held
        ? html`<button class="primary" id="release" onClick=${() => ask({ t: "queue_release" })}>${t("queue.release")}</button>`
        : html`<button id="hold" onClick=${() => ask({ t: "queue_hold" })}>${t("queue.hold")}</button>`}
    </div>
    <p role="status">${held ? t(`held.${queue.held_by}`) : t("queue.running")}
      ${held && queue.reason && html` <span class="code" lang="en">${queue.reason}</span>`}</p>
    ${!held && html`<p>${t("queue.hold_hint")}</p>`}
    ${queue.current && html`<p data-current=${queue.current.id}>
      <strong>${t("queue.current", { name: missionName(state, queue.current.mission) })}</strong> ${facts(queue.current)}
      ${state.ride?.active && ` · ${t("rider.progress", { done: state.ride.completed, total: state.ride.total })}`}
      ${queue.paused_by === "fleet" && html` <span data-paused-by="fleet">${t("reason.PAUSED_BY_FLEET")}</span>`}</p>`}
    ${!queue.orders.length && html`<p>${t("queue.empty")}</p>`}
    ${queue.orders.map((order, index) => html`<div class="tools" data-order=${order.id}>
      <span><strong>${index + 1}. ${missionName(state, order.mission)}</strong> ${facts(order)}</span>
      <button data-act="up" disabled=${index === 0} aria-label=${`${t("missions.earlier")}: ${index + 1}`}
        onClick=${() => ask({ t: "order_up", order: order.id })}>▲</button>
      <button data-act="down" disabled=${index === queue.orders.length - 1} aria-label=${`${t("missions.later")}: ${index + 1}`}
        onClick=${() => ask({ t: "order_down", order: order.id })}>▼</button>
      <button data-act="remove" aria-label=${`${t("queue.remove")}: ${index + 1}`}
        onClick=${() => ask({ t: "order_remove", order: order.id })}>${t("queue.remove")}</button>
    </div>`)}
  </article>`;
}

// How the next order that is added is ordered.
export function OrderOptions({ options, setOptions }) {
  const high = options.priority === HIGH;
  return html`<div class="tools" role="group" aria-label=${t("queue.options")}>
    <span>${t("queue.options")}</span>
    <button id="high" aria-pressed=${high} onClick=${() => setOptions({ ...options, priority: high ? NORMAL : HIGH })}>${t("queue.high")}</button>
    ${DELAYS_MIN.map((minutes) => html`<button data-delay=${minutes} aria-pressed=${options.in_min === minutes}
      onClick=${() => setOptions({ ...options, in_min: minutes })}>${minutes ? t("queue.in_min", { count: minutes }) : t("queue.at_once")}</button>`)}
  </div>`;
}
