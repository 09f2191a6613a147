// A kiosk has no reload button: a page that failed to load, because the robot was restarting or a file was lost
// on the way, asks for itself again, once the robot answers.

const UP_MS = 10000;

setInterval(async () => {
  if (window.touchUi) return;
  const answer = await fetch("/", { cache: "no-store" }).catch(() => null);
  if (answer?.ok && !window.touchUi) location.reload();
}, UP_MS);
