// Names of all glyphs' files, 290 kB: the first drawing does not wait for them.
export function addFonts() {
  const link = document.createElement("link");
  link.rel = "stylesheet";
  link.href = "/vendor/fonts/fonts.css";
  document.head.append(link);
}
