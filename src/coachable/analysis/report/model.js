"use strict";
// What the page knows: packed numbers read back, where the walker's parts are, which sample a time falls on.
// Pure functions without a document, so that node can test them.

/** The columns that `packing.py` packed, by name; NaN where nothing was. */
async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const columns = {};
  packed.columns.forEach(([name, scale], place) => {
    const low = 2 * place * packed.rows;
    const values = new Float64Array(packed.rows);
    let whole = 0;
    for (let row = 0; row < packed.rows; row++) {
      const step = raw[low + row] | (raw[low + packed.rows + row] << 8);
      whole = ((whole + step) << 16) >> 16; // differences wrap around at 16 bits
      values[row] = whole === -32768 ? NaN : whole * scale;
    }
    columns[name] = values;
  });
  return columns;
}

/** A walk from its columns, with what is asked of it again and again. */
function walkOf(columns, plant, paid) {
  const count = columns.t.length;
  const hipX = new Float64Array(count);
  const firstStands = new Uint8Array(count);
  const touchdowns = [];
  for (let row = 0; row < count; row++) {
    hipX[row] = columns.foot_x[row] - plant.leg * Math.sin(columns.theta_1[row]);
    const landed = row > 0 && columns.foot_x[row] !== columns.foot_x[row - 1];
    if (landed) touchdowns.push(row);
    firstStands[row] = row === 0 ? 1 : firstStands[row - 1] ^ (landed ? 1 : 0);
  }
  const camera = smoothed(hipX, columns.t, 0.35);
  return { ...columns, plant, paid, hipX, firstStands, touchdowns, camera, duration: columns.t[count - 1] };
}

/** A running mean over `seconds` to both sides. */
function smoothed(values, times, seconds) {
  const result = new Float64Array(values.length);
  let first = 0, last = 0, sum = 0;
  for (let row = 0; row < values.length; row++) {
    while (last < values.length && times[last] <= times[row] + seconds) sum += values[last++];
    while (times[first] < times[row] - seconds) sum -= values[first++];
    result[row] = sum / (last - first);
  }
  return result;
}

/** The last sample not after a time; the first one if there is none. */
function sampleAt(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time + 1e-6) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Where the walker's parts are for angles and a stance foot: points [x, y] in metres, the ground at y = 0. */
function limbs(theta1, theta2, footX, plant) {
  const up = [-Math.sin(theta1), Math.cos(theta1)];
  const down = [Math.sin(theta2), -Math.cos(theta2)];
  const along = (from, direction, length) => [from[0] + length * direction[0], from[1] + length * direction[1]];
  const stance = [footX, 0];
  const hip = along(stance, up, plant.leg);
  return {
    hip,
    stance,
    swing: along(hip, down, plant.leg),
    stanceMass: along(stance, up, plant.a),
    swingMass: along(hip, down, plant.b),
  };
}

/** The walker's parts at a time: between two samples in between, but never across a touchdown. */
function poseAt(walk, time) {
  const row = sampleAt(walk.t, time);
  const next = Math.min(row + 1, walk.t.length - 1);
  const gap = walk.t[next] - walk.t[row];
  const joined = gap > 0 && walk.foot_x[next] === walk.foot_x[row];
  const share = joined ? Math.min(1, Math.max(0, (time - walk.t[row]) / gap)) : 0;
  const between = (column) => column[row] + share * (column[next] - column[row]);
  const parts = limbs(between(walk.theta_1), between(walk.theta_2), walk.foot_x[row], walk.plant);
  return { ...parts, row, camera: between(walk.camera), firstStands: walk.firstStands[row] === 1 };
}

/** Where a sequence stays the same: [value, first index, index after the last] of each stretch. */
function stretches(values) {
  const found = [];
  for (let start = 0, row = 1; row <= values.length; row++) {
    if (row === values.length || values[row] !== values[start]) {
      found.push([values[start], start, row]);
      start = row;
    }
  }
  return found;
}

/** The finite extremes of some sequences, as [low, high]; [0, 1] if there are none. */
function extent(sequences) {
  let low = Infinity, high = -Infinity;
  for (const sequence of sequences) {
    for (const value of sequence) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 1];
}

/** A number with this many digits behind the point, a true minus, and a dash for what is missing. */
function number(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Training steps in thousands. */
function stepsText(steps) {
  return steps === 0 ? "0" : `${number(steps / 1000, steps % 1000 ? 1 : 0)}k`;
}

/** A lane in words, as a label for people and screen readers. */
function laneText(lane) {
  const parts = [`${lane.setup}, seed ${lane.seed}`];
  if (lane.distance !== undefined) parts.push(`${number(lane.distance, 2)} m${lane.fell ? ", fell" : ""}`);
  if (lane.inCycle !== undefined && lane.inCycle !== null) parts.push(`${number(100 * lane.inCycle, 0)} % in the cycle`);
  if (lane.secondsUp !== undefined && lane.secondsUp !== null) parts.push(`up ${number(lane.secondsUp, 0)} s of 100`);
  return parts.join(" · ");
}

if (typeof module !== "undefined") {
  module.exports = { unpack, walkOf, smoothed, sampleAt, limbs, poseAt, stretches, extent, number, stepsText, laneText };
}
