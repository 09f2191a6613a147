// A new lane of the route graph from points that were touched on the map, and the deletion of lanes.

import { html, useEffect, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";
import { poseOf } from "/map_draw.js";
import { SPEEDS, DeleteButton } from "/pages/zone_form.js";

export function LaneForm({ link, state, say, draft, change, addPoint, close }) {
  const [checks, setChecks] = useState(0); // an answer to an earlier draft is dropped
  const lanes = state.zones?.lanes;
  const { points, both, speed } = draft;
  const message = (type) => {
    const lane = { t: type, points, both, revision: lanes.revision };
    return speed === null ? lane : { ...lane, speed_limit_mps: speed };
  };
  useEffect(() => {
    if (points.length < 2) return change({ wrong: [] });
    let dropped = false;
    link.ask(message("lane_check")).then((answer) => {
      if (!dropped) change({ wrong: answer.problems ?? [] });
    });
    return () => { dropped = true; };
  }, [points, lanes?.revision, checks]);
  if (!lanes) return null;
  const save = async () => {
    const answer = await link.ask(message("lane_save"));
    say(answer);
    if (answer.ok) change({ points: [] });
    else setChecks(checks + 1);
  };
  const remove = async (lane) => say(await link.ask({ t: "lane_delete", lane, revision: lanes.revision }));
  const pose = poseOf(state);
  const wrong = points.length ? draft.wrong : lanes.wrong;
  return html`<div class="zone-form" data-form="lane">
    <p role="status">${t("lane.points", { count: points.length })}</p>
    <div class="tools">
      <button class="primary" id="lane-save" disabled=${points.length < 2 || draft.wrong.length > 0} onClick=${save}>${t("lane.save")}</button>
      <button id="lane-undo" disabled=${!points.length} onClick=${() => change({ points: points.slice(0, -1) })}>${t("lane.undo")}</button>
      <button id="lane-here" disabled=${!pose} onClick=${() => addPoint([pose.x, pose.y])}>${t("lane.here")}</button>
      <button onClick=${close}>${t("app.cancel")}</button>
    </div>
    ${wrong.map(({ key, values, at: [x, y] }) => html`<p class="problem" data-problem=${key}>✕ ${t(`lane_fault.${key}`, values)} (${x.toFixed(1)}, ${y.toFixed(1)})</p>`)}
    <div class="tools" role="group" aria-label=${t("map.lane")}>
      <button data-both="no" aria-pressed=${!both} onClick=${() => change({ both: false })}>${t("zone_kind.one_way")}</button>
      <button data-both="yes" aria-pressed=${both} onClick=${() => change({ both: true })}>${t("lane.both")}</button>
    </div>
    <div class="tools" role="group" aria-label=${t("lane.speed")}>
      <button data-speed="none" aria-pressed=${speed === null} onClick=${() => change({ speed: null })}>${t("lane.no_limit")}</button>
      ${SPEEDS.map((value) => html`<button data-speed=${value} aria-pressed=${speed === value} onClick=${() => change({ speed: value })}>${t("zone.speed", { speed: value })}</button>`)}
    </div>
    ${lanes.file && html`<p class="file" lang="en">${lanes.file}</p>`}
    <div class="tools">
      ${lanes.list.map(({ id }) => html`<${DeleteButton} key=${id} name=${id} label=${t("lane.name", { id })} remove=${() => remove(id)} />`)}
    </div>
  </div>`;
}
