// One mission: its names and its stops, put together by touch. The robot's own rules say at each field what is wrong.

import { html, useEffect, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";
import { Keyboard } from "/keyboard.js";
import { MissionMap } from "/pages/mission_map.js";

const CHECK_AFTER_MS = 250;
const DEGREES = 180 / Math.PI;
const KINDS = ["pass", "wait", "park", "dock", "undock"];
const round = (value, digits) => (typeof value === "number" ? Number(value.toFixed(digits)) : value);
const kindOf = (action) => (typeof action === "string" ? action : Object.keys(action ?? {})[0] ?? "pass");
const slug = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, "_").replace(/^_+|_+$/g, "").slice(0, 64);

// A number if it is one; else what was typed, which the robot refuses at its field.
function number(text, digits) {
  const value = Number(text.trim().replace(",", "."));
  return text.trim() && Number.isFinite(value) ? round(value, digits) : text;
}

function problemsAt(problems, path) {
  return problems.filter((item) => item.field === path || item.field.startsWith(`${path}.`));
}

function Problems({ problems, path }) {
  return problemsAt(problems, path).map((item) => html`<small class="problem" role="alert" lang="en" data-problem=${path}>${item.text}</small>`);
}

function Field({ label, path, value, onInput, problems, disabled, numeric }) {
  return html`<label class="field"><span>${label}</span>
    <input type="text" autocomplete="off" spellcheck=${false} data-field=${path} value=${value} disabled=${disabled}
      inputmode=${numeric ? "decimal" : "text"} aria-invalid=${problemsAt(problems, path).length > 0}
      onInput=${(event) => onInput(event.target.value)} />
    <${Problems} problems=${problems} path=${path} />
  </label>`;
}

function Figure({ label, path, value, step, digits, onChange, problems, disabled }) {
  const shown = typeof value === "number" ? String(round(value, digits)) : value;
  const by = (amount) => onChange(round((typeof value === "number" ? value : 0) + amount, digits));
  return html`<div class="figure">
    <button type="button" disabled=${disabled} aria-label=${t("missions.less", { what: label })} onClick=${() => by(-step)}>−</button>
    <${Field} label=${label} path=${path} value=${shown} problems=${problems} disabled=${disabled} numeric
      onInput=${(text) => onChange(number(text, digits))} />
    <button type="button" disabled=${disabled} aria-label=${t("missions.more", { what: label })} onClick=${() => by(step)}>+</button>
  </div>`;
}

function Place({ place, path, change, problems, disabled }) {
  const degrees = typeof place.yaw === "number" ? place.yaw * DEGREES : place.yaw;
  const turn = (value) => change({ yaw: typeof value === "number" ? round(value / DEGREES, 4) : value });
  return html`<${Figure} label=${t("missions.x")} path=${`${path}.x`} value=${place.x} step=${0.1} digits=${2} problems=${problems}
      disabled=${disabled} onChange=${(x) => change({ x })} />
    <${Figure} label=${t("missions.y")} path=${`${path}.y`} value=${place.y} step=${0.1} digits=${2} problems=${problems}
      disabled=${disabled} onChange=${(y) => change({ y })} />
    <${Figure} label=${t("missions.yaw")} path=${`${path}.yaw`} value=${degrees} step=${5} digits=${1} problems=${problems}
      disabled=${disabled} onChange=${turn} />`;
}

function ActionChoice({ stop, path, change, docks, problems, disabled }) {
  const kind = kindOf(stop.action);
  const choose = (next) => change({ action: next === "wait" ? { wait: 5 } : next === "dock" ? { dock: docks[0]?.id ?? "" } : next });
  const atDock = (dock) => change({ action: { dock: dock.id }, x: round(dock.x, 3), y: round(dock.y, 3), yaw: round(dock.yaw, 4) });
  return html`<div class="tools" role="group" aria-label=${t("missions.action")}>
      ${KINDS.map((name) => html`<button type="button" data-kind=${name} aria-pressed=${kind === name} disabled=${disabled}
        onClick=${() => choose(name)}>${t(`step.${name}`)}</button>`)}
    </div>
    ${kind === "wait" && html`<${Figure} label=${t("missions.wait")} path=${`${path}.wait_s`} value=${stop.action.wait} step=${5} digits=${1}
      problems=${problems} disabled=${disabled} onChange=${(wait) => change({ action: { wait } })} />`}
    ${kind === "dock" && html`<div class="tools" role="group" aria-label=${t("missions.dock")}>
      ${docks.map((dock) => html`<button type="button" data-dock=${dock.id} aria-pressed=${stop.action.dock === dock.id} disabled=${disabled}
        onClick=${() => atDock(dock)}>${dock.id} · ${t(`dock_kind.${dock.kind}`)}</button>`)}
    </div>`}
    ${!(kind === "wait" && problemsAt(problems, `${path}.wait_s`).length) && html`<${Problems} problems=${problems} path=${path} />`}`;
}

// Where the robot goes on a low battery, and the charger it docks to from there. A charger brings its staging pose.
function Home({ home, set, docks, problems, disabled }) {
  const { dock: chosen = "", ...place } = home;
  const at = (dock) => ({ x: round(dock.x, 3), y: round(dock.y, 3), yaw: round(dock.yaw, 4), dock: dock.id });
  return html`<div class="tools" role="group" aria-label=${t("missions.home_dock")}>
      <button type="button" data-home-dock="" aria-pressed=${!chosen} disabled=${disabled} onClick=${() => set(place)}>${t("missions.no_charger")}</button>
      ${docks.filter((dock) => dock.kind === "charger").map((dock) => html`<button type="button" data-home-dock=${dock.id}
        aria-pressed=${chosen === dock.id} disabled=${disabled} onClick=${() => set(at(dock))}>${dock.id} · ${t("dock_kind.charger")}</button>`)}
    </div>
    <${Problems} problems=${problems} path="home.dock" />
    <${Place} place=${home} path="home" problems=${problems} disabled=${disabled} change=${(part) => set({ ...home, ...part })} />`;
}

function freeName(draft, wanted) {
  const taken = new Set(draft.waypoints.map((stop) => stop.name));
  for (let count = 1; ; count += 1) {
    const name = count === 1 ? wanted : `${wanted} ${count}`;
    if (!taken.has(name)) return name;
  }
}

// Places that other missions name, and docks: each once.
function placesOf(files) {
  const found = new Map(files.docks.map((dock) => [dock.id, { name: dock.id, x: dock.x, y: dock.y, yaw: dock.yaw, action: { dock: dock.id } }]));
  for (const file of files.list) {
    for (const stop of file.mission?.waypoints ?? []) {
      if (kindOf(stop.action) !== "dock" && !found.has(stop.name)) found.set(stop.name, { ...stop, action: "pass" });
    }
  }
  return [...found.values()];
}

// What is being edited, and how it is changed. Everything that is changed is a new object.
function useDraft(link, edit, setEdit) {
  const [problems, setProblems] = useState([]);
  const { draft } = edit;
  const change = (part) => setEdit({ ...edit, dirty: true, draft: { ...draft, ...part } });
  const changeStop = (index, part) => change({ waypoints: draft.waypoints.map((stop, at) => (at === index ? { ...stop, ...part } : stop)) });
  useEffect(() => {
    if (!edit.judged || edit.readOnly) return undefined;
    let current = true;
    const timer = setTimeout(async () => {
      const answer = await link.ask({ t: "mission_check", mission: draft, was: edit.was });
      if (current) setProblems(answer.problems ?? []);
    }, CHECK_AFTER_MS);
    return () => { current = false; clearTimeout(timer); };
  }, [draft, edit.judged]);
  return { draft, change, changeStop, problems, setProblems };
}

export function MissionEditor({ link, state, say, files, edit, setEdit }) {
  const { draft, change, changeStop, problems, setProblems } = useDraft(link, edit, setEdit);
  const [chosen, setChosen] = useState(draft.waypoints.length ? 0 : "names");
  const [tool, setTool] = useState(null);
  const [leaving, setLeaving] = useState(false);
  const [field, setField] = useState(null);
  useEffect(() => { field?.scrollIntoView({ block: "nearest" }); }, [field]);  // what the keys would cover
  const fixed = edit.readOnly;
  const insert = (stop) => {
    const at = typeof chosen === "number" ? chosen + 1 : draft.waypoints.length;
    change({ waypoints: draft.waypoints.toSpliced(at, 0, { ...stop, name: freeName(draft, stop.name) }) });
    setChosen(at);
    setTool(null);
  };
  const place = (at) => {
    const pose = { x: round(at.x, 2), y: round(at.y, 2), yaw: round(at.yaw, 4) };
    if (tool === "add") insert({ name: t("missions.new_stop"), ...pose, action: "pass" });
    else if (chosen === "home") change({ home: { ...draft.home, ...pose } });
    else changeStop(chosen, pose);
    setTool(null);
  };
  const save = async () => {
    const answer = await link.ask({ t: "mission_save", mission: draft, was: edit.was, revision: edit.revision });
    setProblems(answer.problems ?? []);
    say(answer);
    setEdit(answer.ok ? null : { ...edit, judged: true });
  };
  const leave = () => (edit.dirty && !leaving ? setLeaving(true) : setEdit(null));
  const last = draft.waypoints[typeof chosen === "number" ? chosen : draft.waypoints.length - 1] ?? draft.home;
  return html`<section class="page editor" data-page="missions" data-editor
      onfocusin=${(event) => event.target.matches("input") && setField(event.target)}>
    <div class="toolbar">
      <h2>${fixed ? draft.name.en : edit.was ? t("missions.edit") : t("missions.new")}</h2>
      ${!fixed && html`<button class="primary" id="save-mission" onClick=${save}>${t("missions.save")}</button>`}
      ${leaving
        ? html`<strong>${t("missions.discard_sure")}</strong>
            <button class="danger" id="discard" onClick=${() => setEdit(null)}>${t("missions.discard")}</button>
            <button onClick=${() => setLeaving(false)}>${t("missions.go_on")}</button>`
        : html`<button id="leave-editor" onClick=${leave}>${fixed ? t("missions.back") : t("app.cancel")}</button>`}
      ${problems.length > 0 && html`<p class="problem" id="problems" role="status">${t("missions.problems", { count: problems.length })}</p>`}
    </div>
    <div class="editor-view">
      <${MissionMap} link=${link} draft=${draft} docks=${files.docks} chosen=${chosen} choose=${setChosen}
        placing=${tool ? { yaw: typeof last.yaw === "number" ? last.yaw : 0 } : null} onPlace=${place} />
      <div class="editor-form">
        ${!fixed && html`<${AddStep} tool=${tool} setTool=${setTool} insert=${insert} places=${placesOf(files)} state=${state} />`}
        <${Problems} problems=${problems.filter((item) => item.field === "waypoints")} path="waypoints" />
        <${Steps} draft=${draft} chosen=${chosen} choose=${setChosen} problems=${problems}>
          ${chosen === "names" && html`<${Names} draft=${draft} change=${change} problems=${problems} fixed=${fixed} renames=${!edit.was} />`}
          ${chosen === "home" && html`<${Home} home=${draft.home} set=${(home) => change({ home })} docks=${files.docks}
            problems=${problems} disabled=${fixed} />`}
          ${draft.waypoints[chosen] && html`<${Stop} draft=${draft} index=${chosen} change=${change} changeStop=${changeStop}
            setChosen=${setChosen} docks=${files.docks} problems=${problems} fixed=${fixed} />`}
          ${!fixed && chosen !== "names" && html`<button type="button" id="move-on-map" aria-pressed=${tool === "move"}
            onClick=${() => setTool(tool === "move" ? null : "move")}>${t("missions.move_on_map")}</button>`}
        <//>
      </div>
    </div>
    ${field && !fixed && field.isConnected && html`<${Keyboard} field=${field} close=${() => setField(null)} />`}
  </section>`;
}

// Names, stops and home; below the one that is chosen what it is.
function Steps({ draft, chosen, choose, problems, children }) {
  const bad = (path) => problemsAt(problems, path).length > 0;
  const entry = (key, text, wrong) => html`<li>
    <button type="button" data-step=${key} aria-expanded=${chosen === key} class=${wrong ? "wrong" : ""}
      onClick=${() => choose(key)}>${text}${wrong ? " ⚠" : ""}</button>
    ${chosen === key && html`<div class="step-form">${children}</div>`}
  </li>`;
  return html`<ol class="steps" aria-label=${t("missions.stops")}>
    ${entry("names", t("missions.names"), bad("name") || bad("id"))}
    ${draft.waypoints.map((stop, index) => entry(index, `${index + 1} · ${stop.name} · ${t(`step.${kindOf(stop.action)}`)}`, bad(`waypoints.${index}`)))}
    ${entry("home", t("missions.home"), bad("home"))}
  </ol>`;
}

function AddStep({ tool, setTool, insert, places, state }) {
  const [open, setOpen] = useState(false);
  const pose = state.place?.pose;
  const here = () => insert({ name: t("missions.new_stop"), x: pose[0], y: pose[1], yaw: round(pose[2], 4), action: "pass" });
  return html`<div class="tools" role="group" aria-label=${t("missions.add")}>
      <button type="button" id="add-on-map" aria-pressed=${tool === "add"} onClick=${() => setTool(tool === "add" ? null : "add")}>${t("missions.add_on_map")}</button>
      <button type="button" id="add-known" aria-expanded=${open} onClick=${() => setOpen(!open)}>${t("missions.add_known")}</button>
      <button type="button" id="add-here" disabled=${!pose} onClick=${here}>${t("missions.add_here")}</button>
    </div>
    ${open && html`<div class="tools places" role="group" aria-label=${t("missions.add_known")}>
      ${places.map((item) => html`<button type="button" data-place=${item.name} onClick=${() => { setOpen(false); insert(item); }}>${item.name}</button>`)}
    </div>`}`;
}

function Names({ draft, change, problems, fixed, renames }) {
  const { name, id } = draft;
  const english = (text) => change({
    name: { en: text, ja: name.ja === name.en ? text : name.ja, zh: name.zh === name.en ? text : name.zh },
    id: renames && id === slug(name.en) ? slug(text) : id,
  });
  const other = (code) => (text) => change({ name: { ...name, [code]: text } });
  return html`<${Field} label="English" path="name.en" value=${name.en} problems=${problems} disabled=${fixed} onInput=${english} />
    <${Field} label="日本語" path="name.ja" value=${name.ja} problems=${problems} disabled=${fixed} onInput=${other("ja")} />
    <${Field} label="中文" path="name.zh" value=${name.zh} problems=${problems} disabled=${fixed} onInput=${other("zh")} />
    <${Field} label=${t("missions.id")} path="id" value=${id} problems=${problems} disabled=${fixed} onInput=${(text) => change({ id: text })} />`;
}

const LABELS = [["ja", "日本語"], ["zh", "中文"]];

// A language without a name of its own shows the English one.
function labelled(stop, code, text) {
  const { [code]: _, ...rest } = stop.label ?? {};
  return text.trim() ? { ...rest, [code]: text } : rest;
}

function Stop({ draft, index, change, changeStop, setChosen, docks, problems, fixed }) {
  const stop = draft.waypoints[index];
  const path = `waypoints.${index}`;
  const set = (part) => changeStop(index, part);
  const move = (to) => {
    change({ waypoints: draft.waypoints.toSpliced(index, 1).toSpliced(to, 0, stop) });
    setChosen(to);
  };
  const remove = () => {
    change({ waypoints: draft.waypoints.toSpliced(index, 1) });
    setChosen(draft.waypoints.length > 1 ? Math.max(0, index - 1) : "names");
  };
  return html`<${Field} label=${t("missions.name")} path=${`${path}.name`} value=${stop.name} problems=${problems} disabled=${fixed}
      onInput=${(name) => set({ name })} />
    ${LABELS.map(([code, language]) => html`<${Field} label=${`${t("missions.name")} · ${language}`} path=${`${path}.label.${code}`}
      value=${stop.label?.[code] ?? ""} problems=${problems} disabled=${fixed} onInput=${(text) => set({ label: labelled(stop, code, text) })} />`)}
    <${ActionChoice} stop=${stop} path=${`${path}.action`} change=${set} docks=${docks} problems=${problems} disabled=${fixed} />
    <${Place} place=${stop} path=${path} change=${set} problems=${problems} disabled=${fixed} />
    ${!fixed && html`<div class="tools">
      <button type="button" id="step-up" disabled=${index === 0} onClick=${() => move(index - 1)}>${t("missions.earlier")}</button>
      <button type="button" id="step-down" disabled=${index === draft.waypoints.length - 1} onClick=${() => move(index + 1)}>${t("missions.later")}</button>
      <button type="button" id="step-remove" onClick=${remove}>${t("missions.remove")}</button>
    </div>`}`;
}
