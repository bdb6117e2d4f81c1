"use strict";
// Laws of model.js, run by node's own test runner (and by pytest, see test_model.py).

const assert = require("node:assert/strict");
const test = require("node:test");
const model = require("../../../src/coachable/analysis/report/model.js");

const plant = { leg: 1.1, a: 0.4, b: 0.7, hip: 1, mass: 0.5 };
const near = (one, other, within = 1e-12) => assert.ok(Math.abs(one - other) <= within, `${one} is not ${other}`);
const length = ([x0, y0], [x1, y1]) => Math.hypot(x1 - x0, y1 - y0);

function walk() {
  const rows = 40;
  const column = (of) => Float64Array.from({ length: rows }, (_, row) => of(row));
  const columns = {
    t: column((row) => row / 100),
    theta_1: column((row) => 0.2 - 0.01 * row),
    theta_2: column((row) => -0.3 + 0.02 * row),
    foot_x: column((row) => (row < 15 ? 0 : row < 30 ? 0.5 : 0.9)),
    phase: column((row) => row % 3),
  };
  return model.walkOf(columns, plant, {});
}

test("legs and masses keep their lengths in every posture", () => {
  for (let step = 0; step < 50; step++) {
    const [theta1, theta2, foot] = [Math.sin(step), Math.cos(3 * step), step / 7];
    const parts = model.limbs(theta1, theta2, foot, plant);
    near(length(parts.stance, parts.hip), plant.leg);
    near(length(parts.swing, parts.hip), plant.leg);
    near(length(parts.stanceMass, parts.stance), plant.a);
    near(length(parts.swingMass, parts.hip), plant.b);
    near(parts.stance[1], 0);
  }
});

test("upright, everything is above the foot; a negative angle leans forward", () => {
  const upright = model.limbs(0, 0, 2, plant);
  near(upright.hip[0], 2);
  near(upright.swing[0], 2);
  near(upright.swing[1], 0);
  assert.ok(model.limbs(-0.1, 0, 2, plant).hip[0] > 2);
  assert.ok(model.limbs(0, 0.1, 2, plant).swing[0] > 2);
});

test("a time falls on the last sample not after it", () => {
  const times = [0, 0.01, 0.02, 0.03];
  assert.equal(model.sampleAt(times, 0.0199), 1);
  assert.equal(model.sampleAt(times, 0.02), 2);
  assert.equal(model.sampleAt(times, -1), 0);
  assert.equal(model.sampleAt(times, 9), 3);
  assert.equal(model.sampleAt([0], 5), 0);
});

test("poses at samples are the samples, between them they are between, never across a touchdown", () => {
  const gait = walk();
  for (const row of [0, 3, 14, 15, 39]) {
    near(model.poseAt(gait, gait.t[row]).hip[0], gait.hipX[row]);
  }
  const between = model.poseAt(gait, 0.055).hip[0];
  assert.ok(between > gait.hipX[5] && between < gait.hipX[6]);
  near(model.poseAt(gait, 0.1499).hip[0], gait.hipX[14]);
});

test("legs change roles at every touchdown", () => {
  const gait = walk();
  assert.deepEqual(gait.touchdowns, [15, 30]);
  assert.deepEqual([0, 14, 15, 29, 30, 39].map((row) => gait.firstStands[row]), [1, 1, 0, 0, 1, 1]);
});

test("the camera is a mean: it keeps a constant and stays within its window", () => {
  const times = Array.from({ length: 30 }, (_, row) => row / 10);
  assert.deepEqual(Array.from(model.smoothed(times.map(() => 4), times, 0.35)), times.map(() => 4));
  model.smoothed(times, times, 0.35).forEach((value, row) => near(value, times[row], 0.35));
});

test("stretches make up the sequence", () => {
  for (const values of [[1], [1, 1], [0, 0, 1, 1, 0], [3, 2, 1]]) {
    const parts = model.stretches(values);
    assert.deepEqual(parts.flatMap(([value, start, stop]) => Array(stop - start).fill(value)), values);
    parts.slice(1).forEach(([value], place) => assert.notEqual(value, parts[place][0]));
  }
  assert.deepEqual(model.stretches([]), []);
});

test("extents pass over what is missing", () => {
  assert.deepEqual(model.extent([[NaN, 2], [-1], []]), [-1, 2]);
  assert.deepEqual(model.extent([[NaN]]), [0, 1]);
});

test("numbers are written as in the tables", () => {
  assert.equal(model.number(-1.5, 2), "−1.50");
  assert.equal(model.number(-0.001, 2), "0.00");
  assert.equal(model.number(null, 2), "–");
  assert.equal(model.number(NaN, 2), "–");
  assert.equal(model.stepsText(250000), "250k");
  assert.equal(model.stepsText(0), "0");
});

test("a lane in words says only what is known", () => {
  assert.equal(model.laneText({ setup: "sparse", seed: 3 }), "sparse, seed 3");
  const whole = { setup: "sparse", seed: 3, distance: 4.567, fell: true, inCycle: 0.914, secondsUp: 4.2 };
  assert.equal(model.laneText(whole), "sparse, seed 3 · 4.57 m, fell · 91 % in the cycle · up 4 s of 100");
  assert.equal(model.laneText({ ...whole, secondsUp: null, inCycle: null }), "sparse, seed 3 · 4.57 m, fell");
});
