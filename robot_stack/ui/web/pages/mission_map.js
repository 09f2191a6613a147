// A mission on the map: its stops in order, the docks, the robot. A touch chooses a stop or sets a place.

import { html, useEffect, useRef } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";
import { View, drawBackground, drawRobot, poseOf } from "/map_draw.js";

const REACH_PX = 28;
const LEAST_DRAG_M = 0.3;
const ROUTE = "#0b4a63";
const CHOSEN = "#8a3b00";

const drawable = (place) => Number.isFinite(place?.x) && Number.isFinite(place?.y);

function drawRoute(context, canvas, view, stops) {
  context.beginPath();
  for (const stop of stops.filter(drawable)) context.lineTo(...view.toScreen(canvas, stop.x, stop.y));
  context.strokeStyle = ROUTE;
  context.lineWidth = 3;
  context.setLineDash([8, 6]);
  context.stroke();
  context.setLineDash([]);
}

function drawStop(context, canvas, view, place, label, colour) {
  if (!drawable(place)) return;
  const [px, py] = view.toScreen(canvas, place.x, place.y);
  const yaw = Number.isFinite(place.yaw) ? place.yaw : 0;
  context.strokeStyle = colour;
  context.fillStyle = colour;
  context.lineWidth = 4;
  context.beginPath();
  context.moveTo(px, py);
  context.lineTo(px + 26 * Math.cos(yaw), py - 26 * Math.sin(yaw));
  context.stroke();
  context.beginPath();
  context.arc(px, py, 13, 0, 2 * Math.PI);
  context.fill();
  context.fillStyle = "#ffffff";
  context.font = "bold 14px sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(label, px, py);
}

function fit(view, canvas, places) {
  const known = places.filter(drawable);
  if (!known.length || !canvas.width) return;
  const [xs, ys] = [known.map((item) => item.x), known.map((item) => item.y)];
  const [width, height] = [Math.max(...xs) - Math.min(...xs) + 4, Math.max(...ys) - Math.min(...ys) + 4];
  view.scale = Math.min(48, Math.max(4, Math.min(canvas.width / width, canvas.height / height)));
  [view.x, view.y] = [(Math.max(...xs) + Math.min(...xs)) / 2, (Math.max(...ys) + Math.min(...ys)) / 2];
}

function draw(canvas, view, picture, state, draft, docks, chosen, wish) {
  const context = canvas.getContext("2d");
  drawBackground(context, canvas, view, state.site, picture);
  drawRoute(context, canvas, view, draft.waypoints);
  for (const dock of docks) drawStop(context, canvas, view, dock, "D", "#4a5a64");
  drawStop(context, canvas, view, draft.home, "H", chosen === "home" ? CHOSEN : "#1d6b36");
  draft.waypoints.forEach((stop, index) => index !== chosen && drawStop(context, canvas, view, stop, String(index + 1), ROUTE));
  if (draft.waypoints[chosen]) drawStop(context, canvas, view, draft.waypoints[chosen], String(chosen + 1), CHOSEN);
  const pose = poseOf(state);
  const footprint = state.site?.footprint; // nothing is drawn of a robot of unknown size
  if (pose && footprint) drawRobot(context, canvas, view, pose, footprint, "#33454f");
  if (wish && footprint) drawRobot(context, canvas, view, wish, footprint, CHOSEN);
}

// placing: what a touch sets, or null: then it chooses, and a drag moves the map. onPlace takes {x, y, yaw}.
export function MissionMap({ link, draft, docks, chosen, choose, placing, onPlace }) {
  const canvas = useRef(null);
  const view = useRef(new View());
  const picture = useRef(new Image());
  const drag = useRef(null);
  const props = useRef({});
  props.current = { draft, docks, chosen };
  const paint = () => canvas.current && draw(canvas.current, view.current, picture.current, link.state,
    props.current.draft, props.current.docks, props.current.chosen, drag.current?.wish);
  useEffect(() => {
    picture.current.onload = paint;
    picture.current.src = "/map.png";
    let fitted = false;
    const size = new ResizeObserver(() => {
      canvas.current.width = canvas.current.clientWidth;
      canvas.current.height = canvas.current.clientHeight;
      if (!fitted) fit(view.current, canvas.current, [draft.home, ...draft.waypoints]);
      fitted = true;
      paint();
    });
    size.observe(canvas.current);
    return () => size.disconnect();
  }, []);
  useEffect(paint);
  const zoom = (factor) => { view.current.scale = Math.min(120, Math.max(4, view.current.scale * factor)); paint(); };
  const touch = touches({ canvas, view, drag, paint, placing, onPlace, choose, draft });
  return html`<div class="map-area">
    <canvas ref=${canvas} id="mission-map" class="map-canvas" role="img" aria-label=${t("missions.canvas")} ...${touch}></canvas>
    <div class="zoom">
      <button aria-label=${t("map.closer")} onClick=${() => zoom(1.4)}>+</button>
      <button aria-label=${t("map.farther")} onClick=${() => zoom(1 / 1.4)}>−</button>
    </div>
    ${placing && html`<p class="map-hint" role="status">${t("missions.touch_map")}</p>`}
  </div>`;
}

function touches({ canvas, view, drag, paint, placing, onPlace, choose, draft }) {
  const pixel = (event) => {
    const box = canvas.current.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const wishAt = (start, end) => {
    const [dx, dy] = [end[0] - start[0], end[1] - start[1]];
    return { x: start[0], y: start[1], yaw: Math.hypot(dx, dy) >= LEAST_DRAG_M ? Math.atan2(dy, dx) : placing.yaw };
  };
  const nearest = (px, py) => {
    const away = draft.waypoints.map((stop) => {
      const [x, y] = view.current.toScreen(canvas.current, stop.x, stop.y);
      return Math.hypot(x - px, y - py);
    });
    const index = away.indexOf(Math.min(...away));
    return away[index] <= REACH_PX ? index : null;
  };
  return {
    onPointerDown: (event) => {
      canvas.current.setPointerCapture(event.pointerId);
      const at = pixel(event);
      const start = view.current.toMap(canvas.current, ...at);
      drag.current = { at, start, moved: false, wish: placing ? wishAt(start, start) : null };
      paint();
    },
    onPointerMove: (event) => {
      if (!drag.current) return;
      const at = pixel(event);
      drag.current.moved ||= Math.hypot(at[0] - drag.current.at[0], at[1] - drag.current.at[1]) > 8;
      const now = view.current.toMap(canvas.current, ...at);
      if (placing) drag.current.wish = wishAt(drag.current.start, now);
      else if (drag.current.moved) {
        view.current.x -= now[0] - drag.current.start[0];
        view.current.y -= now[1] - drag.current.start[1];
      }
      paint();
    },
    onPointerUp: () => {
      const done = drag.current;
      drag.current = null;
      if (done?.wish) onPlace(done.wish);
      else if (done && !done.moved) {
        const index = nearest(...done.at);
        if (index !== null) choose(index);
      }
      paint();
    },
    onPointerCancel: () => { drag.current = null; paint(); },
  };
}
