// The map: background, costmap, obstacles, plan, robot; poses and goals by touch.

import { html, useEffect, useRef, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";
import { LaneForm } from "/pages/lane_form.js";
import { ZoneForm } from "/pages/zone_form.js";
import {
  View, at, drawAim, drawBackground, drawCorners, drawLanes, drawNewLane, drawObstacles, drawPeople, drawPlan, drawRobot, drawZones,
  poseOf, readCostmap, readObstacles,
} from "/map_draw.js";

const LAYERS = ["plan", "costmap", "obstacles", "people", "zones"];
const LEAST_DRAG_M = 0.3;
const MOST_POINTS = 64;
const LEAST_SIDE_M = 0.3; // a corner nearer to the one before is a double touch
const STILL_PX = 8; // a finger that moves less has not dragged
const SNAP_PX = 24; // a point nearer to a node is the node
const KEY_PX = 24; // an arrow key moves the map
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const NO_LANE = { points: [], both: true, speed: null, wrong: [] };

function draw(canvas, view, layers, state, picture, wish, { tool, corners, kind, lane }) {
  const context = canvas.getContext("2d");
  const pose = poseOf(state);
  if (view.follows && pose) [view.x, view.y] = [pose.x, pose.y];
  drawBackground(context, canvas, view, state.site, picture);
  drawZones(context, canvas, view, state.zones);
  drawLanes(context, canvas, view, state.zones?.lanes, tool === "lane");
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
  drawNewLane(context, canvas, view, lane.points, lane.both, lane.wrong);
  const footprint = state.site?.footprint; // nothing is drawn of a robot of unknown size
  if (pose && footprint) drawRobot(context, canvas, view, pose, footprint, "#0b4a63");
  if (wish && footprint) drawRobot(context, canvas, view, wish, footprint, "#8a3b00");
  if (drawsPoints(tool) && canvas.matches(":focus-visible")) drawAim(context, canvas);
}

const drawsPoints = (tool) => tool === "zone" || tool === "lane";

export function MapPage({ link, state, say }) {
  const canvas = useRef(null);
  const view = useRef(new View());
  const layers = useRef({});
  const picture = useRef(new Image());
  const [tool, setTool] = useState("look");
  const [wish, setWish] = useState(null);
  const [corners, setCorners] = useState([]);
  const [kind, setKind] = useState("keepout"); // of a new zone
  const [lane, setLane] = useState(NO_LANE);
  const drag = useRef(null);
  const chosen = useRef({}); // frames are painted by the first render's function
  chosen.current = { wish, tool, corners, kind, lane };
  const paint = () => canvas.current && draw(canvas.current, view.current, layers.current, link.state, picture.current,
    drag.current?.wish ?? chosen.current.wish, chosen.current);

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

  const choose = (name) => { setTool(name); setWish(null); setCorners([]); setKind("keepout"); setLane(NO_LANE); };
  const send = async () => {
    say(await link.ask({ t: tool, x: wish.x, y: wish.y, yaw: wish.yaw }));
    choose("look");
  };
  const zoom = (factor) => { view.current.scale = Math.min(120, Math.max(4, view.current.scale * factor)); paint(); };
  const changeLane = (values) => setLane((before) => ({ ...before, ...values }));
  const added = (before, [x, y]) => {
    const last = before[before.length - 1];
    const twice = last && Math.hypot(x - last[0], y - last[1]) < LEAST_SIDE_M;
    return twice || before.length >= MOST_POINTS ? before : [...before, [x, y]];
  };
  const addPoint = (point) => {
    if (tool === "zone") setCorners((before) => added(before, point));
    else setLane((before) => ({ ...before, points: added(before.points, nodeNear(view.current, [...(link.state.zones?.lanes?.nodes ?? []), ...before.points], point)) }));
  };
  const touch = touches(canvas, view, drag, tool, setWish, paint, link, addPoint);
  return html`<section class="page map" data-page="map">
    <div class="toolbar">
      <h2>${t("map.title")}</h2>
      <div class="tools" role="group" aria-label=${t("map.title")}>
        <button id="tool-look" aria-pressed=${tool === "look"} onClick=${() => choose("look")}>${t("map.look")}</button>
        <button id="tool-pose" aria-pressed=${tool === "pose"} onClick=${() => choose("pose")}>${t("map.set_pose")}</button>
        <button id="tool-goal" aria-pressed=${tool === "goal"} onClick=${() => choose("goal")}>${t("map.goal")}</button>
        <button id="tool-zone" aria-pressed=${tool === "zone"} onClick=${() => choose("zone")}>${t("map.zone")}</button>
        <button id="tool-lane" aria-pressed=${tool === "lane"} onClick=${() => choose("lane")}>${t("map.lane")}</button>
        <button id="cancel-goal" onClick=${async () => say(await link.ask({ t: "cancel_goal" }))}>${t("map.cancel_goal")}</button>
      </div>
    </div>
    <div class="map-row">
    <div class="map-area">
      <canvas ref=${canvas} id="map" role="application" tabindex="0" aria-label=${t("map.canvas")} onFocus=${paint} onBlur=${paint} ...${touch}></canvas>
      <div class="zoom">
        <button aria-label=${t("map.closer")} onClick=${() => zoom(1.4)}>+</button>
        <button aria-label=${t("map.farther")} onClick=${() => zoom(1 / 1.4)}>−</button>
        <button aria-label=${t("map.follow")} onClick=${() => { view.current.follows = true; paint(); }}>◎</button>
      </div>
      <${Hint} tool=${tool} wish=${wish} send=${send} cancel=${() => choose("look")} />
    </div>
    ${tool === "zone" && html`<${ZoneForm} link=${link} site=${state.zones} say=${say} corners=${corners} setCorners=${setCorners} kind=${kind} setKind=${setKind} close=${() => choose("look")} />`}
    ${tool === "lane" && html`<${LaneForm} link=${link} state=${state} say=${say} draft=${lane} change=${changeLane} addPoint=${addPoint} close=${() => choose("look")} />`}
    </div>
    <p class="figures"><${Place} state=${state} /><${People} state=${state} /><${Zones} site=${state.zones} /></p>
  </section>`;
}

function Hint({ tool, wish, send, cancel }) {
  if (tool === "look" || drawsPoints(tool)) return null;
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
  return html`<span id="zones">${t("map.zones", { zones: site.zones.length, lanes: site.lanes.list.length })}</span>
    ${[site.problem, site.lanes.problem].map((problem) => problem && html`<span class="problem" lang="en">${problem}</span>`)}
    ${site.lanes.wrong.length > 0 && html`<span class="problem" id="lanes-wrong">${t("map.lanes_wrong", { count: site.lanes.wrong.length })}</span>`}
    ${(site.changed || site.lanes.changed) && html`<span id="zones-changed">${t("map.zones_changed")}</span>`}`;
}

function nodeNear(view, nodes, [x, y]) {
  const away = ([nx, ny]) => view.scale * Math.hypot(nx - x, ny - y);
  return nodes.filter((node) => away(node) < SNAP_PX).sort((a, b) => away(a) - away(b))[0] ?? [x, y];
}

// One finger: moves the map, or sets a place and, by dragging, a direction; a touch without a drag sets a point of a zone
// or a lane. Keys: arrows move the map, Enter sets a point at its middle.
function touches(canvas, view, drag, tool, setWish, paint, link, addPoint) {
  const moves = tool === "look" || drawsPoints(tool);
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
        if (drawsPoints(tool) && !drag.current.moved) return;
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
      else if (drawsPoints(tool) && drag.current && !drag.current.moved) {
        view.current.follows = false; // the map stays while a zone or a lane is drawn
        addPoint(drag.current.start);
      }
      drag.current = null;
    },
    onPointerCancel: () => { drag.current = null; paint(); },
    onKeyDown: (event) => {
      const arrow = ARROWS[event.key];
      if (!arrow && !(event.key === "Enter" && drawsPoints(tool))) return;
      event.preventDefault();
      view.current.follows = false;
      if (arrow) {
        view.current.x += (arrow[0] * KEY_PX) / view.current.scale;
        view.current.y += (arrow[1] * KEY_PX) / view.current.scale;
      } else addPoint([view.current.x, view.current.y]);
      paint();
    },
  };
}
