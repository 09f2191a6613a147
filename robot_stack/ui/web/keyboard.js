// Keys on the screen for text fields: a robot has no keyboard. One on a cable, or the system's own, works as well.

import { html, useState } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";

const ROWS = ["1234567890", "qwertyuiop", "asdfghjkl-", "zxcvbnm_.,"];

// Types into a field as a real key would, with an "input" event.
function type(field, text) {
  const [from, to] = [field.selectionStart ?? field.value.length, field.selectionEnd ?? field.value.length];
  field.setRangeText(text, text === "" && from === to ? Math.max(0, from - 1) : from, to, "end");
  field.dispatchEvent(new Event("input", { bubbles: true }));
}

export function Keyboard({ field, close }) {
  const [capital, setCapital] = useState(false);
  const press = (act) => (event) => { event.preventDefault(); act(); };  // the field keeps the focus
  const key = (letter) => {
    const shown = capital ? letter.toUpperCase() : letter;
    return html`<button type="button" tabindex="-1" data-type=${letter}
      onPointerDown=${press(() => { type(field, shown); setCapital(false); })}>${shown}</button>`;
  };
  const other = (name, label, act, held = null) => html`<button type="button" tabindex="-1" data-type=${name} class="wide" aria-pressed=${held}
    onPointerDown=${press(act)}>${label}</button>`;
  return html`<div class="keyboard" role="group" aria-label=${t("keyboard.label")}>
    ${ROWS.map((row) => html`<div>${[...row].map(key)}</div>`)}
    <div>
      ${other("shift", t("keyboard.capital"), () => setCapital(!capital), capital)}
      ${other("space", t("keyboard.space"), () => type(field, " "))}
      ${other("delete", t("pin.delete"), () => type(field, ""))}
      ${other("close", t("keyboard.close"), () => { field.blur(); close(); })}
    </div>
  </div>`;
}
