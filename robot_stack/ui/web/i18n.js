// The texts of all pages, one catalogue for three languages, chosen while the page runs.

export const LANGUAGES = [["en", "English"], ["ja", "日本語"], ["zh", "中文"]];
const KEPT = "touch_ui.language";

let texts = {};
let language = null;

export async function loadTexts() {
  texts = await (await fetch("/texts.json")).json();
}

export function languageNow() {
  return language ?? "en";
}

// The robot's own language applies until one is chosen on this screen.
export function suggestLanguage(code) {
  if (language === null) setLanguage(localStorage.getItem(KEPT) ?? code, false);
}

export function setLanguage(code, keep = true) {
  language = LANGUAGES.some(([known]) => known === code) ? code : "en";
  document.documentElement.lang = language === "zh" ? "zh-Hans" : language;
  document.title = t("app.title");
  if (keep) localStorage.setItem(KEPT, language);
}

export function t(key, values = {}, code = languageNow()) {
  const entry = texts[key];
  const text = entry ? entry[code] : key;
  return text.replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? ""));
}

export function known(key) {
  return key in texts;
}

export function duration(seconds) {
  return seconds < 60
    ? t("rider.seconds", { count: seconds })
    : t("rider.minutes", { count: Math.ceil(seconds / 60) });
}
