// Manual drive: a dead-man pad. It drives while a finger is on it, and not a moment longer.

import { html, useEffect, useRef, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";

const PERIOD_MS = 50;
const DEAD = 0.08; // a resting finger is no command

function deflection(pad, event) {
  const box = pad.getBoundingClientRect();
  const side = ((event.clientX - box.left) / box.width) * 2 - 1;
  const ahead = 1 - ((event.clientY - box.top) / box.height) * 2;
  const length = Math.max(1, Math.hypot(side, ahead));
  const clean = (value) => (Math.abs(value / length) < DEAD ? 0 : value / length);
  return { ahead: clean(ahead), side: clean(side) };
}

export function DrivePage({ link, state, say }) {
  const pad = useRef(null);
  const finger = useRef(null);
  const mode = useRef("turn");
  const [, redraw] = useState(0);
  const [modeShown, setMode] = useState("turn");
  mode.current = modeShown;

  const lift = () => {
    if (!finger.current) return;
    finger.current = null;
    link.send({ t: "lift" });
    redraw((turn) => turn + 1);
  };
  const send = () => {
    if (!finger.current) return;
    const { ahead, side } = finger.current;
    const turns = mode.current === "turn";
    link.send({ t: "pad", x: ahead, y: turns ? 0 : -side, turn: turns ? -side : 0, at_ms: performance.now() });
  };
  useEffect(() => {
    const timer = setInterval(send, PERIOD_MS);
    const hidden = () => document.visibilityState !== "visible" && lift();
    document.addEventListener("visibilitychange", hidden);
    for (const name of ["blur", "pagehide"]) window.addEventListener(name, lift);
    link.show([]);
    return () => {
      lift();
      clearInterval(timer);
      document.removeEventListener("visibilitychange", hidden);
      for (const name of ["blur", "pagehide"]) window.removeEventListener(name, lift);
    };
  }, []);
  useEffect(() => { if (link.lost) lift(); });

  const move = (event) => { finger.current = deflection(pad.current, event); redraw((turn) => turn + 1); };
  const press = (event) => {
    pad.current.setPointerCapture(event.pointerId);
    move(event);
    send();
    if (state.access?.pad === "busy") say({ ok: false, why: "answer.pad_busy" });
  };
  const { ahead = 0, side = 0 } = finger.current ?? {};
  const emergency = state.safety?.emergency;
  return html`<section class="page drive" data-page="drive">
    <div class="drive-text">
      <h2>${t("drive.title")}</h2>
      <p class="large">${emergency ? t("drive.emergency") : t("drive.hint")}</p>
      <div class="tools" role="group" aria-label=${t("drive.mode")}>
        <button id="mode-turn" aria-pressed=${modeShown === "turn"} onClick=${() => setMode("turn")}>${t("drive.turn")}</button>
        <button id="mode-side" aria-pressed=${modeShown === "side"} onClick=${() => setMode("side")}>${t("drive.sideways")}</button>
      </div>
      <p class="speed">${t("drive.now", { speed: (state.place?.speed_mps ?? 0).toFixed(2) })}</p>
      <p>${state.safety?.limit_mps === null || state.safety?.limit_mps === undefined ? null : t("drive.limit", { speed: state.safety.limit_mps.toFixed(2) })}</p>
    </div>
    <div id="pad" class=${finger.current ? "pad held" : "pad"} ref=${pad} role="application" aria-label=${t("drive.pad")}
      onPointerDown=${press} onPointerMove=${(event) => finger.current && move(event)}
      onPointerUp=${lift} onPointerCancel=${lift} onLostPointerCapture=${lift} onContextMenu=${(event) => event.preventDefault()}>
      <div class="knob" style=${{ left: `${50 + 38 * side}%`, top: `${50 - 38 * ahead}%` }}></div>
    </div>
  </section>`;
}
