// Docking: what the camera sees, which markers were found, how far it is to the target.

import { html, useEffect, useRef, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";

function drawMarkers(context, camera, markers, factor) {
  context.font = "bold 18px sans-serif";
  context.textAlign = "center";
  for (const marker of markers) {
    const [x, y, z] = marker.at;
    if (!camera || x === null || !(z > 0)) continue;
    const px = (camera.cx + (camera.fx * x) / z) * factor;
    const py = (camera.cy + (camera.fy * y) / z) * factor;
    context.strokeStyle = "#00d5ff";
    context.lineWidth = 3;
    context.strokeRect(px - 14, py - 14, 28, 28);
    context.fillStyle = "#00d5ff";
    context.fillText(String(marker.id), px, py - 20);
  }
}

async function drawImage(canvas, data, camera, markers) {
  const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, 4)], { type: "image/jpeg" }));
  if (canvas.width !== bitmap.width) [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
  const context = canvas.getContext("2d");
  context.drawImage(bitmap, 0, 0);
  drawMarkers(context, camera, markers, bitmap.width / (camera?.width ?? bitmap.width));
  bitmap.close();
}

function Undocking({ link, say }) {
  const [asked, setAsked] = useState(false);
  const undock = async () => {
    setAsked(false);
    say(await link.ask({ t: "undock" }));
  };
  if (!asked) return html`<div class="tools"><button id="undock" onClick=${() => setAsked(true)}>${t("docking.undock")}</button></div>`;
  return html`<div class="tools" role="alertdialog" aria-label=${t("docking.undock")}>
    <strong>${t("docking.undock_sure")}</strong>
    <button class="danger" id="undock-yes" onClick=${undock}>${t("docking.undock")}</button>
    <button onClick=${() => setAsked(false)}>${t("app.cancel")}</button>
  </div>`;
}

export function DockingPage({ link, state, say }) {
  const canvas = useRef(null);
  const [camera, setCamera] = useState("front");
  useEffect(() => {
    const layer = `${camera}_image`;
    const frame = `${camera}_camera`;
    link.onFrame[layer] = (data) => canvas.current && drawImage(
      canvas.current, data, link.state.site?.cameras?.[frame], (link.state.markers?.seen ?? []).filter((item) => item.camera === frame));
    link.show(["markers", layer]);
    return () => { delete link.onFrame[layer]; };
  }, [camera]);
  const docking = state.docking ?? { state: "UNKNOWN" };
  const value = (number, unit, digits) => (number === null || number === undefined ? t("app.unknown") : `${number.toFixed(digits)} ${unit}`);
  const rows = [
    ["docking.state", t(`dock.${docking.state}`)],
    ["docking.position", value(docking.position_mm, "mm", 1)],
    ["docking.yaw", value(docking.yaw_deg, "°", 2)],
    ["docking.markers", docking.markers ?? t("app.unknown")],
    ["docking.progress", docking.progress === null || docking.progress === undefined ? t("app.unknown") : `${Math.round(100 * docking.progress)} %`],
  ];
  return html`<section class="page docking" data-page="docking">
    <div class="toolbar">
      <h2>${t("docking.title")}</h2>
      <div class="tools" role="group" aria-label=${t("docking.title")}>
        ${["front", "rear"].map((name) => html`
          <button id=${`camera-${name}`} aria-pressed=${camera === name} onClick=${() => setCamera(name)}>${t(`docking.${name}`)}</button>`)}
      </div>
    </div>
    ${(docking.state === "DOCKED" || state.ride?.passenger) && html`<${Undocking} link=${link} say=${say} />`}
    <div class="docking-view">
      <canvas ref=${canvas} id="camera" width="640" height="360" role="img" aria-label=${t("docking.image")}></canvas>
      <dl>${rows.map(([key, text]) => html`<div><dt>${t(key)}</dt><dd>${text}</dd></div>`)}</dl>
    </div>
  </section>`;
}
