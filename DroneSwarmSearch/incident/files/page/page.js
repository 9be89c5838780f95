// Plays a flight plan: where persons may drift, and the drones that search for them. The data are
// those of `incident.files.page`: metres to the east and north, and seconds after the take-off.
"use strict";
(() => {

const plan = JSON.parse(document.getElementById("data").textContent);
const element = name => document.getElementById(name);
const mapCanvas = element("map");
const curveCanvas = element("curve");
const slider = element("time");
const toggle = element("play");

const STEP = 30;  // seconds of an arrow key
const DOT = 1.6;  // pixels
const DISC = 9;
const MARGIN = 14;  // pixels around the map

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const mix = (one, other, part) => one + (other - one) * part;
const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Data.

function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  return new Int16Array(bytes.buffer);
}

const cloud = unpacked(plan.persons.positions);  // [time][person][axis], in units
const sweeps = new Map();  // person -> when drones sweep them, and how likely they miss them
plan.persons.swept.forEach((person, index) => {
  if (!sweeps.has(person)) sweeps.set(person, []);
  const detection = plan.flights[plan.persons.by[index]].detection;
  sweeps.get(person).push({ time: plan.persons.when[index], missed: 1 - detection });
});

/** Where a person is at a time: (east, north) in metres. */
function personAt(person, seconds) {
  const last = cloud.length / (2 * plan.persons.count) - 1;
  const row = clamp(seconds / plan.persons.step, 0, last);
  const before = Math.min(Math.floor(row), Math.max(last - 1, 0));
  const after = Math.min(before + 1, last);
  return [0, 1].map(axis => {
    const value = time => cloud[2 * (time * plan.persons.count + person) + axis];
    return plan.persons.unit * mix(value(before), value(after), row - before);
  });
}

/** The probability that a person has not been detected by a time. */
function missed(person, seconds) {
  const swept = sweeps.get(person) ?? [];
  return swept.filter(each => each.time <= seconds).reduce((left, each) => left * each.missed, 1);
}

/** Where a drone is at a time; null before its take-off and after its landing. */
function droneAt(flight, seconds) {
  const times = flight.times;
  if (seconds < times[0] || seconds > times.at(-1)) return null;
  let leg = times.findIndex(time => time > seconds) - 1;
  if (leg < 0) leg = times.length - 2;
  const part = (seconds - times[leg]) / (times[leg + 1] - times[leg]);
  const position = [0, 1].map(axis => mix(flight.points[leg][axis], flight.points[leg + 1][axis], part));
  return {leg, position};
}

// The map.

let now = 0;
let playing = false;

function prepared(canvas) {
  const ratio = devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return {context, width, height};
}

/** A function from metres to pixels, and the scale in pixels per metre. */
function projection(width, height) {
  const [west, south, east, north] = plan.extent;
  const scale = Math.min((width - 2 * MARGIN) / (east - west), (height - 2 * MARGIN) / (north - south));
  const x = width / 2 - scale * (west + east) / 2;
  const y = height / 2 + scale * (south + north) / 2;
  return {scale, at: ([right, up]) => [x + scale * right, y - scale * up]};
}

function line(context, points) {
  context.beginPath();
  points.forEach((point, index) => index ? context.lineTo(...point) : context.moveTo(...point));
}

function drawMap() {
  const {context, width, height} = prepared(mapCanvas);
  const {scale, at} = projection(width, height);
  context.fillStyle = colour("--sea");
  context.fillRect(0, 0, width, height);
  drawLand(context, at);
  drawGraticule(context, at, width, height);
  drawPersons(context, at);
  for (const flight of plan.flights) drawSearched(context, flight, at, scale);
  drawMarks(context, at);
  for (const flight of plan.flights) drawDrone(context, flight, at);
  drawScale(context, scale, width, height);
}

function drawLand(context, at) {
  context.fillStyle = colour("--land");
  context.strokeStyle = colour("--shore");
  context.lineWidth = 1;
  for (const polygon of plan.land) {
    context.beginPath();
    for (const outline of polygon) {
      outline.forEach((point, index) => index ? context.lineTo(...at(point)) : context.moveTo(...at(point)));
      context.closePath();
    }
    context.fill("evenodd");
    context.stroke();
  }
}

function drawGraticule(context, at, width, height) {
  context.strokeStyle = colour("--line");
  context.fillStyle = colour("--grey");
  context.lineWidth = 0.6;
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "alphabetic";
  for (const [north, label] of plan.parallels) {
    const y = at([0, north])[1];
    line(context, [[0, y], [width, y]]);
    context.stroke();
    context.fillText(label, 4, y - 3);
  }
  for (const [east, label] of plan.meridians) {
    const x = at([east, 0])[0];
    line(context, [[x, 0], [x, height]]);
    context.stroke();
    context.fillText(label, x + 3, height - 5);
  }
}

function drawPersons(context, at) {
  const person = colour("--person");
  for (let number = 0; number < plan.persons.count; number++) {
    context.fillStyle = `rgb(${person} / ${0.62 * missed(number, now) + 0.05})`;
    const [x, y] = at(personAt(number, now));
    context.beginPath();
    context.arc(x, y, DOT, 0, 2 * Math.PI);
    context.fill();
  }
}

/** The strips that a drone has searched, and its track. */
function drawSearched(context, flight, at, scale) {
  const flying = droneAt(flight, now);
  const isOver = now > flight.times.at(-1);
  if (!flying && !isOver) return;
  const last = isOver ? flight.points.length - 1 : flying.leg;
  const track = flight.points.slice(0, last + 1);
  if (flying) track.push(flying.position);
  const pixels = track.map(at);
  const [red, green, blue] = flight.colour;
  context.lineJoin = "round";
  context.lineCap = "butt";
  line(context, pixels.slice(1));
  context.strokeStyle = `rgb(${red} ${green} ${blue} / 0.2)`;
  context.lineWidth = Math.max(flight.swath * scale, 2);
  context.stroke();
  line(context, pixels);
  context.strokeStyle = colour("--ink");
  context.lineWidth = 2.4;
  context.stroke();
  context.strokeStyle = `rgb(${red} ${green} ${blue})`;
  context.lineWidth = 1.4;
  context.stroke();
}

/** What is known of where persons were, and the base. */
function drawMarks(context, at) {
  context.strokeStyle = colour("--ink");
  context.lineWidth = 2;
  for (const mark of plan.marks) {
    const pixels = mark.map(at);
    if (pixels.length > 1) {
      context.setLineDash([2, 4]);
      line(context, pixels);
      context.stroke();
      context.setLineDash([]);
      continue;
    }
    const [x, y] = pixels[0];
    context.beginPath();
    context.arc(x, y, 6, 0, 2 * Math.PI);
    context.moveTo(x - 10, y);
    context.lineTo(x + 10, y);
    context.moveTo(x, y - 10);
    context.lineTo(x, y + 10);
    context.stroke();
  }
  for (const flight of plan.flights) {
    const [left, top] = at(flight.points[0]);
    context.strokeRect(left - 9, top - 9, 18, 18);
  }
}

function drawDrone(context, flight, at) {
  const flying = droneAt(flight, now);
  const [x, y] = at(flying?.position ?? flight.points[0]);
  if (!flying && now > 0) return;
  const [red, green, blue] = flight.colour;
  context.beginPath();
  context.arc(x, y, DISC, 0, 2 * Math.PI);
  context.fillStyle = `rgb(${red} ${green} ${blue})`;
  context.strokeStyle = colour("--ink");
  context.lineWidth = 1.5;
  context.fill();
  context.stroke();
  const isBright = 0.3 * red + 0.59 * green + 0.11 * blue > 120;
  context.fillStyle = isBright ? "#18202c" : "#fff";
  context.font = "bold 11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(flight.number, x, y + 0.5);
}

function drawScale(context, scale, width, height) {
  const lengths = [100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000];
  const metres = lengths.findLast(length => length * scale < width / 4) ?? lengths[0];
  const right = width - 16;
  const left = right - metres * scale;
  const y = height - 26;
  context.strokeStyle = context.fillStyle = colour("--ink");
  context.lineWidth = 1.5;
  line(context, [[left, y - 5], [left, y], [right, y], [right, y - 5]]);
  context.stroke();
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "alphabetic";
  context.fillText(metres < 1000 ? `${metres} m` : `${metres / 1000} km`, (left + right) / 2, y - 6);
  line(context, [[right - 6, 44], [right - 6, 16]]);
  context.stroke();
  line(context, [[right - 11, 24], [right - 6, 14], [right - 1, 24]]);
  context.fill();
  context.fillText("N", right - 6, 58);
}

// The curve.

function successAt(seconds) {
  const row = clamp(seconds / plan.success.step, 0, plan.success.values.length - 1);
  const before = Math.floor(row);
  const after = Math.min(before + 1, plan.success.values.length - 1);
  return mix(plan.success.values[before], plan.success.values[after], row - before);
}

function drawCurve() {
  const {context, width, height} = prepared(curveCanvas);
  const left = 38;
  const bottom = height - 20;
  const most = Math.max(0.1, Math.ceil(10 * Math.max(...plan.success.values)) / 10);
  const x = seconds => left + (width - left - 10) * seconds / plan.duration;
  const y = share => bottom - (bottom - 10) * share / most;
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = colour("--grey");
  context.strokeStyle = colour("--line");
  context.lineWidth = 1;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const share of [0, most / 2, most]) {
    line(context, [[left, y(share)], [width - 10, y(share)]]);
    context.stroke();
    context.fillText(`${Math.round(100 * share)}%`, left - 5, y(share));
  }
  context.textAlign = "center";
  context.textBaseline = "alphabetic";
  const minutes = [5, 10, 20, 30, 60, 120].find(step => plan.duration / 60 / step <= 6) ?? 240;
  for (let time = 0; time <= plan.duration; time += 60 * minutes) context.fillText(clock(time), clamp(x(time), 20, width - 20), height - 5);
  const points = plan.success.values.map((share, index) => [x(Math.min(index * plan.success.step, plan.duration)), y(share)]);
  context.strokeStyle = colour("--accent");
  context.lineWidth = 2;
  line(context, points);
  context.stroke();
  context.fillStyle = colour("--accent");
  context.beginPath();
  context.arc(x(now), y(successAt(now)), 4.5, 0, 2 * Math.PI);
  context.fill();
}

// Time.

function clock(seconds) {
  const date = new Date(1000 * (plan.start + seconds));
  return date.toISOString().slice(11, 16);
}

function show() {
  slider.value = now;
  const seconds = String(Math.floor((plan.start + now) % 60)).padStart(2, "0");
  element("clock").textContent = `${clock(now)}:${seconds} UTC`;
  slider.setAttribute("aria-valuetext", `${clock(now)} UTC`);
  element("success").textContent = `${Math.round(100 * successAt(now))}%`;
  drawMap();
  drawCurve();
}

function seek(seconds) {
  now = clamp(seconds, 0, plan.duration);
  show();
}

function play(on) {
  if (on && now >= plan.duration) now = 0;
  playing = on;
  toggle.textContent = on ? "Pause" : "Play";
  toggle.setAttribute("aria-label", toggle.textContent);
  if (on) requestAnimationFrame(first => requestAnimationFrame(next => tick(first, next)));
}

function tick(before, at) {
  if (!playing) return;
  seek(now + (at - before) / 1000 * Number(element("speed").value));
  if (now >= plan.duration) play(false);
  else requestAnimationFrame(next => tick(at, next));
}

toggle.addEventListener("click", () => play(!playing));
slider.addEventListener("input", () => seek(Number(slider.value)));

const KEYS = {
  " ": () => play(!playing),
  ArrowLeft: () => seek(now - STEP),
  ArrowRight: () => seek(now + STEP),
  Home: () => seek(0),
  End: () => seek(plan.duration),
};
document.addEventListener("keydown", event => {
  const isChoosing = event.target.closest?.("select") || event.ctrlKey || event.altKey || event.metaKey;
  if (isChoosing || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key]();
});
toggle.addEventListener("keyup", event => event.key === " " && event.preventDefault());

addEventListener("resize", show);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
let shown = 0;
addEventListener("beforeprint", () => {
  play(false);
  shown = now;
  document.documentElement.classList.add("printed");
  seek(plan.duration);
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("printed");
  seek(shown);
});
show();

})();
