// The site's map with the robots, and the nodes left of the selected robot's order.

import { html, useEffect, useRef } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";
import { View, drawBackground } from "/map_draw.js";

const RADIUS = 13; // pixels: a robot is seen, however small the map is drawn
const TOUCH = 30;
export const COLOURS = { good: "#1c6b3c", warn: "#8a5b00", bad: "#9b1116", off: "#4a5a64" };

// Robots with a position on this map.
export function placed(robots, site) {
  return robots.filter(({ robot }) => robot.pose && robot.map === site.map.id);
}

function fit(canvas, view, map) {
  view.x = map.x + map.width / 2;
  view.y = map.y + map.height / 2;
  view.scale = Math.max(0.5, Math.min(canvas.width / map.width, canvas.height / map.height));
}

function drawWay(context, canvas, view, way) {
  const points = way.map(([x, y]) => view.toScreen(canvas, x, y));
  context.strokeStyle = context.fillStyle = "#0b4a63";
  context.lineWidth = 3;
  context.beginPath();
  for (const point of points) context.lineTo(...point);
  context.stroke();
  points.forEach(([px, py], i) => {
    context.beginPath();
    context.arc(px, py, 7, 0, 2 * Math.PI);
    context.fillStyle = way[i][2] ? "#0b4a63" : "#ffffff"; // hollow: not released
    context.fill();
    context.stroke();
  });
}

function drawMarker(context, [px, py], robot, colour, selected) {
  context.save();
  context.translate(px, py);
  context.beginPath();
  context.arc(0, 0, RADIUS, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
  context.lineWidth = selected ? 5 : 2;
  context.strokeStyle = selected ? "#c25a00" : "#ffffff";
  context.stroke();
  if (robot.loaded) {
    context.fillStyle = "#ffffff";
    context.fillRect(-5, -5, 10, 10);
  }
  context.textAlign = "center";
  context.font = "700 14px sans-serif";
  context.lineWidth = 3;
  context.strokeStyle = "#ffffff";
  context.strokeText(robot.serial, 0, RADIUS + 16);
  context.fillStyle = "#12212b";
  context.fillText(robot.serial, 0, RADIUS + 16);
  if (robot.pose[2] !== null) {
    context.rotate(-robot.pose[2]);
    context.beginPath();
    context.moveTo(RADIUS + 11, 0);
    context.lineTo(RADIUS + 1, 7);
    context.lineTo(RADIUS + 1, -7);
    context.fillStyle = colour;
    context.fill();
  }
  context.restore();
}

export function FleetMap({ site, robots, selected, select, kindOf }) {
  const canvas = useRef(null);
  const view = useRef(null);
  const picture = useRef(new Image());
  const drag = useRef(null);
  const latest = useRef({});
  latest.current = { robots, selected };
  const paint = () => {
    if (!canvas.current?.width) return;
    if (!view.current) {
      view.current = new View();
      fit(canvas.current, view.current, site.map);
    }
    const context = canvas.current.getContext("2d");
    drawBackground(context, canvas.current, view.current, site, picture.current);
    const shown = placed(latest.current.robots, site);
    const chosen = shown.find(({ prefix }) => prefix === latest.current.selected);
    if (chosen) drawWay(context, canvas.current, view.current, chosen.robot.way);
    for (const { prefix, robot } of [...shown.filter((item) => item !== chosen), ...(chosen ? [chosen] : [])]) {
      const place = view.current.toScreen(canvas.current, robot.pose[0], robot.pose[1]);
      drawMarker(context, place, robot, COLOURS[kindOf(robot)], prefix === latest.current.selected);
    }
  };
  useEffect(() => {
    picture.current.onload = paint;
    picture.current.src = "/map.png";
    const size = new ResizeObserver(() => {
      canvas.current.width = canvas.current.clientWidth;
      canvas.current.height = canvas.current.clientHeight;
      if (view.current?.follows) view.current = null;
      paint();
    });
    size.observe(canvas.current);
    return () => size.disconnect();
  }, []);
  useEffect(paint);

  const zoom = (factor) => {
    view.current.follows = false;
    view.current.scale = Math.min(200, Math.max(0.2, view.current.scale * factor));
    paint();
  };
  const nearest = (px, py) => {
    const far = placed(robots, site).map(({ prefix, robot }) => {
      const [x, y] = view.current.toScreen(canvas.current, robot.pose[0], robot.pose[1]);
      return [Math.hypot(x - px, y - py), prefix];
    }).sort((a, b) => a[0] - b[0])[0];
    if (far && far[0] < TOUCH) select(far[1]);
  };
  const touch = {
    onPointerDown: (event) => {
      canvas.current.setPointerCapture(event.pointerId);
      drag.current = { x: event.clientX, y: event.clientY, moved: 0 };
    },
    onPointerMove: (event) => {
      if (!drag.current) return;
      const [dx, dy] = [event.clientX - drag.current.x, event.clientY - drag.current.y];
      drag.current = { x: event.clientX, y: event.clientY, moved: drag.current.moved + Math.hypot(dx, dy) };
      if (drag.current.moved < 6) return;
      view.current.follows = false;
      view.current.x -= dx / view.current.scale;
      view.current.y += dy / view.current.scale;
      paint();
    },
    onPointerUp: (event) => {
      const box = canvas.current.getBoundingClientRect();
      if (drag.current?.moved < 6) nearest(event.clientX - box.left, event.clientY - box.top);
      drag.current = null;
    },
    onPointerCancel: () => { drag.current = null; },
  };
  return html`<div class="map-area">
    <canvas ref=${canvas} id="map" role="img" aria-label=${t("fleet.map")} ...${touch}></canvas>
    <div class="zoom">
      <button aria-label=${t("map.closer")} onClick=${() => zoom(1.4)}>+</button>
      <button aria-label=${t("map.farther")} onClick=${() => zoom(1 / 1.4)}>−</button>
      <button aria-label=${t("fleet.whole_map")} onClick=${() => { view.current = null; paint(); }}>◎</button>
    </div>
  </div>`;
}
