"use strict";
// Every seed as a small strobe picture, the farthest first.

/** Builds the gallery; `choose(study, lane)` is called with the one that is chosen. Returns what redraws it. */
async function buildGallery(studies, setupNames, choose) {
  const gallery = document.getElementById("gallery");
  if (!gallery) return () => {}; // no study of this page has a walker
  const pictures = [];
  for (const study of studies.filter((one) => one.plant)) {
    const poses = await unpack(study.poses);
    if (studies.length > 1) gallery.append(element("h3", study.label));
    for (const setup of study.setups) {
      const lanes = study.lanes.map((lane, place) => [lane, place]).filter(([lane]) => lane.setup === setup);
      if (!lanes.length) continue;
      const fell = lanes.filter(([lane]) => lane.fell).length;
      const title = element("h4", setup);
      title.style.setProperty("--shade", `var(--setup-${setupNames.indexOf(setup)})`);
      title.append(element("small", `${lanes.length} ${lanes.length === 1 ? "seed" : "seeds"}${fell ? `, ${fell} fell` : ""}`));
      const grid = element("div");
      grid.className = "seeds";
      grid.setAttribute("role", "group");
      grid.setAttribute("aria-label", `${setup}, ${study.label}`);
      lanes.forEach(([lane, place], rank) => {
        const button = element("button");
        button.type = "button";
        button.className = lane.fell ? "seed fell" : "seed";
        button.dataset.lane = lane.name;
        button.tabIndex = rank === 0 ? 0 : -1; // one stop for the tab key; arrows go on from there
        button.title = laneText(lane);
        button.setAttribute("aria-label", laneText(lane) + (lane.walk ? "" : " · its walk is not in this page"));
        if (!lane.walk) button.setAttribute("aria-disabled", "true");
        else button.addEventListener("click", () => choose(study, lane, button));
        const canvas = element("canvas");
        const label = element("span", lane.distance === undefined ? "" : `${number(lane.distance, 2)} m`);
        const walked = study.poses.starts[place] < study.poses.starts[place + 1];
        if (walked) button.append(canvas);
        button.append(...(lane.fell ? [element("em", "✕ fell")] : []), label, element("small", String(lane.seed)));
        grid.append(button);
        if (walked) pictures.push({ canvas, draw: (colours) => drawPoses(canvas, poses, study.poses.starts[place], study.poses.starts[place + 1], study.plant, colours) });
      });
      grid.addEventListener("keydown", walkWithArrows);
      gallery.append(title, grid);
    }
  }
  if (!gallery.children.length) document.getElementById("seeds").hidden = true;
  else if (!pictures.length) document.getElementById("seeds-note").textContent = "The latest evaluation of every lane, the farthest first. Pictures come when the walks are stored.";

  const drawn = new Set();
  let colours = palette(0);
  const seen = new IntersectionObserver((entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => {
    const picture = pictures.find((one) => one.canvas === entry.target);
    if (!drawn.has(picture)) { drawn.add(picture); picture.draw(colours); }
  }), { rootMargin: "300px" });
  pictures.forEach((picture) => seen.observe(picture.canvas));
  return (all) => {
    colours = palette(0);
    (all ? pictures : [...drawn]).forEach((picture) => { drawn.add(picture); picture.draw(colours); });
  };
}

function walkWithArrows(event) {
  const step = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
  if (!step) return;
  const buttons = [...event.currentTarget.children];
  const next = buttons[buttons.indexOf(document.activeElement) + step];
  if (!next) return;
  event.preventDefault();
  document.activeElement.tabIndex = -1;
  next.tabIndex = 0;
  next.focus();
}

function element(name, text = "") {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}
