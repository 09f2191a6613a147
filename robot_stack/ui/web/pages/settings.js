// What this screen remembers by itself: for eyes and hands.

import { html, useEffect } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";

const CHOICES = { text: ["normal", "large"], contrast: ["light", "sun"], hand: ["right", "left"] };

function chosen(name) {
  const kept = localStorage.getItem(`touch_ui.${name}`);
  return CHOICES[name].includes(kept) ? kept : CHOICES[name][0];
}

export function applySettings() {
  for (const name of Object.keys(CHOICES)) document.documentElement.dataset[name] = chosen(name);
}

export function SettingsPage({ link, change }) {
  useEffect(() => { link.show([]); }, []);
  const choose = (name, value) => {
    localStorage.setItem(`touch_ui.${name}`, value);
    applySettings();
    change();
  };
  const group = (name, label) => html`<div class="setting">
    <h3>${label}</h3>
    <div class="tools" role="group" aria-label=${label}>
      ${CHOICES[name].map((value) => html`<button data-choice=${`${name}-${value}`} aria-pressed=${chosen(name) === value}
        onClick=${() => choose(name, value)}>${t(`settings.${value}`)}</button>`)}
    </div>
  </div>`;
  return html`<section class="page" data-page="settings">
    <h2>${t("settings.title")}</h2>
    ${group("text", t("settings.text_size"))}
    ${group("contrast", t("settings.contrast"))}
    ${group("hand", t("settings.hand"))}
    <p>${t("settings.kept")}</p>
  </section>`;
}
