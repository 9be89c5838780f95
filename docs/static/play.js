// The page "Watch searches": plays episodes written by `DroneSwarmSearch.evaluation.export`,
// whose docstring describes the data. docs/make_episodes.py writes the files in `episodes`.
"use strict";
(() => {

const root = document.getElementById("player");
const INDEX = globalThis.searchData?.index;
if (!root?.classList.contains("live") || !INDEX) return root?.classList.remove("live");

const FOLDER = document.currentScript.src.replace(/[^/]*$/, "episodes/");
const FORMAT = "DroneSwarmSearch episodes", VERSION = 1;
const MOVES = [[-1, 0], [1, 0], [0, -1], [0, 1], [0, 0], [0, 0]], SEARCH = 4;
const SPEEDS = [2, 4, 8, 16, 32];  // steps per second
const GLIDE = 9;  // steps per second of a single step
const TRAIL = 22, FADE = 45;  // steps for which trails and marks of searches last
const STRIP = 30, GAP = 14;  // CSS pixels: the legend below a map, the space between maps
const VIEWS = {prior: "Prior", posterior: "Posterior", both: "Both"};

const INK = "rgb(24 32 44)";

const stillness = matchMedia("(prefers-reduced-motion: reduce)");
const darkness = matchMedia("(prefers-color-scheme: dark)");
const percent = share => `${(100 * share).toFixed(1)}%`;
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const rgb = ([r, g, b], alpha = 1) => `rgb(${r} ${g} ${b} / ${alpha})`;
const colourOf = drone => INDEX.colours.drones[drone % INDEX.colours.drones.length];
const mix = (one, other, part) => one + (other - one) * part;

// Files.

const files = new Map();  // name of the search -> promise of its data

function load(name) {
  if (!files.has(name)) {
    files.set(name, new Promise((resolve, reject) => {
      // A script and not fetch(), which cannot read files next to a page opened from a disk.
      const script = document.createElement("script");
      script.src = `${FOLDER}${name}.js`;
      script.onload = () => resolve(decode(globalThis.searchData[name]));
      script.onerror = () => { files.delete(name); reject(new Error(`${name} cannot be loaded`)); };
      document.head.append(script);
    }));
  }
  return files.get(name);
}

async function decode(file) {
  if (file?.format !== FORMAT) throw new Error("this file was not written by the command `export`");
  if (file.version !== VERSION) throw new Error(`the file has version ${file.version} of the format, not ${VERSION}`);
  const packed = Uint8Array.from(atob(file.maps.data), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const differences = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = file.search.grid_size, cells = size * size, count = file.maps.count;
  const maps = Array.from({length: count}, () => new Uint8Array(cells));
  for (let cell = 0, at = 0; cell < cells; cell++) {
    for (let map = 0, value = 0; map < count; map++) maps[map][cell] = value = (value + differences[at++]) & 255;
  }
  const place = cell => [cell % size, Math.floor(cell / size)];
  const episodes = file.episodes.map(episode => ({
    ...episode,
    drones: episode.actions.map((actions, drone) => track(place(file.search.drones[drone]), actions, size)),
    people: episode.persons.map(person => ({...person, path: person.cells.map(place)})),
    total: episode.persons.length,
  }));
  const policies = [...new Set(episodes.map(episode => episode.policy))];
  const seeds = [...new Set(episodes.map(episode => episode.seed))];
  return {...file.search, size, crop: cropped(maps, episodes, size), maps, maxima: file.maps.maxima, episodes, policies, seeds};
}

// The cells of a drone; one that tries to leave the grid stays.
function track([x, y], actions, size) {
  const path = [[x, y]];
  for (const action of actions) {
    const [right, down] = MOVES[action];
    x = clamp(x + right, 0, size - 1);
    y = clamp(y + down, 0, size - 1);
    path.push([x, y]);
  }
  return path;
}

// The part of the grid that is drawn: a square around the prior, the drones and the persons.
function cropped(maps, episodes, size) {
  const low = [size, size], high = [0, 0];
  const add = (...cell) => cell.forEach((value, axis) => {
    low[axis] = Math.min(low[axis], value);
    high[axis] = Math.max(high[axis], value);
  });
  for (const map of new Set(episodes.flatMap(({prior}) => prior))) maps[map].forEach((share, cell) => share && add(cell % size, Math.floor(cell / size)));
  for (const {drones, people} of episodes) [...drones, ...people.map(person => person.path)].flat().forEach(cell => add(...cell));
  const side = Math.min(Math.max(high[0] - low[0], high[1] - low[1]) + 3, size);
  const [x, y] = low.map((value, axis) => clamp(Math.round((value + high[axis] - side + 1) / 2), 0, size - side));
  return {x, y, side};
}

// The controls.

const ICONS = {
  play: "M7 4.5v15l13-7.5z", pause: "M6 5h4v14H6zM14 5h4v14h-4z", again: "M12 5V1.5L6.5 7l5.5 5.5V8a5 5 0 1 1-5 5H4.5A7.5 7.5 0 1 0 12 5z",
  first: "M6 5h2.5v14H6zM19 5v14L9.5 12z", back: "M15.5 5v14L6 12zM16.5 5H19v14h-2.5z", forward: "M8.5 5v14L18 12zM5 5h2.5v14H5z",
  full: "M4 4h6v2.5H6.5V10H4zM14 4h6v6h-2.5V6.5H14zM4 14h2.5v3.5H10V20H4zM17.5 14H20v6h-6v-2.5h3.5z",
};
const icon = name => `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`;
const button = (name, label, extra = "") => `<button type="button" data-do="${name}" aria-label="${label}" title="${label}" ${extra}>${icon(name)}</button>`;

root.insertAdjacentHTML("beforeend", `
<div class="layout" role="group" aria-label="Player of recorded searches">
  <div class="pick">
    <label class="field"><span>Search</span><select class="searches" data-pick="search"></select></label>
    <label class="field"><span>Seed</span><select data-pick="seed"></select></label>
    <div class="field" role="radiogroup" aria-label="Map"><span>Map</span><div class="segments">${Object.entries(VIEWS).map(([key, label]) =>
      `<label><input type="radio" name="view" value="${key}">${label}</label>`).join("")}</div></div>
    <label class="check"><input type="checkbox" data-pick="person"> Show the person</label>
    <label class="open"><input type="file" accept=".json" aria-label="Open a file written by the command export">Open a file</label>
  </div>
  <p class="incident"></p>
  <div class="maps"><canvas class="map" role="img"></canvas><button type="button" class="big" data-do="play" aria-label="Play">${icon("play")}</button></div>
  <div class="transport">
    <input type="range" min="0" value="0" step="1" aria-label="Step">
    <div class="buttons">
      ${button("first", "First step")}${button("back", "One step back")}${button("play", "Play", 'class="toggle"')}${button("forward", "One step forward")}
      <select data-pick="speed" aria-label="Speed in steps per second">${SPEEDS.map(speed => `<option value="${speed}">${speed} / s</option>`).join("")}</select>
      ${document.fullscreenEnabled ? button("full", "Full screen") : ""}
    </div>
    <p class="status"><span class="outcome" aria-live="polite"></span><span class="step"></span></p>
  </div>
  <div class="side">
    <div class="figures">
      <div><b data-show="success"></b><span>Probability of success</span></div>
      <div><b data-show="searches"></b><span>Searches</span></div>
      <div><b data-show="return"></b><span>Return</span></div>
    </div>
    <canvas class="curve" role="img"></canvas>
    <fieldset class="policies" aria-label="Policy"></fieldset>
  </div>
  <p class="reason"></p>
</div>`);

const find = selector => root.querySelector(selector);
const layout = find(".layout"), mapCanvas = find(".map"), curveCanvas = find(".curve"), slider = find("input[type=range]");
const shown = {view: "posterior", person: true, speed: 8, pointed: null};
let search = null, episode = null, seed = null, policy = null;
let time = 0, playing = false, goal = null, last = 0, wanted = 0, ticking = false, problem = "";

const fill = (select, values, label) =>
  select.replaceChildren(...values.map(value => new Option(label(value), value)));
const title = name => name.charAt(0).toUpperCase() + name.slice(1).replaceAll("-", " ");
const episodeOf = name => search.episodes.find(each => each.policy === name && each.seed === seed);
const isFound = each => each.ending === "found" || each.ending === "covered";
const hasEnded = () => time >= episode.steps;

async function open(name, changes = {}) {
  const turn = ++wanted;
  let next;
  try {
    next = await load(name);
  } catch (error) {
    problem = `Error: ${error.message}`;  // until another episode is chosen
    write(find(".outcome"), problem);
    return redraw();
  }
  if (turn !== wanted) return;  // another search was chosen meanwhile
  search = next;
  if (![...find(".searches").options].some(option => option.value === name)) find(".searches").add(new Option(title(search.name), name));
  find(".searches").value = name;
  root.dataset.search = name;
  fill(find("[data-pick=seed]"), search.seeds, value => value);
  find(".policies").innerHTML = search.policies.map((_, number) =>
    `<label style="--series: var(--series-${number % 5})"><input type="radio" name="policy"><i></i><span></span><b></b></label>`).join("");
  find(".policies").querySelectorAll("label").forEach((label, number) => {
    label.querySelector("input").value = search.policies[number];
    label.querySelector("span").textContent = INDEX.policies[search.policies[number]] ?? search.policies[number];
  });
  find(".incident").textContent = search.reason;
  find(".reason").textContent = `${search.outline}.`;
  choose({policy, seed, ...changes});
}

function choose(changes) {
  const before = episode, ended = before && hasEnded();
  problem = "";
  seed = search.seeds.includes(Number(changes.seed)) ? Number(changes.seed) : search.seeds[0];
  policy = search.policies.includes(changes.policy) ? changes.policy : search.policies[0];
  episode = episodeOf(policy);
  const isSame = before && search.episodes.includes(before) && before.seed === seed;
  goal = null;
  time = isSame && !ended ? Math.min(time, episode.steps) : 0;
  slider.max = episode.steps;
  find("[data-pick=seed]").value = seed;
  find(`input[name=policy][value="${CSS.escape(policy)}"]`).checked = true;
  if (INDEX.searches[find(".searches").value]) history.replaceState(null, "", `#${search.name}/${policy}/${seed}`);
  root.dataset.ready = "yes";
  redraw();
}

// Time.

function play(on) {
  if (on && hasEnded()) time = 0;
  playing = on;
  goal = null;
  root.dataset.playing = on ? "yes" : "no";
  redraw();
}

function step(by) {
  const from = goal ?? (by > 0 ? Math.floor(time) : Math.ceil(time));
  if (playing) play(false);
  goal = clamp(from + by, 0, episode.steps);
  if (stillness.matches) time = goal;
  redraw();
}

function seek(to) {
  if (playing) play(false);
  goal = null;
  time = clamp(Math.round(to), 0, episode.steps);
  redraw();
}

function redraw() {
  if (!ticking) {
    ticking = true;
    last = performance.now();
    requestAnimationFrame(tick);
  }
}

function tick(now) {
  const passed = clamp((now - last) / 1000, 0, 0.1);
  last = now;
  if (goal !== null) {
    time = time < goal ? Math.min(time + passed * GLIDE, goal) : Math.max(time - passed * GLIDE, goal);
    if (time === goal) goal = null;
  } else if (playing) {
    time = Math.min(time + passed * shown.speed, episode.steps);
    if (hasEnded()) playing = false, root.dataset.playing = "no";
  }
  draw();
  ticking = playing || goal !== null;
  if (ticking) requestAnimationFrame(tick);
}

// Everything that is drawn.

let theme = null;
function colours() {
  const style = getComputedStyle(root), read = name => style.getPropertyValue(name).trim();
  const chosen = document.body.dataset.theme, dark = chosen === "dark" || (chosen !== "light" && darkness.matches);
  // In the dark, the ramp is reversed: the likeliest cells are the brightest.
  const stops = dark ? [...INDEX.colours.map].reverse() : INDEX.colours.map;
  const ramp = Array.from({length: 256}, (_, shade) => {
    const at = shade / 255 * (stops.length - 1), low = Math.min(Math.floor(at), stops.length - 2);
    return stops[low].map((channel, number) => Math.round(mix(channel, stops[low + 1][number], at - low)));
  });
  return {
    ramp, words: ramp.map(([r, g, b]) => (255 << 24 | b << 16 | g << 8 | r) >>> 0), font: style.fontFamily, ink: read("--color-foreground-primary"), grey: read("--color-foreground-muted"),
    line: read("--line"), ground: read("--color-background-primary"), found: read("--found"),
    series: number => read(`--series-${number % 5}`),
  };
}

const viewed = () => shown.view === "both" ? ["prior", "posterior"] : [shown.view];
const sideOf = (width, gap) => (width - gap * (viewed().length - 1)) / viewed().length;

function prepare(canvas) {
  const box = canvas.getBoundingClientRect(), scale = window.devicePixelRatio || 1;
  const width = Math.round(box.width * scale), height = Math.round(box.height * scale);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
  const context = canvas.getContext("2d");
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, width, height);
  return {context, width, height, scale};
}

function draw() {
  if (!episode) return;
  theme ??= colours();
  if (stillness.matches && playing) drawAt(Math.floor(time));
  else drawAt(time);
}

function drawAt(at) {
  const now = Math.floor(at), {context, width, height, scale} = prepare(mapCanvas);
  const views = viewed(), side = Math.floor(Math.min(sideOf(width, GAP * scale), height - STRIP * scale));
  views.forEach((view, number) => {
    const left = number * (width - side) / Math.max(views.length - 1, 1);
    drawMap(context, view, at, Math.round(left), side / search.crop.side, scale);
  });
  drawCurves(at);
  report(at, now);
}

const sheet = document.createElement("canvas"), image = sheet.getContext("2d");
let pixels = null, words = null;

function drawMap(context, view, at, left, cell, scale) {
  const now = Math.floor(at), next = Math.min(now + 1, episode.steps), part = at - now, {size, crop} = search;
  const numbers = episode[view];
  const one = search.maps[numbers[now]], other = search.maps[numbers[next]], side = Math.round(crop.side * cell);
  if (sheet.width !== size || !pixels) {
    sheet.width = sheet.height = size;
    pixels = image.createImageData(size, size);
    words = new Uint32Array(pixels.data.buffer);
  }
  for (let number = 0; number < one.length; number++) {
    words[number] = theme.words[Math.round(mix(one[number], other[number], part) * 2.55)];
  }
  image.putImageData(pixels, 0, 0);
  context.save();
  context.translate(left, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(sheet, crop.x, crop.y, crop.side, crop.side, 0, 0, side, side);
  if (search.metres_per_cell) drawBearings(context, side, cell, scale);
  context.strokeStyle = theme.line;
  context.lineWidth = scale;
  context.strokeRect(scale / 2, scale / 2, side - scale, side - scale);
  drawLegend(context, view, mix(search.maxima[numbers[now]], search.maxima[numbers[next]], part), side, scale);
  context.beginPath();
  context.rect(0, 0, side, side);
  context.clip();
  const centre = ([x, y]) => [(x - crop.x + 0.5) * cell, (y - crop.y + 0.5) * cell];
  drawSearched(context, at, centre, cell, scale);
  episode.drones.forEach((path, drone) => drawTrail(context, path, at, centre, drone, cell, scale));
  episode.people.forEach(person => drawPerson(context, person, at, centre, cell, scale));
  episode.drones.forEach((path, drone) => drawDrone(context, path, at, centre, drone, cell, scale));
  context.restore();
}

// A scale bar of at most a third of the map, and the direction of north, on halos.
function drawBearings(context, side, cell, scale) {
  const width = side / scale, metresPerPixel = search.metres_per_cell * scale / cell, longest = width / 3 * metresPerPixel;
  const power = 10 ** Math.floor(Math.log10(longest)), metres = power * [5, 2, 1].find(factor => factor * power <= longest);
  const bar = new Path2D(`M10 ${width - 15}v5h${metres / metresPerPixel}v-5`), arrow = new Path2D(`M${width - 16} 8l6 15l-6 -4l-6 4z`);
  const labels = [[metres < 1000 ? `${metres} m` : `${metres / 1000} km`, 10, width - 19, "left"], ["N", width - 16, 36, "center"]];
  context.save();
  context.scale(scale, scale);
  context.font = `600 12px ${theme.font}`;
  context.lineJoin = "round";
  for (const halo of [true, false]) {
    context.strokeStyle = context.fillStyle = halo ? rgb(theme.ramp[0], 0.8) : theme.ink;
    context.lineWidth = halo ? 5 : 2;
    context.stroke(bar);
    if (halo) context.stroke(arrow);
    else context.fill(arrow);
    for (const [text, x, y, align] of labels) {
      context.textAlign = align;
      if (halo) context.strokeText(text, x, y);
      else context.fillText(text, x, y);
    }
  }
  context.restore();
}

function drawLegend(context, view, most, side, scale) {
  const top = side + 9 * scale, height = 11 * scale, width = Math.min(84 * scale, side - 130 * scale);
  context.font = `600 ${13 * scale}px ${theme.font}`;
  context.textBaseline = "middle";
  context.fillStyle = theme.ink;
  context.fillText(VIEWS[view], 0, top + height / 2 + scale);
  context.font = `${12 * scale}px ${theme.font}`;
  context.fillStyle = theme.grey;
  context.textAlign = "right";
  const text = `${(100 * most).toPrecision(most < 0.1 ? 2 : 3)}%`;
  context.fillText(text, side, top + height / 2 + scale);
  const right = side - 48 * scale, gradient = context.createLinearGradient(right - width, 0, right, 0);
  for (let stop = 0; stop <= 16; stop++) gradient.addColorStop(stop / 16, rgb(theme.ramp[Math.round(stop * 255 / 16)]));
  context.fillStyle = gradient;
  context.fillRect(right - width, top, width, height);
  context.strokeRect(right - width, top, width, height);
  context.fillStyle = theme.grey;
  context.fillText("0", right - width - 6 * scale, top + height / 2 + scale);
  context.textAlign = "left";
}

function drawSearched(context, at, centre, cell, scale) {
  const now = Math.floor(at);
  episode.actions.forEach((actions, drone) => {
    for (let done = 1; done <= now; done++) {
      if (Number(actions[done - 1]) !== SEARCH) continue;
      const [x, y] = centre(episode.drones[drone][done]), alpha = mix(0.85, 0.16, clamp((at - done) / FADE, 0, 1));
      context.fillStyle = rgb(colourOf(drone), alpha);
      context.beginPath();
      context.arc(x, y, Math.max(0.17 * cell, 1.4 * scale), 0, 7);
      context.fill();
    }
  });
}

function position(path, at) {
  const now = Math.min(Math.floor(at), path.length - 1), next = path[Math.min(now + 1, path.length - 1)];
  return path[now].map((value, axis) => mix(value, next[axis], at - Math.floor(at)));
}

function drawTrail(context, path, at, centre, drone, cell, scale) {
  const now = Math.floor(at), from = Math.max(now - TRAIL, 0);
  context.lineWidth = Math.max(0.13 * cell, 1.6 * scale);
  for (let place = from; place <= now; place++) {
    const end = place === now ? position(path, at) : path[place + 1];
    context.strokeStyle = rgb(colourOf(drone), clamp(1 - (at - place) / TRAIL, 0, 1) * 0.8);
    context.beginPath();
    context.moveTo(...centre(path[place]));
    context.lineTo(...centre(end));
    context.stroke();
  }
}

function drawDrone(context, path, at, centre, drone, cell, scale) {
  const colour = colourOf(drone), radius = Math.max(0.48 * cell, 9.5 * scale);
  const action = Number(episode.actions[drone][Math.floor(at)]), part = at - Math.floor(at);
  context.save();
  context.translate(...centre(position(path, at)));
  if (action === SEARCH && part > 0) {  // a pulse while it searches
    context.strokeStyle = rgb(colour, 1 - part);
    context.lineWidth = 2 * scale;
    context.beginPath();
    context.arc(0, 0, radius * mix(0.8, 2, part), 0, 7);
    context.stroke();
  }
  const edge = Math.max(1.2 * scale, 0.08 * radius);
  for (const [reach, paint] of [[radius, "#fff"], [radius - edge, INK], [radius - 2 * edge, rgb(colour)]]) {
    context.beginPath();
    context.arc(0, 0, reach, 0, 7);
    context.fillStyle = paint;
    context.fill();
  }
  const [r, g, b] = colour;
  context.fillStyle = 0.299 * r + 0.587 * g + 0.114 * b > 140 ? INK : "#fff";
  context.font = `600 ${(drone < 10 ? 1.25 : 1) * radius}px ${theme.font}`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(drone, 0, 0.06 * radius);
  context.restore();
}

// A life ring; with a green border once the person is found.
function drawPerson(context, person, at, centre, cell, scale) {
  const isNow = person.found_by !== null && at >= person.path.length - 1;
  if (!shown.person && !isNow && at < episode.steps) return;
  const radius = Math.max(0.42 * cell, 9 * scale);
  context.save();
  context.translate(...centre(position(person.path, at)));
  if (isNow) {
    context.beginPath();
    context.arc(0, 0, radius * 2.1, 0, 7);
    context.strokeStyle = theme.ground;
    context.lineWidth = 6 * scale;
    context.stroke();
    context.strokeStyle = theme.found;
    context.lineWidth = 3.5 * scale;
    context.stroke();
  }
  context.lineWidth = 0.52 * radius;
  context.beginPath();
  context.arc(0, 0, 0.7 * radius, 0, 7);
  context.strokeStyle = "#fff";
  context.stroke();
  context.strokeStyle = rgb(INDEX.colours.person);
  for (let part = 0; part < 4; part++) {
    context.beginPath();
    context.arc(0, 0, 0.7 * radius, part * Math.PI / 2 + 0.3, part * Math.PI / 2 + 1.3);
    context.stroke();
  }
  context.lineWidth = scale;
  context.strokeStyle = "rgb(12 18 30 / .8)";
  for (const edge of [0.44, 0.97]) {
    context.beginPath();
    context.arc(0, 0, edge * radius, 0, 7);
    context.stroke();
  }
  context.restore();
}

// The curves: those of the other policies thin, all only up to this step until the episode ends.
const MARGIN = {left: 36, right: 14, top: 8, bottom: 20};

function drawCurves(at) {
  const {context, width, height, scale} = prepare(curveCanvas);
  const {left, right, top, bottom} = Object.fromEntries(Object.entries(MARGIN).map(([key, value]) => [key, value * scale]));
  const others = search.policies.map(episodeOf), limit = search.timestep_limit;
  const most = Math.ceil(10 * Math.max(0.1, ...others.map(each => each.success.at(-1)))) / 10;
  const x = now => left + now / limit * (width - left - right), y = share => top + (1 - share / most) * (height - top - bottom);
  context.font = `${11.5 * scale}px ${theme.font}`;
  context.textBaseline = "middle";
  context.lineWidth = scale;
  context.strokeStyle = theme.line;
  context.fillStyle = theme.grey;
  context.textAlign = "right";
  for (const share of most > 0.5 ? [0, 0.25, 0.5, 0.75, 1] : [0, 0.1, 0.2, 0.3, 0.4, 0.5]) {
    if (share > most + 1e-9) continue;
    context.beginPath();
    context.moveTo(left, y(share));
    context.lineTo(width - right, y(share));
    context.stroke();
    context.fillText(`${Math.round(100 * share)}%`, left - 6 * scale, y(share));
  }
  context.textAlign = "center";
  const isTimed = search.seconds_per_step !== null, unit = isTimed ? 60 / search.seconds_per_step : 1, units = limit / unit;  // a minute or a step
  const stride = (isTimed ? [1, 2, 5, 10, 20, 30, 60, 120] : [10, 25, 50, 100, 250, 500]).find(each => units / each <= 6) ?? units;
  for (let now = 0; now <= units; now += stride) context.fillText(isTimed && !now ? "0 min" : now, x(now * unit), height - 8 * scale);
  const order = [...others.keys()].sort((a, b) => (others[a] === episode) - (others[b] === episode));
  for (const number of order) {
    const each = others[number], isThis = each === episode, until = at >= episode.steps ? each.steps : Math.min(at, each.steps);
    context.strokeStyle = context.fillStyle = theme.series(number);
    const isPointed = each.policy === shown.pointed;
    context.globalAlpha = isThis || isPointed ? 1 : 0.75;
    context.lineWidth = (isThis ? 3 : isPointed ? 2.6 : 1.5) * scale;
    context.lineJoin = "round";
    context.beginPath();
    context.moveTo(x(0), y(0));
    for (let now = 1; now <= until; now++) context.lineTo(x(now), y(each.success[now]));
    const now = Math.floor(until), end = mix(each.success[now], each.success[Math.min(now + 1, each.steps)], until - now);
    context.lineTo(x(until), y(end));
    context.stroke();
    if (isThis || (until >= each.steps && isFound(each))) {
      context.beginPath();
      context.arc(x(until), y(end), (isThis ? 4.5 : 3) * scale, 0, 7);
      context.fill();
    }
  }
  context.globalAlpha = 1;
}

// Words and figures.

function result(each) {
  const found = each.people.filter(person => person.found_by !== null).length, steps = duration(each.steps);
  if (each.ending === "found") return each.total > 1 ? `All ${each.total} persons found in ${steps}` : `Found in ${steps}`;
  if (each.ending === "covered") return `Covered in ${steps}`;
  if (each.ending === "collision") return `Drones collided in step ${each.steps}`;
  if (each.ending === "left_grid") return `A drone left the grid in step ${each.steps}`;
  return found ? `${found} of ${each.total} persons found in ${steps}` : each.total ? `Not found in ${steps}` : `Time limit reached after ${steps}`;
}

function clock(now) {
  const seconds = now * search.seconds_per_step;
  return `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
}

const duration = steps => search.seconds_per_step ? `${clock(steps)} min` : `${steps} steps`;

const write = (element, text) => { if (element.textContent !== text) element.textContent = text; };

function report(at, now) {
  const ended = at >= episode.steps;
  root.dataset.step = now;
  slider.value = now;
  slider.setAttribute("aria-valuetext", `step ${now} of ${episode.steps}`);
  const minutes = search.seconds_per_step ? `${clock(now)} of ${duration(search.timestep_limit)}, step ${now}` : "";
  write(find(".step"), minutes || `Step ${now} of ${search.timestep_limit}`);
  write(find("[data-show=success]"), percent(episode.success[now]));
  const searches = episode.actions.reduce((sum, actions) => sum + actions.slice(0, now).split(String(SEARCH)).length - 1, 0);
  write(find("[data-show=searches]"), String(searches));
  write(find("[data-show=return]"), Math.round(episode.returns[now]).toLocaleString("en").replace("-", "\u2212"));
  const finds = episode.people.filter(person => person.found_by !== null && now >= person.path.length - 1).length;
  const outcome = find(".outcome");
  write(outcome, problem || (ended ? result(episode) : finds ? `${finds} of ${episode.total} persons found` : ""));
  outcome.className = `outcome ${problem ? "failed" : ended ? (isFound(episode) ? "found" : "failed") : finds ? "found" : ""}`;
  find(".policies").querySelectorAll("b").forEach((label, number) => {
    const each = episodeOf(search.policies[number]);
    write(label, ended || at >= each.steps ? (isFound(each) ? duration(each.steps) : "not found") : "");
  });
  const state = `step ${now} of ${search.name} with ${policy}, seed ${seed}; probability of success ${percent(episode.success[now])}`;
  mapCanvas.setAttribute("aria-label", `Map, ${VIEWS[shown.view].toLowerCase()}: ${state}`);
  curveCanvas.setAttribute("aria-label", `Probability of success over time: ${state}`);
  const name = playing ? "Pause" : ended ? "Play again" : "Play", toggle = find(".toggle");
  if (toggle.getAttribute("aria-label") !== name) {
    toggle.setAttribute("aria-label", name);
    toggle.title = name;
    toggle.innerHTML = icon(playing ? "pause" : ended ? "again" : "play");
  }
  find(".big").hidden = playing || at > 0;
}

// What the visitor does.

const ACTIONS = {
  play: () => play(!playing), first: () => seek(0), back: () => step(-1), forward: () => step(1), last: () => seek(episode.steps),
  full: () => document.fullscreenElement ? document.exitFullscreen() : root.requestFullscreen(),
};
const KEYS = {" ": "play", ArrowLeft: "back", ArrowRight: "forward", Home: "first", End: "last"};

function show(changes) {
  Object.assign(shown, changes);
  find(`input[name=view][value=${shown.view}]`).checked = true;
  find("[data-pick=person]").checked = shown.person;
  find("[data-pick=speed]").value = shown.speed;
  arrange();
}

// The canvas is as high as its maps and the legend.
function arrange() {
  layout.classList.toggle("both", shown.view === "both");
  mapCanvas.style.height = `${sideOf(mapCanvas.clientWidth, GAP) + STRIP}px`;
  redraw();
}

root.addEventListener("click", event => {
  const pressed = event.target.closest("[data-do]");
  if (episode && pressed) ACTIONS[pressed.dataset.do]();
});
// The curve of the policy under the pointer stands out.
find(".policies").addEventListener("pointerover", event => show({pointed: event.target.closest("label")?.querySelector("input").value}));
find(".policies").addEventListener("pointerleave", () => show({pointed: null}));
mapCanvas.addEventListener("click", () => episode && play(!playing));
slider.addEventListener("input", () => episode && seek(Number(slider.value)));

function scrub(event) {
  const box = curveCanvas.getBoundingClientRect();
  seek((event.clientX - box.left - MARGIN.left) / (box.width - MARGIN.left - MARGIN.right) * search.timestep_limit);
}
curveCanvas.addEventListener("pointerdown", event => episode && (curveCanvas.setPointerCapture(event.pointerId), scrub(event)));
curveCanvas.addEventListener("pointermove", event => event.buttons && episode && scrub(event));

root.addEventListener("change", event => {
  const {name, value, dataset, checked, type} = event.target;
  if (name === "view") show({view: value});
  else if (name === "policy") choose({policy: value, seed});
  else if (dataset.pick === "search") open(value);
  else if (dataset.pick === "seed") choose({policy, seed: value});
  else if (dataset.pick === "speed") show({speed: Number(value)});
  else if (dataset.pick === "person") show({person: checked});
  else if (type === "file" && event.target.files.length) openFile(event.target);
});

async function openFile(input) {
  const [file] = input.files, name = `file ${file.name}`;
  files.set(name, file.text().then(JSON.parse).then(decode));
  files.get(name).catch(() => files.delete(name));
  input.value = "";
  await open(name);
}

document.addEventListener("keydown", event => {
  if (!episode || event.altKey || event.ctrlKey || event.metaKey) return;
  const {target, key} = event, isOurs = root.contains(target);
  if (!isOurs && target !== document.body) return;  // the page's search, links and menus
  // Some keys belong to the control that has the focus.
  if (target.matches("select") || (key === " " && target.matches("button, [type=checkbox], [type=file]"))) return;
  if (target.matches("[type=range], [type=radio]") && key.startsWith("Arrow")) return;
  if (KEYS[key]) ACTIONS[KEYS[key]]();
  else if (key === "m") show({view: Object.keys(VIEWS)[(Object.keys(VIEWS).indexOf(shown.view) + 1) % 3]});
  else if (key === "h") show({person: !shown.person});
  else return;
  event.preventDefault();
});

const restyle = () => { theme = null; redraw(); };
new MutationObserver(restyle).observe(document.body, {attributes: true, attributeFilter: ["data-theme"]});
darkness.addEventListener("change", restyle);
new ResizeObserver(arrange).observe(layout);

function fromAddress() {
  const [name, ...rest] = decodeURIComponent(location.hash.slice(1)).split("/");
  open(INDEX.searches[name] ? name : Object.keys(INDEX.searches)[0], {policy: rest[0], seed: rest[1]});
}
addEventListener("hashchange", fromAddress);
fill(find(".searches"), Object.keys(INDEX.searches), title);
root.dataset.playing = "no";
show({});
fromAddress();

})();
