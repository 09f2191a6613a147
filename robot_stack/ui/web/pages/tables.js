// Pages that are lists: faults, diagnostics, history, recordings, events.

import { html, useEffect } from "/vendor/preact-htm.js";
import { known, t } from "/i18n.js";
import { reasonText } from "/pages/rider.js";

function Table({ columns, rows, id, label }) {
  return html`<div class="scroll" tabindex="0" role="region" aria-label=${label}><table id=${id}>
    <thead><tr>${columns.map((name) => html`<th scope="col">${name}</th>`)}</tr></thead>
    <tbody>${rows.map((cells) => html`<tr>${cells.map((cell) => html`<td>${cell}</td>`)}</tr>`)}</tbody>
  </table></div>`;
}

function useLayers(link, layers) {
  useEffect(() => { link.show(layers); }, []);
}

function StopSources({ link, sources, say }) {
  const clear = async (source) => say(await link.ask({ t: "clear_stop", source }));
  return sources.length > 0 && html`<section class="sources"><h3>${t("faults.sources")}</h3>
    ${sources.map(({ name, presence }) => html`<article class="fault" data-source=${name}>
      <h3><code>${name}</code></h3>
      <p>${t(`presence.${presence}`)}</p>
      ${presence !== "there" && html`<button class="clear" onClick=${() => clear(name)}>${t("faults.clear", { name })}</button>`}
    </article>`)}
  </section>`;
}

export function FaultsPage({ link, state, say }) {
  useLayers(link, ["stop_sources"]);
  const { faults = [], emergency } = state.safety ?? {};
  const called = state.staff?.called;
  const reset = async () => say(await link.ask({ t: "reset" }));
  const answer = async () => say(await link.ask({ t: "call", on: false }));
  return html`<section class="page faults" data-page="faults">
    <h2>${t("faults.title")}</h2>
    ${called && html`<div class="fault WARN"><p class="large">${t("faults.call")}</p>
      <button class="primary" id="call-done" onClick=${answer}>${t("faults.call_done")}</button></div>`}
    ${!faults.length && !called && !emergency && html`<p class="large">${t("faults.none")}</p>`}
    ${faults.map((fault) => html`<article class=${`fault ${fault.action}`} data-fault=${fault.code}>
      <h3>${reasonText(fault.code)} <span class="tag">${t(`action.${fault.action}`)}${fault.latched ? ` · ${t("faults.latched")}` : ""}</span></h3>
      <p>${t(`todo.${fault.code}`)}</p>
      <p class="code" lang="en">${fault.code}: ${fault.when}</p>
    </article>`)}
    ${emergency && html`<${StopSources} link=${link} sources=${state.stop_sources?.list ?? []} say=${say} />`}
    ${emergency && html`<div class="reset"><p>${t("faults.reset_hint")}</p>
      <button class="primary" id="reset" onClick=${reset}>${t("faults.reset")}</button></div>`}
  </section>`;
}

const level = (name) => html`<span class=${`level ${name}`}>${t(`level.${name}`)}</span>`;
const figure = (value) => (value === null || value === undefined ? "–" : value.toFixed(value < 10 ? 2 : 1));

export function DiagnosticsPage({ link, state }) {
  useLayers(link, ["diagnostics"]);
  const { topics = [], nodes = [] } = state.diagnostics ?? {};
  const computer = state.computer;
  const values = computer?.known && { cpu: computer.cpu_pct ?? "–", memory: computer.memory_pct ?? "–", disk: computer.disk_pct ?? "–" };
  const topicRows = topics.map((row) => [html`<code>${row.name}</code>`, level(row.state), figure(row.rate_hz), figure(row.expected_hz), figure(row.age_s), row.by]);
  const nodeRows = nodes.map((row) => [html`<code>${row.name}</code>`, level(row.level), html`<span lang="en">${row.text}</span>`]);
  return html`<section class="page" data-page="diagnostics">
    <h2>${t("diagnostics.title")}</h2>
    ${values && html`<p>${t("diagnostics.computer", values)}</p>`}
    ${!nodes.length && html`<p role="status">${t("diagnostics.waiting")}</p>`}
    <h3>${t("diagnostics.nodes")}</h3>
    <${Table} id="nodes" label=${t("diagnostics.nodes")} rows=${nodeRows}
      columns=${[t("diagnostics.node"), t("diagnostics.state"), t("diagnostics.text")]} />
    <h3>${t("diagnostics.topics")}</h3>
    <${Table} id="topics" label=${t("diagnostics.topics")} rows=${topicRows}
      columns=${[t("diagnostics.topic"), t("diagnostics.state"), t("diagnostics.rate"), t("diagnostics.expected"), t("diagnostics.age"), t("diagnostics.by")]} />
  </section>`;
}

export function HistoryPage({ link, state }) {
  useLayers(link, ["history"]);
  const time = (at) => new Date(at).toLocaleString(document.documentElement.lang);
  const rows = (state.history?.list ?? []).map((item) => [time(item.at), item.who, item.what, item.outcome]);
  return html`<section class="page" data-page="history">
    <h2>${t("history.title")}</h2>
    <${Table} id="history" label=${t("history.title")} rows=${rows}
      columns=${[t("history.when"), t("history.who"), t("history.what"), t("history.outcome")]} />
  </section>`;
}

export function RecordingsPage({ link, state }) {
  useLayers(link, ["recordings"]);
  const { list = [], folder = "" } = state.recordings ?? {};
  return html`<section class="page" data-page="recordings">
    <h2>${t("recordings.title")}</h2>
    <p>${t("recordings.folder", { folder })}</p>
    ${list.length
      ? html`<${Table} id="recordings" label=${t("recordings.title")} rows=${list.map((item) => [html`<code>${item.name}</code>`, item.megabytes.toFixed(1)])}
          columns=${[t("recordings.name"), t("recordings.size")]} />`
      : html`<p class="large">${t("app.none")}</p>`}
  </section>`;
}

// Reasons beside the fault codes.
const eventReason = (reason) => (known(`event_reason.${reason}`) ? t(`event_reason.${reason}`) : reasonText(reason));

export function EventsPage({ link, state }) {
  useLayers(link, ["events"]);
  const { list = [], folder = "" } = state.events ?? {};
  const time = (at) => new Date(at).toLocaleString(document.documentElement.lang);
  const rows = list.map((item) => [
    time(item.at), item.reasons.map(eventReason).join(", "), t(`event_state.${item.state}`), item.megabytes.toFixed(1), html`<code>${item.id}</code>`]);
  return html`<section class="page" data-page="events">
    <h2>${t("events.title")}</h2>
    <p>${t("events.hint")}</p>
    <p>${t("recordings.folder", { folder })}</p>
    ${list.length
      ? html`<${Table} id="events" label=${t("events.title")} rows=${rows}
          columns=${[t("history.when"), t("events.reasons"), t("diagnostics.state"), t("recordings.size"), t("events.id")]} />`
      : html`<p class="large">${t("app.none")}</p>`}
  </section>`;
}
