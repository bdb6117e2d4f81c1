"use strict";
// How things look on a canvas. Every function draws what it is given and keeps nothing.

/** A colour of the page's palette. */
function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** The colours that canvases need, read once a drawing. */
function palette(numPhases) {
  const phases = Array.from({ length: numPhases }, (_, phase) => colour(`phase-${phase}`));
  const names = ["ink", "page", "faint", "line", "stance", "swing", "good", "bad", "on-area"];
  return { ...Object.fromEntries(names.map((name) => [name, colour(name)])), phases: [...phases, colour("outside")] };
}

/** A canvas's context in CSS pixels at the screen's resolution, cleared; null while it is not shown. */
function fresh(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (!width || !height) return null;
  const ratio = Math.max(1, window.devicePixelRatio || 1);
  const [pixels, lines] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== pixels || canvas.height !== lines) [canvas.width, canvas.height] = [pixels, lines];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function line(context, points, colour, width) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineCap = context.lineJoin = "round";
  context.beginPath();
  points.forEach(([x, y], place) => (place ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function disc(context, [x, y], radius, fill, edge) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  if (edge) {
    context.lineWidth = 2;
    context.strokeStyle = edge;
    context.stroke();
  }
}

function write(context, text, x, y, colour, { align = "left", size = 11, weight = "" } = {}) {
  context.fillStyle = colour;
  context.font = `${weight} ${size}px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif`;
  context.textAlign = align;
  context.textBaseline = "middle";
  context.fillText(text, x, y);
}

/** The walker on the ground with the camera on it, and another one faintly beside it. */
function drawScene(canvas, walk, other, time, colours) {
  const sheet = fresh(canvas);
  if (!sheet) return;
  const { context, width, height } = sheet;
  const leg = walk.plant.leg;
  const ground = height - 34;
  const scale = Math.min((ground - 54) / leg, width / (1.7 * leg));
  const pose = poseAt(walk, time);
  const place = ([x, y]) => [width / 2 + scale * (x - pose.camera), ground - scale * y];
  const start = sampleAt(walk.t, time - 1.2);
  const trace = [];
  for (let row = start; row <= pose.row; row++) {
    trace.push(place([walk.hipX[row], leg * Math.cos(walk.theta_1[row])]));
  }
  if (trace.length > 1) line(context, trace, colours.line, 2);
  if (other) {
    context.globalAlpha = 0.38;
    drawWalker(context, poseAt(other, Math.min(time, other.duration)), place, other.plant, scale, { ...colours, stance: colours.faint, swing: colours.faint, ink: colours.faint });
    context.globalAlpha = 1;
  }
  drawWalker(context, pose, place, walk.plant, scale, colours);
  // The model has no knees, its swing leg scuffs through the ground: what is below is covered.
  context.fillStyle = colours.page;
  context.fillRect(0, ground, width, height - ground);
  line(context, [[0, ground], [width, ground]], colours.ink, 1.4);
  const half = width / 2 / scale;
  for (let x = Math.ceil(2 * (pose.camera - half)) / 2; x <= pose.camera + half; x += 0.5) {
    const [at] = place([x, 0]);
    line(context, [[at, ground], [at, ground + (x % 1 ? 4 : 7)]], colours.ink, 1.2);
    if (x % 1 === 0) write(context, `${number(x, 0)} m`, at, ground + 17, colours.faint, { align: "center" });
  }
  if (other) drawWhereabouts(context, poseAt(other, Math.min(time, other.duration)).hip[0] - pose.camera, half, width, ground, colours);
}

/** If the other walker is out of the picture: on which side, and how far off. */
function drawWhereabouts(context, ahead, half, width, ground, colours) {
  if (Math.abs(ahead) < half + 0.2) return;
  const text = `${number(Math.abs(ahead), 1)} m`;
  const [x, align] = ahead > 0 ? [width - 10, "right"] : [10, "left"];
  write(context, ahead > 0 ? `${text} ▸` : `◂ ${text}`, x, ground - 14, colours.faint, { align, size: 12 });
}

function drawWalker(context, pose, place, plant, scale, colours) {
  const thickness = Math.max(2.5, 0.032 * scale * plant.leg);
  const radius = (mass) => 0.06 * scale * plant.leg * Math.sqrt(mass / Math.max(plant.hip, plant.mass));
  const legs = [
    [pose.swing, pose.swingMass, colours.swing, !pose.firstStands],
    [pose.stance, pose.stanceMass, colours.stance, pose.firstStands],
  ];
  for (const [foot, mass, shade, isFirst] of legs) {
    line(context, [place(foot), place(pose.hip)], shade, thickness);
    disc(context, place(mass), radius(plant.mass), isFirst ? shade : colours.page, shade);
  }
  disc(context, place(pose.hip), radius(plant.hip), colours.ink);
}

/** A small strobe picture: poses of the last seconds, older ones fainter. */
function drawPoses(canvas, poses, first, last, plant, colours) {
  const sheet = fresh(canvas);
  if (!sheet || last <= first) return;
  const { context, width, height } = sheet;
  const ground = height - 4;
  const scale = Math.min(width / (2.35 * plant.leg), (ground - 6) / (1.06 * plant.leg));
  const at = (row) => limbs(poses.theta_1[row], poses.theta_2[row], poses.foot_x[row], plant);
  const end = at(last - 1).hip[0];
  const place = ([x, y]) => [width - scale * (0.62 * plant.leg + end - x), ground - scale * y];
  for (let row = first; row < last; row++) {
    const pose = at(row);
    const age = (last - 1 - row) / Math.max(1, last - first);
    context.globalAlpha = 0.12 + 0.88 * (1 - age) ** 3;
    line(context, [place(pose.swing), place(pose.hip)], colours.swing, 1.6);
    line(context, [place(pose.stance), place(pose.hip)], colours.stance, 1.6);
    disc(context, place(pose.hip), 2, colours.ink);
  }
  context.globalAlpha = 1;
  context.fillStyle = colours.page;
  context.fillRect(0, ground, width, height - ground);
  line(context, [[0, ground], [width, ground]], colours.faint, 1);
}

const GUTTER = 100;

/** Where a time is on the time axis. */
function alongTimeline(time, duration, width) {
  return GUTTER + (width - GUTTER - 6) * (duration ? time / duration : 0);
}

/** Phases, angles, torques and reward terms over the whole walk. */
function drawTimeline(canvas, walk, phases, colours) {
  const sheet = fresh(canvas);
  if (!sheet) return;
  const { context, width, height } = sheet;
  const x = (row) => alongTimeline(walk.t[row], walk.duration, width);
  const rows = [["phase", walk.expected ? 46 : 26], ["angles", 0.38 * (height - 130)], ["torques", 0.3 * (height - 130)], ["reward", 70]];
  const free = (height - 22 - rows.reduce((sum, [, share]) => sum + share, 0)) / 3;
  let top = 0;
  const place = Object.fromEntries(rows.map(([name, share]) => {
    const range = [top, top + share];
    top += share + free;
    return [name, range];
  }));

  const areas = (column, from, label) => {
    stretches(column).forEach(([phase, start, stop]) => {
      const left = x(start), right = stop < walk.t.length ? x(stop) : x(stop - 1);
      context.fillStyle = colours.phases[phase];
      context.fillRect(left, from, right - left, 20);
      const name = phases[phase]?.name;
      context.font = "11px system-ui";
      if (name && context.measureText(name).width + 6 < right - left) {
        write(context, name, (left + right) / 2, from + 10.5, colours["on-area"], { align: "center" });
      }
    });
    write(context, label, 0, from + 10, colours.faint);
  };
  areas(walk.phase, place.phase[0], "phase");
  if (walk.expected) areas(walk.expected, place.phase[0] + 22, "expected");
  walk.touchdowns.forEach((row) => line(context, [[x(row), 0], [x(row), height - 20]], colours.line, 1));

  const curves = (range, columns, unit, names) => {
    const [low, high] = extent([...columns.map(([column]) => column), [0]]);
    const y = (value) => range[1] - 4 - (range[1] - range[0] - 8) * ((value - low) / (high - low || 1));
    line(context, [[GUTTER, y(0)], [width - 6, y(0)]], colours.line, 1);
    columns.forEach(([column, shade], place) => {
      const points = Array.from(column, (value, row) => [x(row), y(value)]);
      line(context, points, shade, 1.5);
      write(context, names[place], 0, range[0] + 10 + 15 * place, shade, { size: 12, weight: "600" });
    });
    write(context, unit, 0, range[0] + 12 + 15 * columns.length, colours.faint);
    write(context, number(high, 1), GUTTER - 6, y(high), colours.faint, { align: "right", size: 10 });
    write(context, number(low, 1), GUTTER - 6, y(low), colours.faint, { align: "right", size: 10 });
  };
  curves(place.angles, [[walk.theta_1, colours.stance], [walk.theta_2, colours.swing]], "rad", ["θ₁ stance", "θ₂ swing"]);
  curves(place.torques, [[walk.u1, colours.stance], [walk.u2, colours.swing]], "N m", ["u₁ ankle", "u₂ hip"]);

  const strip = (from, column, name) => {
    write(context, name, 0, from + 6, colours.faint);
    stretches(column).forEach(([value, start, stop]) => {
      if (!value) return;
      const left = x(start), right = x(Math.min(stop, walk.t.length - 1));
      context.fillStyle = value > 0 ? colours.good : colours.bad;
      context.globalAlpha = value > 0 ? 0.5 : 1;
      context.fillRect(left, value > 0 ? from : from + 7, Math.max(1, right - left), 6);
      context.globalAlpha = 1;
    });
  };
  strip(place.reward[0], walk.orthant, "r phase ±1");
  strip(place.reward[0] + 18, walk.forward, "r forward ±1");
  const jerk = [place.reward[0] + 36, place.reward[1]];
  const [, most] = extent([walk.jerk, [1e-9]]);
  line(context, Array.from(walk.jerk, (value, row) => [x(row), jerk[1] - (jerk[1] - jerk[0]) * (value / most)]), colours.faint, 1);
  write(context, "r jerk", 0, (jerk[0] + jerk[1]) / 2, colours.faint);
  write(context, number(most, 1), GUTTER - 6, jerk[0] + 2, colours.faint, { align: "right", size: 10 });
  for (let second = 0; second <= walk.duration + 1e-6; second += walk.duration > 4 && width < 500 ? 2 : 1) {
    write(context, `${second} s`, alongTimeline(second, walk.duration, width), height - 8, colours.faint, {
      align: second > walk.duration - 0.5 ? "right" : "center",
    });
  }
}

/** One leg's angle against its velocity, the phases' regions tinted, the present one strongly. */
function drawPortrait(canvas, walk, leg, time, phases, colours) {
  const sheet = fresh(canvas);
  if (!sheet) return;
  const { context, width, height } = sheet;
  const [angle, velocity] = [walk[`theta_${leg}`], walk[`dtheta_${leg}`]];
  const [left, right, top, bottom] = [8, width - 8, 22, height - 20];
  const wide = ([low, high]) => [Math.min(low, 0) - 0.06 * (high - low), Math.max(high, 0) + 0.06 * (high - low)];
  const [a0, a1] = wide(extent([angle])), [v0, v1] = wide(extent([velocity]));
  const x = (value) => left + ((right - left) * (value - a0)) / (a1 - a0);
  const y = (value) => bottom - ((bottom - top) * (value - v0)) / (v1 - v0);
  const row = sampleAt(walk.t, time);
  const tint = (phase, alpha) => {
    const box = phases[phase]?.box ?? {};
    const [from, to] = box[`theta_${leg}`] ?? [null, null];
    const [slow, fast] = box[`dtheta_${leg}`] ?? [null, null];
    if (from === null && to === null && slow === null && fast === null) return;
    const inside = (value, low, high) => Math.min(high, Math.max(low, value));
    const [x0, x1] = [x(inside(from ?? a0, a0, a1)), x(inside(to ?? a1, a0, a1))];
    const [y0, y1] = [y(inside(slow ?? v0, v0, v1)), y(inside(fast ?? v1, v0, v1))];
    context.globalAlpha = alpha;
    context.fillStyle = colours.phases[phase];
    context.fillRect(x0, y1, x1 - x0, y0 - y1);
    context.globalAlpha = 1;
  };
  phases.forEach((_, phase) => tint(phase, 0.22));
  tint(walk.phase[row], 0.85);
  line(context, [[x(0), top], [x(0), bottom]], colours.line, 1);
  line(context, [[left, y(0)], [right, y(0)]], colours.line, 1);
  const shade = leg === 1 ? colours.stance : colours.swing;
  const path = (start, stop, alpha, thickness) => {
    context.globalAlpha = alpha;
    for (let begin = start, next = start + 1; next <= stop; next++) {
      if (next === stop || walk.foot_x[next] !== walk.foot_x[next - 1]) {
        const points = [];
        for (let k = begin; k < next; k++) points.push([x(angle[k]), y(velocity[k])]);
        line(context, points, shade, thickness);
        begin = next;
      }
    }
    context.globalAlpha = 1;
  };
  path(0, walk.t.length, 0.25, 1);
  path(sampleAt(walk.t, time - 0.7), row + 1, 1, 2);
  disc(context, [x(angle[row]), y(velocity[row])], 5, shade, colours.page);
  const sub = leg === 1 ? "₁" : "₂";
  write(context, `θ̇${sub} against θ${sub}`, left, 9, shade, { size: 12, weight: "600" });
  write(context, leg === 1 ? "stance" : "swing", right, 9, colours.faint, { align: "right" });
  if (width > 220) write(context, `${number(a0, 1)} … ${number(a1, 1)} rad`, left, height - 8, colours.faint, { size: 10 });
  write(context, `${number(v0, 1)} … ${number(v1, 1)} rad/s`, right, height - 8, colours.faint, { size: 10, align: "right" });
}
