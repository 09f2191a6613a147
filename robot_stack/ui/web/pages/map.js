// The map: background, costmap, obstacles, plan, robot; poses and goals by touch.

import { html, useEffect, useRef, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";
import { ZoneForm } from "/pages/zone_form.js";
import { View, at, drawBackground, drawObstacles, drawPeople, drawPlan, drawCorners, drawRobot, drawZones, poseOf, readCostmap, readObstacles } from "/map_draw.js";

const LAYERS = ["plan", "costmap", "obstacles", "people", "zones"];
const LEAST_DRAG_M = 0.3;
const LEAST_SIDE_M = 0.3; // a corner nearer to the one before is a double touch
const STILL_PX = 8; // a finger that moves less has not dragged

function draw(canvas, view, layers, state, picture, wish, corners, kind) {
  const context = canvas.getContext("2d");
  const pose = poseOf(state);
  if (view.follows && pose) [view.x, view.y] = [pose.x, pose.y];
  drawBackground(context, canvas, view, state.site, picture);
  drawZones(context, canvas, view, state.zones);
  if (layers.costmap) {
    at(context, canvas, view, layers.costmap, () => {
      context.imageSmoothingEnabled = false;
      const { canvas: cells, cell } = layers.costmap;
      context.drawImage(cells, 0, 0, cells.width * cell, cells.height * cell);
    });
  }
  if (layers.obstacles) drawObstacles(context, canvas, view, layers.obstacles);
  drawPlan(context, canvas, view, state.plan?.points);
  drawPeople(context, canvas, view, state.people?.near ?? []);
  drawCorners(context, canvas, view, corners, kind);
  const footprint = state.site?.footprint; // nothing is drawn of a robot of unknown size
  if (pose && footprint) drawRobot(context, canvas, view, pose, footprint, "#0b4a63");
  if (wish && footprint) drawRobot(context, canvas, view, wish, footprint, "#8a3b00");
}

export function MapPage({ link, state, say }) {
  const canvas = useRef(null);
  const view = useRef(new View());
  const layers = useRef({});
  const picture = useRef(new Image());
  const [tool, setTool] = useState("look");
  const [wish, setWish] = useState(null);
  const [corners, setCorners] = useState([]);
  const [kind, setKind] = useState("keepout"); // of a new zone
  const drag = useRef(null);
  const chosen = useRef({}); // frames are painted by the first render's function
  chosen.current = { wish, corners, kind };
  const paint = () => canvas.current && draw(canvas.current, view.current, layers.current, link.state, picture.current,
    drag.current?.wish ?? chosen.current.wish, chosen.current.corners, chosen.current.kind);

  useEffect(() => {
    picture.current.onload = paint;
    picture.current.src = "/map.png";
    link.onFrame.costmap = (data) => { layers.current.costmap = readCostmap(data); paint(); };
    link.onFrame.obstacles = (data) => { layers.current.obstacles = readObstacles(data); paint(); };
    link.show(LAYERS);
    const fit = new ResizeObserver(() => {
      canvas.current.width = canvas.current.clientWidth;
      canvas.current.height = canvas.current.clientHeight;
      paint();
    });
    fit.observe(canvas.current);
    return () => { fit.disconnect(); delete link.onFrame.costmap; delete link.onFrame.obstacles; };
  }, []);
  useEffect(paint);

  const choose = (name) => { setTool(name); setWish(null); setCorners([]); setKind("keepout"); };
  const send = async () => {
    say(await link.ask({ t: tool, x: wish.x, y: wish.y, yaw: wish.yaw }));
    choose("look");
  };
  const zoom = (factor) => { view.current.scale = Math.min(120, Math.max(4, view.current.scale * factor)); paint(); };
  const addCorner = ([x, y]) => setCorners((before) => {
    const last = before[before.length - 1];
    return last && Math.hypot(x - last[0], y - last[1]) < LEAST_SIDE_M ? before : [...before, [x, y]];
  });
  const touch = touches(canvas, view, drag, tool, setWish, paint, link, addCorner);
  return html`<section class="page map" data-page="map">
    <div class="toolbar">
      <h2>${t("map.title")}</h2>
      <div class="tools" role="group" aria-label=${t("map.title")}>
        <button id="tool-look" aria-pressed=${tool === "look"} onClick=${() => choose("look")}>${t("map.look")}</button>
        <button id="tool-pose" aria-pressed=${tool === "pose"} onClick=${() => choose("pose")}>${t("map.set_pose")}</button>
        <button id="tool-goal" aria-pressed=${tool === "goal"} onClick=${() => choose("goal")}>${t("map.goal")}</button>
        <button id="tool-zone" aria-pressed=${tool === "zone"} onClick=${() => choose("zone")}>${t("map.zone")}</button>
        <button id="cancel-goal" onClick=${async () => say(await link.ask({ t: "cancel_goal" }))}>${t("map.cancel_goal")}</button>
      </div>
    </div>
    <div class="map-row">
    <div class="map-area">
      <canvas ref=${canvas} id="map" role="img" aria-label=${t("map.canvas")} ...${touch}></canvas>
      <div class="zoom">
        <button aria-label=${t("map.closer")} onClick=${() => zoom(1.4)}>+</button>
        <button aria-label=${t("map.farther")} onClick=${() => zoom(1 / 1.4)}>−</button>
        <button aria-label=${t("map.follow")} onClick=${() => { view.current.follows = true; paint(); }}>◎</button>
      </div>
      <${Hint} tool=${tool} wish=${wish} send=${send} cancel=${() => choose("look")} />
    </div>
    ${tool === "zone" && html`<${ZoneForm} link=${link} site=${state.zones} say=${say} corners=${corners} setCorners=${setCorners} kind=${kind} setKind=${setKind} close=${() => choose("look")} />`}
    </div>
    <p class="figures"><${Place} state=${state} /><${People} state=${state} /><${Zones} site=${state.zones} /></p>
  </section>`;
}

function Hint({ tool, wish, send, cancel }) {
  if (tool === "look" || tool === "zone") return null;
  if (!wish) return html`<p class="map-hint">${t(tool === "pose" ? "map.drag_pose" : "map.drag_goal")}</p>`;
  return html`<div class="map-hint" role="alertdialog" aria-label=${t("app.confirm")}>
    <span>${t(tool === "pose" ? "map.confirm_pose" : "map.confirm_goal")}</span>
    <button class="primary" id="confirm" onClick=${send}>${t("app.confirm")}</button>
    <button onClick=${cancel}>${t("app.cancel")}</button>
  </div>`;
}

function Place({ state }) {
  const pose = poseOf(state);
  const { quality, speed_mps: speed } = state.place ?? {};
  if (!pose) return html`<span>${t("map.no_pose")}</span>`;
  const values = { x: pose.x.toFixed(2), y: pose.y.toFixed(2), yaw: Math.round((pose.yaw * 180) / Math.PI) };
  return html`<span id="pose">${t("map.pose", values)}</span>
    ${quality !== null && html`<span>${t("map.quality", { percent: Math.round(100 * quality) })}</span>`}
    ${speed !== null && html`<span>${t("map.speed", { speed: speed.toFixed(2) })}</span>`}
    ${state.navigation?.text && html`<span lang="en">${state.navigation.text}</span>`}`;
}

function People({ state }) {
  const near = state.people?.near ?? [];
  const people = near.filter((item) => item.kind !== "object").length;
  const walking = near.filter((item) => item.kind === "walking").length;
  return html`<span id="people">${t("map.people", { people, walking, things: near.length - people })}</span>`;
}

function Zones({ site }) {
  if (!site) return null;
  return html`<span id="zones">${t("map.zones", { zones: site.zones.length, lanes: site.lanes.length })}</span>
    ${site.problem && html`<span class="problem" lang="en">${site.problem}</span>`}
    ${site.changed && html`<span id="zones-changed">${t("map.zones_changed")}</span>`}`;
}

// One finger: moves the map, or sets a place and, by dragging, a direction; a touch without a drag sets a zone's corner.
function touches(canvas, view, drag, tool, setWish, paint, link, addCorner) {
  const moves = tool === "look" || tool === "zone";
  const where = (event) => {
    const box = canvas.current.getBoundingClientRect();
    return view.current.toMap(canvas.current, event.clientX - box.left, event.clientY - box.top);
  };
  const wishAt = (start, end) => {
    const [dx, dy] = [end[0] - start[0], end[1] - start[1]];
    const pose = poseOf(link.state);
    const far = Math.hypot(dx, dy) >= LEAST_DRAG_M;
    const yaw = far ? Math.atan2(dy, dx) : tool === "goal" && pose ? Math.atan2(start[1] - pose.y, start[0] - pose.x) : pose?.yaw ?? 0;
    return { x: start[0], y: start[1], yaw };
  };
  return {
    onPointerDown: (event) => {
      canvas.current.setPointerCapture(event.pointerId);
      const start = where(event);
      drag.current = { start, at: [event.clientX, event.clientY], moved: false, wish: moves ? null : wishAt(start, start) };
      paint();
    },
    onPointerMove: (event) => {
      if (!drag.current) return;
      const now = where(event);
      if (moves) {
        drag.current.moved ||= Math.hypot(event.clientX - drag.current.at[0], event.clientY - drag.current.at[1]) > STILL_PX;
        if (tool === "zone" && !drag.current.moved) return;
        view.current.follows = false;
        view.current.x -= now[0] - drag.current.start[0];
        view.current.y -= now[1] - drag.current.start[1];
      } else {
        drag.current.wish = wishAt(drag.current.start, now);
      }
      paint();
    },
    onPointerUp: () => {
      if (drag.current?.wish) setWish(drag.current.wish);
      else if (tool === "zone" && drag.current && !drag.current.moved) {
        view.current.follows = false; // the map stays while a zone is drawn
        addCorner(drag.current.start);
      }
      drag.current = null;
    },
    onPointerCancel: () => { drag.current = null; paint(); },
  };
}
