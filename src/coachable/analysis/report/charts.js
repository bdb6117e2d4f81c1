"use strict";
// The curves of all studies side by side, with one measure, one axis and one scale for all.

/** Builds the charts and keeps them; returns what redraws them. */
async function buildCharts(studies, setupNames) {
  const shown = studies.filter((study) => study.curves.length);
  const holder = document.getElementById("charts");
  if (!shown.length) {
    document.getElementById("learning").hidden = true;
    return () => {};
  }
  const state = { measure: "reward", wall: false, paper: true, runs: false };
  await Promise.all(shown.flatMap((study) => study.curves.flatMap((curve) => curve.setups.map(async (setup) => {
    [setup.band, setup.runs] = [await unpack(setup.band), Object.values(await unpack(setup.runs))];
  }))));
  const finite = (curve) => curve.setups.some((setup) => setup.band.value.some(Number.isFinite));
  const known = shown.flatMap((study) => study.curves.filter(finite));
  const measures = known.filter((curve, place) => known.findIndex((one) => one.key === curve.key) === place);
  if (!measures.length) {
    document.getElementById("learning").hidden = true;
    return () => {};
  }
  document.getElementById("paper-curves").parentElement.hidden = !known.some((curve) => curve.setups.some((setup) => setup.paper));
  state.measure = measures[0].key;
  choose("measure", measures.map((curve) => [curve.key, curve.title]), state.measure, (key) => { state.measure = key; draw(); });
  choose("axis", [["steps", "steps"], ...(shown.every((study) => study.wallSeconds) ? [["wall", "wall time"]] : [])], "steps", (key) => { state.wall = key === "wall"; draw(); });
  listen("paper-curves", (checked) => { state.paper = checked; draw(); });
  listen("every-run", (checked) => { state.runs = checked; draw(); });

  let charts = [];
  function draw() {
    charts.forEach((chart) => chart.destroy());
    holder.replaceChildren();
    const having = shown.filter((study) => study.curves.some((curve) => curve.key === state.measure));
    const curves = having.map((study) => study.curves.find((curve) => curve.key === state.measure));
    const range = padded(extent(curves.flatMap((curve) => [
      ...curve.setups.flatMap((setup) => [setup.band.low, setup.band.high, setup.band.value, setup.band.best ?? []]),
      ...(state.runs ? curve.setups.flatMap((setup) => setup.runs) : []),
      ...(state.paper ? curve.setups.map((setup) => setup.paper?.value ?? []) : []),
      curve.baseline === null ? [] : [curve.baseline],
    ])), curves[0].share);
    charts = having.map((study, place) => chartOf(study, curves[place], state, range, setupNames, shown.length > 1 ? `${study.label} · ${curves[place].unit}` : curves[place].unit, holder, chartHeight()));
    document.getElementById("chart-note").textContent = noteOf(curves, state, having);
    const papers = curves.some((curve) => curve.setups.some((setup) => setup.paper));
    document.getElementById("paper-curves").disabled = !papers;
  }
  draw();
  new ResizeObserver(() => charts.forEach((chart) => chart.setSize({ width: chart.root.parentElement.clientWidth, height: chartHeight() }))).observe(holder);
  return draw;
}

/** Small charts of what the updates of the policies reported, where it was kept; returns what redraws them. */
async function buildUpdateCharts(studies, setupNames) {
  const holder = document.getElementById("update-charts");
  const shown = studies.flatMap((study) => study.updates.map((curve) => ({ study, curve })));
  await Promise.all(shown.flatMap(({ curve }) => curve.setups.map(async (setup) => {
    [setup.band, setup.runs] = [await unpack(setup.band), []];
  })));
  document.getElementById("updates").hidden = !shown.length;
  const state = { measure: null, wall: false, paper: false, runs: false };
  let charts = [];
  function draw() {
    charts.forEach((chart) => chart.destroy());
    holder.replaceChildren();
    charts = shown.map(({ study, curve }) => {
      const range = padded(extent(curve.setups.flatMap((setup) => [setup.band.low, setup.band.high, setup.band.value])), curve.share);
      const title = studies.length > 1 ? `${curve.title} · ${study.label}` : curve.title;
      return chartOf(study, curve, state, range, setupNames, title, holder, SMALL_HEIGHT);
    });
  }
  draw();
  new ResizeObserver(() => charts.forEach((chart) => chart.setSize({ width: chart.root.parentElement.clientWidth, height: SMALL_HEIGHT }))).observe(holder);
  return draw;
}

const SMALL_HEIGHT = 180;

function noteOf(curves, state, studies) {
  const parts = ["Lines are means over seeds, areas their pointwise 95 % intervals."];
  if (state.measure === "highest") parts.push("The thin line is the farthest of all runs, as in the paper’s figure; it has no interval.");
  if (state.paper && curves.some((curve) => curve.setups.some((setup) => setup.paper))) parts.push("Dashed: the paper’s curve, digitised.");
  if (curves.some((curve) => curve.baseline !== null)) parts.push("Dotted: virtual gravity.");
  if (state.wall) parts.push(`Wall time: of the whole study, all ${studies.map((s) => s.lanes.length).join(" and ")} lanes${studies.every((s) => s.plant) ? " side by side" : ""}, at its mean pace.`);
  return parts.join(" ");
}

function chartHeight() {
  return window.innerWidth < 640 ? 250 : 340;
}

function padded([low, high], share) {
  if (share) return [0, 1.02];
  const room = 0.04 * (high - low || 1);
  return [low >= 0 ? Math.max(0, low - room) : low - room, high + room];
}

function chartOf(study, curve, state, range, setupNames, caption, holder, height) {
  const figure = document.createElement("figure");
  const title = document.createElement("figcaption");
  title.textContent = caption;
  const area = document.createElement("div");
  area.tabIndex = 0;
  area.setAttribute("role", "group");
  area.setAttribute("aria-label", `${curve.title}, ${study.label}. Left and right arrow keys read values.`);
  const legend = document.createElement("ul");
  legend.className = "legend";
  legend.setAttribute("aria-live", "polite");
  figure.append(title, area, legend);
  holder.append(figure);

  const minutes = study.wallSeconds / 60 / study.steps;
  const across = (step) => (state.wall ? step * minutes : step);
  const shades = curve.setups.map((setup) => colour(`setup-${setupNames.indexOf(setup.name)}`));
  const data = [curve.steps.map(across)];
  const series = [{}];
  const bands = [];
  const shownAs = (value) => number(value, range[1] - range[0] < 0.2 ? 4 : 2);
  const gapped = (values) => Array.from(values, (value) => (Number.isFinite(value) ? value : null));
  curve.setups.forEach((setup, place) => {
    const first = series.length;
    series.push({ stroke: shades[place], width: 2, points: { show: false } });
    data.push(gapped(setup.band.value));
    for (const end of ["low", "high"]) {
      series.push({ stroke: "transparent", width: 0, points: { show: false } });
      data.push(gapped(setup.band[end]));
    }
    bands.push({ series: [first + 2, first + 1], fill: `color-mix(in srgb, ${shades[place]} 17%, transparent)` });
  });
  const axis = { stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 }, ticks: { show: false }, font: "12px system-ui" };
  const chart = new uPlot({
    width: area.clientWidth,
    height,
    legend: { show: false },
    padding: [8, 14, 0, 0],
    cursor: { y: false, points: { size: 7 }, drag: { x: false, y: false } },
    scales: { x: { time: false }, y: { range } },
    axes: [
      { ...axis, grid: { show: false }, size: 34, values: (_, ticks) => ticks.map((tick) => (state.wall ? `${number(tick, minutes * study.steps < 3 ? 1 : 0)} min` : stepsText(tick))) },
      { ...axis, size: 44, values: (_, ticks) => ticks.map((tick) => number(tick, decimals(ticks[1] - ticks[0]))) },
    ],
    series,
    bands,
    hooks: {
      drawAxes: [(u) => drawBehind(u, curve, state, shades, across)],
      setCursor: [(u) => readValues(u.cursor.idx)],
    },
  }, data, area);
  area.querySelector(".u-over")?.setAttribute("aria-hidden", "true");

  function readValues(index) {
    const last = curve.steps.length - 1;
    const row = index === null || index === undefined ? last : index;
    const where = document.createElement("li");
    where.className = "where";
    where.textContent = state.wall ? `${number(data[0][row], 1)} min` : `${curve.steps[row].toLocaleString("en")} steps`;
    legend.replaceChildren(where, ...curve.setups.map((setup, place) => {
      const item = document.createElement("li");
      const { value, low, high, best } = setup.band;
      const swatch = document.createElement("i");
      swatch.style.background = shades[place];
      const interval = Number.isFinite(low[row]) ? ` [${shownAs(low[row])}, ${shownAs(high[row])}]` : "";
      const farthest = best ? `, best ${number(best[row], 2)}` : "";
      const paper = state.paper && setup.paper ? `; paper ${number(near(setup.paper, curve.steps[row]), 2)}` : "";
      const name = document.createElement("b");
      name.textContent = setup.name;
      item.append(swatch, name, ` ${shownAs(value[row])}${interval}${farthest}${paper}`);
      return item;
    }));
  }
  readValues(null);
  let reading = curve.steps.length - 1;
  area.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    reading = Math.min(curve.steps.length - 1, Math.max(0, reading + step * (event.shiftKey ? 10 : 1)));
    chart.setCursor({ left: chart.valToPos(data[0][reading], "x"), top: 10 });
  });
  return chart;
}

/** How many decimals tell ticks at this distance apart. */
function decimals(between) {
  return between < 1 ? Math.max(1, Math.ceil(-Math.log10(between) - 1e-9)) : 0;
}

/** The paper's value at the step nearest to this one. */
function near(paper, step) {
  let best = 0;
  paper.steps.forEach((at, place) => { if (Math.abs(at - step) < Math.abs(paper.steps[best] - step)) best = place; });
  return paper.value[best];
}

/** Every seed, the best run, the paper's curves and the baseline, under the means. */
function drawBehind(u, curve, state, shades, across) {
  const { ctx, bbox } = u;
  const ratio = window.devicePixelRatio || 1;
  const polyline = (steps, values, shade, width, alpha, dash = []) => {
    ctx.globalAlpha = alpha;
    ctx.strokeStyle = shade;
    ctx.lineWidth = width * ratio;
    ctx.setLineDash(dash.map((length) => length * ratio));
    ctx.beginPath();
    let pen = false;
    values.forEach((value, place) => {
      if (!Number.isFinite(value)) { pen = false; return; }
      const x = u.valToPos(across(steps[place]), "x", true), y = u.valToPos(value, "y", true);
      pen ? ctx.lineTo(x, y) : ctx.moveTo(x, y);
      pen = true;
    });
    ctx.stroke();
  };
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  curve.setups.forEach((setup, place) => {
    if (state.runs) setup.runs.forEach((run) => polyline(curve.steps, run, shades[place], 0.8, 0.28));
    if (setup.band.best) polyline(curve.steps, setup.band.best, shades[place], 1, 0.9);
    if (state.paper && setup.paper) polyline(setup.paper.steps, setup.paper.value, shades[place], 1.2, 0.9, [5, 4]);
  });
  const ends = [curve.steps[0], curve.steps[curve.steps.length - 1]];
  if (curve.baseline !== null) polyline(ends, [curve.baseline, curve.baseline], colour("ink"), 1.2, 0.9, [1.5, 3]);
  ctx.restore();
}

/** A choice of one among a few, as radio buttons. */
function choose(id, options, chosen, then) {
  const holder = document.getElementById(id);
  if (options.length < 2) { holder.hidden = true; return; }
  options.forEach(([key, text]) => {
    const label = document.createElement("label");
    const input = document.createElement("input");
    Object.assign(input, { type: "radio", name: id, value: key, checked: key === chosen });
    input.addEventListener("change", () => then(key));
    const words = document.createElement("span");
    words.textContent = text;
    label.append(input, words);
    holder.append(label);
  });
}

function listen(id, then) {
  const box = document.getElementById(id);
  box.addEventListener("change", () => then(box.checked));
}
