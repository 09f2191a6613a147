// What is drawn on maps: background, costmap, obstacles, plan, robot.

// Where what lies on the screen. scale: pixels per metre. x, y: the place in map that is in the middle.
export class View {
  constructor() {
    this.x = 0;
    this.y = 0;
    this.scale = 24;
    this.follows = true;
  }

  toScreen(canvas, x, y) {
    return [canvas.width / 2 + (x - this.x) * this.scale, canvas.height / 2 - (y - this.y) * this.scale];
  }

  toMap(canvas, px, py) {
    return [this.x + (px - canvas.width / 2) / this.scale, this.y - (py - canvas.height / 2) / this.scale];
  }
}

const COSTS = costColours();

// Free is clear, inflated is amber, lethal is red; unknown is not painted.
function costColours() {
  const table = new Uint32Array(256);
  for (let cost = 1; cost <= 100; cost += 1) {
    const alpha = Math.round(30 + 1.2 * cost);
    const [r, g, b] = cost >= 99 ? [155, 17, 22] : [214, 140, 30];
    table[cost] = (alpha << 24) | (b << 16) | (g << 8) | r;
  }
  return table;
}

export function readCostmap(data) {
  const view = new DataView(data);
  const [columns, rows] = [view.getUint16(4, true), view.getUint16(6, true)];
  const picture = new ImageData(columns, rows);
  const pixels = new Uint32Array(picture.data.buffer);
  const costs = new Uint8Array(data, 24);
  for (let i = 0; i < costs.length; i += 1) pixels[i] = COSTS[costs[i]];
  const canvas = new OffscreenCanvas(columns, rows);
  canvas.getContext("2d").putImageData(picture, 0, 0);
  return { canvas, cell: view.getFloat32(8, true), x: view.getFloat32(12, true), y: view.getFloat32(16, true), yaw: view.getFloat32(20, true) };
}

export function readObstacles(data) {
  const view = new DataView(data);
  const count = view.getUint32(16, true);
  return { x: view.getFloat32(4, true), y: view.getFloat32(8, true), yaw: view.getFloat32(12, true), cm: new Int16Array(data, 20, 2 * count) };
}

// Calls paint with the context turned so that it draws in metres, x forward and y left, at a pose in map.
export function at(context, canvas, view, pose, paint) {
  const [px, py] = view.toScreen(canvas, pose.x, pose.y);
  context.save();
  context.translate(px, py);
  context.scale(view.scale, -view.scale);
  context.rotate(pose.yaw);
  paint();
  context.restore();
}

export function drawBackground(context, canvas, view, site, picture) {
  context.fillStyle = "#d1dae2";
  context.fillRect(0, 0, canvas.width, canvas.height);
  if (!site?.map || !picture.complete || !picture.naturalWidth) return;
  const [px, py] = view.toScreen(canvas, site.map.x, site.map.y + site.map.height);
  context.imageSmoothingEnabled = false;
  context.drawImage(picture, px, py, site.map.width * view.scale, site.map.height * view.scale);
}

const ZONES = { keepout: "#9b1116", speed: "#0b4a63", one_way: "#1f5f2c", door: "#5b2a86" };

const LANE = "#5b1a8a";
const DRAWN = "#8a3b00";
const WRONG = "#9b1116";

// The lanes of the route graph, with an arrow in each direction in which they are driven. names: also ids, limits, nodes.
export function drawLanes(context, canvas, view, lanes, names) {
  for (const { id, ends: [ax, ay, bx, by], both, speed } of lanes?.list ?? []) {
    const [[px, py], [qx, qy]] = [view.toScreen(canvas, ax, ay), view.toScreen(canvas, bx, by)];
    drawLane(context, px, py, qx, qy, both, LANE, 2);
    if (names) drawLabel(context, (px + qx) / 2, (py + qy) / 2, speed === null ? id : `${id}: ${speed} m/s`, LANE);
  }
  for (const [x, y] of names ? lanes?.nodes ?? [] : []) drawDot(context, view.toScreen(canvas, x, y), 6, LANE);
  for (const { at: [x, y] } of lanes?.wrong ?? []) drawCross(context, view.toScreen(canvas, x, y));
}

function drawLane(context, px, py, qx, qy, both, colour, width) {
  const [dx, dy] = [qx - px, qy - py];
  const share = Math.max(0, 1 - 9 / Math.hypot(dx, dy)); // the head ends at the node
  drawArrow(context, px, py, share * dx, share * dy, colour, width);
  if (both) drawArrow(context, qx, qy, -share * dx, -share * dy, colour, width);
}

function drawDot(context, [px, py], radius, colour) {
  context.beginPath();
  context.arc(px, py, radius, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
}

// What is wrong at a place.
function drawCross(context, [px, py]) {
  context.beginPath();
  for (const side of [-9, 9]) {
    context.moveTo(px - 9, py - side);
    context.lineTo(px + 9, py + side);
  }
  context.strokeStyle = WRONG;
  context.lineWidth = 5;
  context.stroke();
}

function drawLabel(context, px, py, text, colour) {
  context.font = "600 16px sans-serif";
  context.textAlign = "center";
  context.strokeStyle = "#ffffff";
  context.lineWidth = 4;
  context.strokeText(text, px, py - 6);
  context.fillStyle = colour;
  context.fillText(text, px, py - 6);
}

// The points of a lane that is being drawn, and where it is wrong.
export function drawNewLane(context, canvas, view, points, both, wrong) {
  const places = points.map(([x, y]) => view.toScreen(canvas, x, y));
  places.slice(1).forEach(([qx, qy], index) => drawLane(context, ...places[index], qx, qy, both, DRAWN, 4));
  for (const place of places) drawDot(context, place, 7, DRAWN);
  for (const { at: [x, y] } of wrong) drawCross(context, view.toScreen(canvas, x, y));
}

// Where the keyboard sets a point: the map's middle.
export function drawAim(context, canvas) {
  const [px, py] = [canvas.width / 2, canvas.height / 2];
  context.beginPath();
  for (const [dx, dy] of [[14, 0], [0, 14]]) {
    context.moveTo(px - dx, py - dy);
    context.lineTo(px + dx, py + dy);
  }
  context.strokeStyle = DRAWN;
  context.lineWidth = 3;
  context.stroke();
}

// Zones with their name and limit, one-way zones with an arrow.
export function drawZones(context, canvas, view, site) {
  for (const zone of site?.zones ?? []) {
    context.beginPath();
    for (const ring of zone.rings) {
      ring.forEach(([x, y], index) => context[index ? "lineTo" : "moveTo"](...view.toScreen(canvas, x, y)));
      context.closePath();
    }
    context.fillStyle = ZONES[zone.type];
    context.globalAlpha = 0.18;
    context.fill("evenodd");
    context.globalAlpha = 1;
    context.strokeStyle = ZONES[zone.type];
    context.lineWidth = 3;
    context.stroke();
    const corners = zone.rings[0].slice(1);
    const [x, y] = [0, 1].map((axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
    const [px, py] = view.toScreen(canvas, x, y);
    if (zone.yaw !== null) drawArrow(context, px, py, Math.cos(zone.yaw) * view.scale, -Math.sin(zone.yaw) * view.scale, ZONES.one_way);
    drawLabel(context, px, py - 6, zone.speed === null ? zone.name : `${zone.name} ${zone.speed} m/s`, ZONES[zone.type]);
  }
}

// The corners of a zone that is being drawn, and the direction of a one-way zone.
export function drawCorners(context, canvas, view, corners, kind) {
  if (!corners.length) return;
  const points = corners.map(([x, y]) => view.toScreen(canvas, x, y));
  context.beginPath();
  for (const point of points) context.lineTo(...point);
  context.closePath();
  context.strokeStyle = context.fillStyle = DRAWN;
  context.lineWidth = 4;
  context.stroke();
  for (const [px, py] of points) context.fillRect(px - 6, py - 6, 12, 12);
  if (kind !== "one_way" || points.length < 2) return;
  const [[ax, ay], [bx, by]] = points;
  drawArrow(context, ax, ay, bx - ax, by - ay, ZONES.one_way);
}

export function drawPlan(context, canvas, view, points) {
  if (!points?.length) return;
  context.beginPath();
  for (const [x, y] of points) context.lineTo(...view.toScreen(canvas, x, y));
  context.strokeStyle = "#0b4a63";
  context.lineWidth = 5;
  context.lineJoin = "round";
  context.stroke();
  const [px, py] = view.toScreen(canvas, ...points[points.length - 1]);
  context.beginPath();
  context.arc(px, py, 9, 0, 2 * Math.PI);
  context.fillStyle = "#0b4a63";
  context.fill();
}

export function drawObstacles(context, canvas, view, cloud) {
  at(context, canvas, view, cloud, () => {
    context.fillStyle = "#5b1a8a";
    const size = 3 / view.scale;
    for (let i = 0; i < cloud.cm.length; i += 2) context.fillRect(cloud.cm[i] / 100, cloud.cm[i + 1] / 100, size, size);
  });
}

const PEOPLE = { walking: "#a34700", person: "#a34700", object: "#4a5a64" };

// As far around as it is wide; an arrow to where who walks will be in a second.
export function drawPeople(context, canvas, view, near) {
  for (const { kind, at: [x, y], radius, speed: [vx, vy] } of near) {
    const [px, py] = view.toScreen(canvas, x, y);
    context.beginPath();
    context.arc(px, py, Math.max(5, radius * view.scale), 0, 2 * Math.PI);
    context.fillStyle = PEOPLE[kind];
    context.globalAlpha = 0.75;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = "#ffffff";
    context.lineWidth = 2;
    context.stroke();
    if (kind === "walking") drawArrow(context, px, py, vx * view.scale, -vy * view.scale, PEOPLE.walking);
  }
}

function drawArrow(context, px, py, dx, dy, colour, width = 5) {
  const length = Math.hypot(dx, dy);
  if (length < 4) return;
  context.save();
  context.translate(px, py);
  context.rotate(Math.atan2(dy, dx));
  context.beginPath();
  context.moveTo(0, 0);
  context.lineTo(length, 0);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
  context.beginPath();
  context.moveTo(length + 9, 0);
  context.lineTo(length - 4, 8);
  context.lineTo(length - 4, -8);
  context.fillStyle = colour;
  context.fill();
  context.restore();
}

export function drawRobot(context, canvas, view, pose, footprint, colour) {
  at(context, canvas, view, pose, () => {
    const { front, rear, width } = footprint;
    context.beginPath();
    context.roundRect(rear, -width / 2, front - rear, width, 0.12);
    context.fillStyle = colour;
    context.fill();
    context.lineWidth = 2 / view.scale;
    context.strokeStyle = "#ffffff";
    context.stroke();
    context.beginPath();
    context.moveTo(front - 0.1, 0);
    context.lineTo(front - 0.45, 0.22);
    context.lineTo(front - 0.45, -0.22);
    context.fillStyle = "#ffffff";
    context.fill();
  });
}

export function poseOf(state) {
  const pose = state.place?.pose;
  return pose && pose[0] !== null ? { x: pose[0], y: pose[1], yaw: pose[2] } : null;
}
