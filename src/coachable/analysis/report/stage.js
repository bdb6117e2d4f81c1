"use strict";
// The walkers: one walk, one time; the scene, the automaton, the time axis and the portraits follow it.

const NOBODY = "nobody";
const GRAVITY = "virtual gravity";

/** Sets the stage up; returns what the rest of the page asks of it. */
function buildStage(studies) {
  const stage = document.getElementById("stage");
  const get = (id) => document.getElementById(id);
  const withWalks = studies.filter((study) => study.lanes.some((lane) => lane.walk));
  if (!withWalks.length) {
    if (stage) get("no-walks").hidden = false; // a page without walkers has neither
    return { show: () => {}, redraw: () => {}, pose: () => {} };
  }
  stage.hidden = false;
  const walks = new Map();
  const state = { study: withWalks[0], lane: null, walk: null, other: null, time: 0, playing: false, speed: 1, colours: null };
  const backdrop = document.createElement("canvas"); // the time axis without its cursor
  let last = null, wanted = 0;

  async function walkFor(study, key, packed) {
    const name = `${studies.indexOf(study)} ${key}`;
    if (!walks.has(name)) walks.set(name, unpack(packed).then((columns) => walkOf(columns, study.plant, packed.paid)));
    return walks.get(name);
  }

  function lanesOf(study, setup) {
    return study.lanes.filter((lane) => lane.walk && (!setup || lane.setup === setup));
  }

  async function show(study, lane, time = 0) {
    const mine = ++wanted;
    const walk = await walkFor(study, lane.name, lane.walk);
    if (mine !== wanted) return; // another one was asked for in the meantime
    Object.assign(state, { study, lane, walk });
    fillControls();
    await chooseOther();
    document.querySelectorAll(".automaton-of").forEach((card) => (card.hidden = Number(card.dataset.study) !== studies.indexOf(study)));
    get("scrub").max = walk.duration;
    Object.assign(stage.dataset, { study: study.label, lane: lane.name });
    redraw();
    seek(Math.min(time, walk.duration));
  }

  function fillControls() {
    const { study, lane } = state;
    fill("study", withWalks.map((one) => [studies.indexOf(one), one.label]), studies.indexOf(study));
    get("study-pick").hidden = withWalks.length < 2;
    fill("setup", [...new Set(lanesOf(study).map((one) => one.setup))].map((name) => [name, name]), lane.setup);
    fill("seed", lanesOf(study, lane.setup).map((one) => [one.seed, seedText(one)]), lane.seed);
    const others = withWalks.flatMap((one) => one.setups
      .filter((setup) => one !== study || setup !== lane.setup)
      .map((setup) => one.lanes.find((other) => other.walk && other.setup === setup && other.seed === lane.seed))
      .filter(Boolean)
      .map((other) => [`${studies.indexOf(one)} ${other.name}`, `${withWalks.length > 1 ? `${one.label}: ` : ""}${other.setup}, seed ${other.seed}`]));
    const kept = get("beside").value;
    const options = [...(study.baseline ? [[GRAVITY, GRAVITY]] : []), [NOBODY, NOBODY], ...others];
    fill("beside", options, options.some(([key]) => key === kept) ? kept : options[0][0]);
  }

  function seedText(lane) {
    const distance = lane.distance === undefined ? "" : ` · ${number(lane.distance, 2)} m${lane.fell ? " ✕ fell" : ""}`;
    return `${lane.seed}${distance}`;
  }

  function fill(id, options, chosen) {
    get(id).replaceChildren(...options.map(([value, text]) => new Option(text, value, false, String(value) === String(chosen))));
  }

  async function chooseOther() {
    const key = get("beside").value;
    const [place, ...rest] = key.split(" ");
    if (key === NOBODY) state.other = null;
    else if (key === GRAVITY) state.other = await walkFor(state.study, key, state.study.baseline);
    else {
      const study = studies[Number(place)];
      const lane = study.lanes.find((one) => one.name === rest.join(" "));
      state.other = await walkFor(study, lane.name, lane.walk);
    }
  }

  function seek(time) {
    state.time = Math.min(state.walk.duration, Math.max(0, time));
    drawMoment();
  }

  function drawMoment() {
    const { walk, study, time, colours } = state;
    const row = sampleAt(walk.t, time);
    const phase = walk.phase[row];
    drawScene(get("walker"), walk, state.other, time, colours);
    drawCursor(time);
    drawPortrait(get("portrait-1"), walk, 1, time, study.phases, colours);
    drawPortrait(get("portrait-2"), walk, 2, time, study.phases, colours);
    light(phase);
    const known = study.phases[phase];
    get("phase").textContent = known ? known.name : "–";
    get("phase").style.background = colours.phases[phase];
    get("phase-title").textContent = known ? known.title : "in no phase";
    const along = study.distance === "hip" ? walk.hipX[row] : walk.foot_x[row];
    get("clock").textContent = `${number(walk.t[row], 2)} s · ${number(along, 2)} m`;
    const scrub = get("scrub");
    scrub.value = time;
    scrub.setAttribute("aria-valuetext", `${number(time, 2)} seconds, ${known ? known.name : "in no phase"}, ${number(along, 2)} metres`);
    Object.assign(stage.dataset, { time: time.toFixed(3), phase: known ? known.name : "", metres: along.toFixed(4) });
  }

  function light(phase) {
    const card = document.querySelector(`.automaton-of[data-study="${studies.indexOf(state.study)}"]`);
    const name = state.study.phases[phase]?.name;
    card.querySelectorAll("g").forEach((node) => {
      const label = node.querySelector("rect.node ~ text.name");
      if (!label) return;
      const lit = label.textContent === name;
      node.classList.toggle("lit", lit);
      node.style.setProperty("--lit", lit ? state.colours.phases[phase] : "");
    });
    card.classList.toggle("nowhere", name === undefined);
  }

  function drawCursor(time) {
    const canvas = get("timeline");
    const sheet = fresh(canvas);
    if (!sheet) return;
    const { context, width, height } = sheet;
    if (backdrop.width) context.drawImage(backdrop, 0, 0, width, height);
    const x = alongTimeline(time, state.walk.duration, width);
    line(context, [[x, 0], [x, height - 18]], state.colours.ink, 1.6);
  }

  function redraw() {
    if (!state.walk) return;
    state.colours = palette(state.study.phases.length);
    const canvas = get("timeline");
    drawTimeline(canvas, state.walk, state.study.phases, state.colours);
    [backdrop.width, backdrop.height] = [canvas.width, canvas.height];
    if (canvas.width && canvas.height) backdrop.getContext("2d").drawImage(canvas, 0, 0);
    drawMoment();
  }

  function play(on) {
    if (on && state.time >= state.walk.duration - 1e-6) state.time = 0;
    state.playing = on;
    stage.dataset.playing = on;
    get("play").classList.toggle("playing", on);
    get("play").setAttribute("aria-label", on ? "Pause" : "Play");
    last = null;
    if (on) requestAnimationFrame(advance);
    else get("said").textContent = `Paused at ${get("scrub").getAttribute("aria-valuetext")}`;
  }

  function advance(now) {
    if (!state.playing) return;
    const passed = last === null ? 0 : Math.min(0.1, (now - last) / 1000);
    last = now;
    seek(state.time + passed * state.speed);
    if (state.time >= state.walk.duration) play(false);
    else requestAnimationFrame(advance);
  }

  function pick() {
    const study = studies[Number(get("study").value)];
    const setup = study.setups.includes(get("setup").value) ? get("setup").value : study.setups[0];
    const own = lanesOf(study, setup);
    const lane = own.find((one) => String(one.seed) === get("seed").value) ?? own[0] ?? lanesOf(study)[0];
    show(study, lane, state.time);
  }

  ["study", "setup", "seed"].forEach((id) => get(id).addEventListener("change", pick));
  get("beside").addEventListener("change", async () => { await chooseOther(); drawMoment(); });
  get("speed").addEventListener("change", () => (state.speed = Number(get("speed").value)));
  get("play").addEventListener("click", () => { touched = true; play(!state.playing); });
  get("scrub").addEventListener("input", () => { touched = true; seek(Number(get("scrub").value)); });
  stage.addEventListener("keydown", (event) => {
    if (["SELECT", "SUMMARY"].includes(event.target.tagName) || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = event.shiftKey ? 0.1 : 0.01;
    const jumps = { ArrowLeft: state.time - step, ArrowRight: state.time + step, Home: 0, End: state.walk.duration };
    if (event.key === " ") { if (event.target.id === "play") return; play(!state.playing); }
    else if (event.key in jumps) { play(false); seek(jumps[event.key]); }
    else return;
    touched = true;
    event.preventDefault();
  });
  const canvas = get("timeline");
  const drag = (event) => {
    const box = canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - GUTTER) / (box.width - GUTTER - 6);
    touched = true;
    seek(share * state.walk.duration);
  };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); drag(event); });
  canvas.addEventListener("pointermove", (event) => { if (event.buttons) drag(event); });
  new ResizeObserver(redraw).observe(stage);

  // It begins to walk when it comes into view, unless the reader wants no motion or has taken over.
  let touched = matchMedia("(prefers-reduced-motion: reduce)").matches;
  new IntersectionObserver((entries) => {
    const seen = entries[0].isIntersecting;
    if (!seen && state.playing) play(false);
    else if (seen && !touched && state.walk) { touched = true; play(true); }
  }, { threshold: 0.5 }).observe(get("walker"));

  const first = withWalks[0];
  show(first, preferred(first, lanesOf(first)));
  // A still picture of the very start, upright and in no phase, would tell nothing.
  const pose = () => { if (state.walk && state.time === 0) state.time = 0.42 * state.walk.duration; };
  return { pose, redraw, show: (study, lane) => { touched = true; return show(study, lane).then(() => play(!matchMedia("(prefers-reduced-motion: reduce)").matches)); } };
}

/** The walk to begin with: the farthest of the derived reward, if there is one. */
function preferred(study, lanes) {
  return lanes.find((lane) => lane.setup === "orthant" && !lane.fell) ?? lanes.find((lane) => !lane.fell) ?? lanes[0];
}
