// The external display: what people around the robot see now, as the display itself has confirmed it.

import { html, useEffect, useRef } from "/vendor/preact-htm.js";
import { languageNow, t } from "/i18n.js";

// The picture becomes a part of the page: so its text is written in the page's own fonts.
function Picture({ state, language }) {
  const place = useRef(null);
  useEffect(() => {
    let current = true;
    fetch(`/display/${state}-${language}.svg`).then((answer) => answer.text()).then((text) => {
      if (!current) return;
      const picture = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
      place.current.replaceChildren(document.importNode(picture, true));
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) place.current.firstChild.pauseAnimations();
    });
    return () => { current = false; };
  }, [state, language]);
  return html`<div class="display-picture" ref=${place} data-shown=${state}></div>`;
}

export function DisplayPage({ link, state }) {
  useEffect(() => { link.show(["display"]); }, []);
  const display = state.display;
  const known = display?.state !== null && display?.state !== undefined;
  const status = !display ? "display.waiting" : !display.known ? "display.silent" : !display.linked ? "display.unlinked" : known ? "display.linked" : "display.waiting";
  return html`<section class="page" data-page="display">
    <h2>${t("display.title")}</h2>
    <p class="large" role="status" id="display-link">${t(status)}</p>
    ${known && html`<${Picture} state=${display.state} language=${languageNow()} />
      <p>${t("display.state", { number: display.state })}</p>
      <p>${t("display.direction")}</p>`}
    ${display?.fault && html`<p class="problem">${t("display.fault", { code: display.fault })}</p>`}
  </section>`;
}
