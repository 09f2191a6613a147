// The missions: those that come with the software, and those made here, which can be edited.

import { html, useEffect, useState } from "/vendor/preact-htm.js";
import { languageNow, t } from "/i18n.js";
import { MissionEditor } from "/pages/mission_editor.js";
import { OrderOptions, OrderQueue, newOrder } from "/pages/orders.js";
import { poseOf } from "/map_draw.js";
import { Refused, RideReason } from "/pages/rider.js";

// What is being edited outlives a look at another page, and a session that ended.
const kept = { edit: null };

function freeId(files, wanted) {
  const taken = new Set(files.map((file) => file.id));
  for (let number = 0; ; number += 1) {
    const id = number ? `${wanted}_${number + 1}` : wanted;
    if (!taken.has(id)) return id;
  }
}

function newEdit(state) {
  const pose = poseOf(state) ?? { x: 0, y: 0, yaw: 0 };
  const draft = { id: "", name: { en: "", ja: "", zh: "" }, home: pose, waypoints: [] };
  return { draft, was: "", revision: "", readOnly: false, judged: false };
}

function editOf(file) {
  return { draft: structuredClone(file.mission), was: file.id, revision: file.revision, readOnly: !file.own, judged: true };
}

function copyOf(file, files) {
  const draft = structuredClone(file.mission);
  draft.id = freeId(files, `${file.id}_copy`.slice(0, 60));
  for (const code of Object.keys(draft.name)) draft.name[code] = t("missions.copy_of", { name: draft.name[code] }, code).slice(0, 64);
  return { draft, was: "", revision: "", readOnly: false, judged: true };
}

export function MissionsPage({ link, state, say }) {
  const [edit, setEdit] = useState(kept.edit);
  const [deleting, setDeleting] = useState(null);
  const [options, setOptions] = useState({ priority: 100, in_min: 0 });
  useEffect(() => { link.show(["mission_files"]); }, []);
  kept.edit = edit;
  const data = state.mission_files ?? { list: [], docks: [], folder: "" };
  if (edit) {
    return html`<${MissionEditor} link=${link} state=${state} say=${say} files=${data} edit=${edit} setEdit=${setEdit} />`;
  }
  const start = async (id) => {
    const answer = await link.ask({ t: "start", mission: id });
    if (!answer.ok) say(answer);
  };
  const order = async (id, now) => say(await link.ask(newOrder(id, options, now)));
  const riding = state.ride?.active;
  const remove = async (file) => {
    setDeleting(null);
    say(await link.ask({ t: "mission_delete", mission: file.id, revision: file.revision }));
  };
  return html`<section class="page" data-page="missions">
    <div class="toolbar">
      <h2>${t("missions.title")}</h2>
      <button class="primary" id="new-mission" onClick=${() => setEdit(newEdit(state))}>${t("missions.new")}</button>
    </div>
    <${RideReason} state=${state} />
    <${Refused} state=${state} commands=${["START_MISSION"]} />
    <${OrderQueue} link=${link} state=${state} say=${say} />
    <p>${t("missions.hint", { folder: data.folder })}</p>
    <${OrderOptions} options=${options} setOptions=${setOptions} />
    ${data.list.map((file) => html`<article class="mission" data-file=${file.id}>
      <h3>${file.mission?.name[languageNow()] ?? file.id} <span class="tag">${t(file.own ? "missions.own" : "missions.shipped")}</span></h3>
      ${file.mission
        ? html`<p>${file.mission.waypoints.map((item) => item.label?.[languageNow()] ?? item.name).join(" → ")}</p>`
        : html`<p class="problem" lang="en">${file.problem}</p>`}
      ${deleting === file.id
        ? html`<div class="tools" role="alertdialog" aria-label=${t("missions.delete")}>
            <strong>${t("missions.delete_sure")}</strong>
            <button class="danger" data-act="delete-yes" onClick=${() => remove(file)}>${t("missions.delete")}</button>
            <button onClick=${() => setDeleting(null)}>${t("app.cancel")}</button>
          </div>`
        : html`<div class="tools">
            ${file.mission && html`${riding
                ? html`<button data-act="now" onClick=${() => order(file.id, true)}>${t("queue.now")}</button>`
                : html`<button data-act="start" onClick=${() => start(file.id)}>${t("rider.start")}</button>`}
              <button data-act="order" onClick=${() => order(file.id, false)}>${t("queue.add")}</button>
              <button data-act="open" onClick=${() => setEdit(editOf(file))}>${t(file.own ? "missions.edit" : "missions.look")}</button>
              <button data-act="copy" onClick=${() => setEdit(copyOf(file, data.list))}>${t("missions.copy")}</button>`}
            ${file.own && html`<button data-act="delete" onClick=${() => setDeleting(file.id)}>${t("missions.delete")}</button>`}
          </div>`}
    </article>`)}
  </section>`;
}
