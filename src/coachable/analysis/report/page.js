"use strict";
// Puts the page together.

(async () => {
  const { studies } = JSON.parse(document.getElementById("data").textContent);
  const setupNames = [...new Set(studies.flatMap((study) => study.setups))];
  const stage = buildStage(studies);
  const redrawCharts = await buildCharts(studies, setupNames);
  const redrawUpdates = await buildUpdateCharts(studies, setupNames);
  const redrawGallery = await buildGallery(studies, setupNames, (study, lane, button) => {
    document.querySelectorAll(".seed.chosen").forEach((other) => other.classList.remove("chosen"));
    button.classList.add("chosen");
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    document.getElementById("walkers").scrollIntoView({ behavior: calm ? "auto" : "smooth" });
    document.getElementById("play").focus({ preventScroll: true });
    stage.show(study, lane);
  });

  const redraw = (all = false) => { stage.redraw(); redrawCharts(); redrawUpdates(); redrawGallery(all); };
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = document.getElementById("theme");
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : system.matches);
  const tell = () => button.setAttribute("aria-pressed", isDark());
  button.addEventListener("click", () => { root.dataset.theme = isDark() ? "light" : "dark"; tell(); redraw(); });
  system.addEventListener("change", () => { tell(); redraw(); });
  tell();

  // Paper is white: what is drawn on canvases is drawn anew for it.
  const closed = new Set();
  let themed;
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("details:not([open])").forEach((part) => { closed.add(part); part.open = true; });
    themed = root.dataset.theme;
    root.dataset.theme = "light";
    root.classList.add("printing");
    stage.pose();
    redraw(true);
  });
  window.addEventListener("afterprint", () => {
    closed.forEach((part) => (part.open = false));
    closed.clear();
    root.classList.remove("printing");
    if (themed) root.dataset.theme = themed;
    else delete root.dataset.theme;
    redraw();
  });
  root.dataset.ready = "true";
})();
