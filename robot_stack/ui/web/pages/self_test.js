// The guided self test: one step at a time in large text. The robot detects what it can; a person confirms the rest.

import { html, useEffect } from "/vendor/preact-htm.js";
import { t } from "/i18n.js";

function stepText({ kind, target }) {
  if (kind === "check") return t(`test_check.${target}`);
  if (target === "screen") return t(`test_screen.${kind}`);
  return t(`test_button.${kind}`, { button: t(`test_target.${target}`) });
}

// A reminder above the other staff pages; empty if no test is due.
export function SelfTestDue({ age, open }) {
  const text = age?.failed ? t("test.due_failed") : age?.age_h == null ? t("test.due_never") : t("test.due", { hours: age.age_h });
  return html`<div role="status">
    ${age?.due && html`<button class="due" id="self-test-due" onClick=${open}>${text}</button>`}
  </div>`;
}

export function SelfTestPage({ link, state, say }) {
  useEffect(() => { link.show(["self_test"]); }, []);
  const test = state.self_test;
  const act = async (name) => {
    const answer = await link.ask({ t: "self_test", act: name, step: test.at });
    if (!answer.ok) say(answer);
  };
  return html`<section class="page self-test" data-page="self_test">
    ${test?.running
      ? html`<${Running} test=${test} act=${act} />`
      : html`<${Idle} test=${test} act=${act} emergency=${state.safety?.emergency} />`}
  </section>`;
}

function Running({ test, act }) {
  const step = test.steps[test.at];
  const count = test.steps.length;
  const confirm = { check: "test.good", release: "test.release", reset: "faults.reset" }[step.kind];
  return html`
    <p class="eyebrow">${t("test.progress", { step: test.at + 1, count })}</p>
    <h2 id="test-step" data-step=${`${step.kind} ${step.target}`} aria-live="assertive">${stepText(step)}</h2>
    <div class="progress" role="progressbar" aria-valuemin="0" aria-valuemax=${count} aria-valuenow=${test.at}
      aria-label=${t("test.title")}><div style=${{ width: `${(100 * test.at) / count}%` }}></div></div>
    <p class="figures">
      <span>${t("test.left", { seconds: test.left_s })}</span>
      ${!test.confirm && html`<span>${t("test.automatic")}</span>`}
    </p>
    <p>${t("test.leave")}</p>
    <div class="actions">
      ${test.confirm && html`<button class="primary" id="test-confirm" onClick=${() => act("confirm")}>${t(confirm)}</button>`}
      <button class="danger" id="test-fail" onClick=${() => act("fail")}>${t("test.bad")}</button>
      <button id="test-cancel" onClick=${() => act("cancel")}>${t("test.cancel")}</button>
    </div>`;
}

function Idle({ test, act, emergency }) {
  const last = test?.last;
  return html`
    <h2>${t("test.title")}</h2>
    ${last && html`<${Result} last=${last} />`}
    ${test && !last && html`<p class="notice">${t("test.never")}</p>`}
    ${test?.stored === false && html`<p class="notice bad" id="test-not-stored">${t("test.not_stored")}</p>`}
    ${emergency && html`<p class="notice bad">${t("test.still_stopped")}</p>`}
    <p class="large">${t("test.intro")}</p>
    <p>${t("test.before")}</p>
    <p>${t("test.leave")}</p>
    <div class="actions">
      <button class="primary" id="test-start" disabled=${!test} onClick=${() => act("begin")}>${t("test.start")}</button>
    </div>`;
}

function Result({ last }) {
  const time = new Date(last.at).toLocaleString(document.documentElement.lang);
  return html`<div class=${`notice ${last.verdict === "passed" ? "" : "bad"}`} id="test-result" data-verdict=${last.verdict}
    data-reason=${last.reason} role="status">
    <strong>${t(`test_verdict.${last.verdict}`)}</strong>
    ${last.reason && html`<p>${t(`test_reason.${last.reason}`)}</p>`}
    ${last.kind && html`<p>${t("test.at_step", { step: stepText(last) })}</p>`}
    <p>${t("test.last", { time, seconds: last.duration_s })}</p>
    ${last.verdict === "failed" && html`<p><strong>${t("test.out_of_service")}</strong></p>`}
  </div>`;
}
