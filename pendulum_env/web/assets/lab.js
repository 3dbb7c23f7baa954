// The lab: its state, its controls, the clock, the plots, links, and the check of all bits.

const KEEP = 3000; // readings kept of a run; beyond, every other one goes
const BUDGET = 8; // milliseconds of computing in a frame
const SLICE = 256; // steps of the finest pendulum between two looks at the clock
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 50];
const LEAST_STEP = 1e-4, MOST_STEP = 2; // of the sliders [s]
const SHORTEST = 0.000001, LONGEST = 10; // steps that can be typed [s]
const SMALL = 20; // largest start angle at which nothing is said of small angles [degrees]

const lab = {
  scene: Object.keys(PAGE.scenes)[0], values: [], angle: 0, velocity: 0, lanes: [], playing: true, speed: 1, time: 0,
  torque: 0, drawn: 0,
};

/** Readings of a run, of which every other one is dropped whenever there are too many. */
class History {
  constructor() {
    this.rows = [];
    this.stride = 1;
    this.count = 0;
  }

  add(row) {
    if (this.count % this.stride === 0) this.rows.push(row);
    this.count += 1;
    if (this.rows.length > KEEP) {
      this.rows = this.rows.filter((_, i) => i % 2 === 0);
      this.stride *= 2;
    }
  }
}

/** One of the pendulums side by side: its method and step, its run and the accurate run beside it. */
class Lane {
  constructor(method, dt) {
    this.method = method;
    this.dt = dt;
  }

  start() {
    const place = PAGE.scenes[lab.scene];
    this.machine = new Machine(lab.scene, this.method, lab.values, this.dt, lab.angle, lab.velocity);
    this.parts = Math.max(1, Math.ceil(this.dt / place.run.dt - 1e-9)); // steps of the accurate run in one of this
    this.ghost = new Machine(lab.scene, place.accurate, lab.values, this.dt / this.parts, lab.angle, lab.velocity);
    this.radius = place.radius;
    this.reach = place.reach;
    this.suspension = place.suspension;
    this.outline = place.outline;
    this.steps = 0;
    this.ended = "";
    this.history = new History();
    this.section = [];
    this.periods = 0; // of the drive, that are over
    const info = this.machine.last, parameters = parametersOf(lab.scene, lab.values);
    this.period = place.beat ? (2 * Math.PI) / Math.abs(parameters[place.beat]) : Infinity;
    // what errors of the energy are compared with: the energy at the start or, from rest, m g L
    const first = Math.abs(info.energy);
    this.reference = first > 1e-6 * parameters.scale ? first : parameters.scale || 1;
    const share = place.motor || place.beat ? 2 : 0.05; // driven pendulums soon have more energy than at the start
    this.scale = Math.max(Math.abs(info.energy), share * parameters.scale) * 1.25;
    this.read(info, this.ghost.last);
  }

  get name() {
    return PAGE.methods[this.method].title;
  }

  /** The displacement of the pivot by a drive, "horizontal" or "vertical", over the length. */
  shaken(way, time) {
    const find = (what) => {
      const at = PAGE.scenes[lab.scene].settings.findIndex((setting) => setting.label === `${way} ${what}`);
      return at < 0 ? 0 : lab.values[at];
    };
    const amplitude = find("amplitude");
    return amplitude && (amplitude / this.reach) * Math.cos(find("rate") * time + find("phase"));
  }

  /** Store a reading. */
  read(info, ghost) {
    const energies = { kinetic: info.kinetic_energy, potential: info.potential_energy, heat: info.heat, work: info.work,
      residual: info.energy_residual };
    this.energies = energies;
    this.history.add([info.time, info.angle, info.velocity, info.energy, info.energy_residual, ghost.angle, ghost.velocity]);
  }

  /** Take up to `count` steps; a pendulum that stops keeps its last finite state. */
  take(count) {
    const most = Math.max(1, Math.floor(count / 64));
    let left = count;
    while (left > 0 && !this.ended) {
      const before = this.machine.last;
      const whole = Math.floor(((this.periods + 1) * this.period - before.time) / this.dt - 1e-9); // steps in this period
      const many = Math.max(1, Math.min(most, left, whole));
      left -= many;
      this.machine.take(1, many, lab.torque);
      if (!this.ghost.stopped) this.ghost.take(1, many * this.parts, lab.torque);
      const info = this.machine.info();
      const finite = [info.time, info.angle, info.velocity, info.energy].every(Number.isFinite);
      if (finite) this.machine.last = info;
      if (!this.ghost.stopped) this.ghost.last = this.ghost.info();
      if (this.machine.stopped || !finite) {
        this.end(this.machine.stopped || 1);
      } else {
        this.steps += many;
        this.cross(before, info);
        this.read(info, this.ghost.stopped ? { angle: NaN, velocity: NaN } : this.ghost.last);
      }
    }
  }

  /** Keep the state at the end of a period of the drive: within a step, the cubic through both states (Hermite). */
  cross(before, info) {
    const past = this.periods, step = info.time - before.time;
    this.periods = Math.floor(info.time / this.period + 1e-12);
    if (this.periods === past || !(step > 0)) return;
    const s = (this.periods * this.period - before.time) / step, rest = 1 - s;
    const [rise, old, now] = [info.angle - before.angle, before.velocity * step, info.velocity * step];
    const angle = before.angle + s * s * (3 - 2 * s) * rise + s * rest * (rest * old - s * now);
    const velocity = (6 * s * rest * rise + rest * (1 - 3 * s) * old + s * (3 * s - 2) * now) / step;
    this.section.push([wrapped(angle) * DEGREES, velocity]);
    if (this.section.length > 20000) this.section.splice(0, 10000);
  }

  end(code) {
    const info = this.machine.last;
    this.ended = `${this.name} stopped at ${info.time.toFixed(2)} s: ${PAGE.stops[code] ?? "its numbers are no longer finite"}.`;
    byId("message").textContent = lab.lanes.map((lane) => lane.ended).filter(Boolean).join(" ");
  }
}

/** An angle within half a turn of the bottom [rad]. */
function wrapped(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

// --- the clock -----------------------------------------------------------------------------------------------------

function restart() {
  lab.time = 0;
  const small = !PAGE.scenes[lab.scene].periodic && Math.abs(lab.angle) * DEGREES > SMALL;
  const recorded = PAGE.recording ? PAGE.recording[1][0] : NaN; // the first reading; 0 of a sensor that is zeroed at its start
  const apart = recorded !== 0 && Math.abs(recorded - lab.angle * DEGREES) > 0.1 * Math.max(Math.abs(recorded), Math.abs(lab.angle) * DEGREES);
  say([small ? "This scene's force grows with the angle itself, which is right for small angles only." : "",
    apart ? `The recording begins at ${short6(recorded)}°: type it as the start angle to compare.` : ""].filter(Boolean).join(" "));
  for (const lane of lab.lanes) lane.start();
  show();
}

/** Move the clock and all pendulums to a time [s], as far as the budget of a frame allows. */
function advance(time) {
  const begun = performance.now();
  let running = lab.lanes.filter((lane) => !lane.ended);
  while (running.length && lab.time < time && performance.now() - begun <= BUDGET) {
    // all together, a slice of steps of the finest pendulum at a time
    lab.time = Math.min(time, lab.time + SLICE * Math.min(...running.map((lane) => lane.dt)));
    for (const lane of running) lane.take(Math.floor(lab.time / lane.dt + 1e-9) - lane.steps);
    running = running.filter((lane) => !lane.ended);
  }
}

let last = 0;

function frame(now) {
  const passed = Math.min((now - last) / 1000, 0.1);
  last = now;
  if (lab.playing && !document.hidden) {
    const wanted = lab.time + passed * lab.speed;
    advance(wanted);
    lab.late = lab.time < wanted - 1e-9 && lab.lanes.some((lane) => !lane.ended);
    show(now);
  }
  requestAnimationFrame(frame);
}

/** Take one step of the pendulum with the shortest step, and all steps of the others that end by then. */
function singleStep() {
  play(false);
  const running = lab.lanes.filter((lane) => !lane.ended);
  if (!running.length) return;
  advance(Math.min(...running.map((lane) => (lane.steps + 1) * lane.dt)));
  show();
}

function play(wanted) {
  lab.playing = wanted;
  byId("play").textContent = wanted ? "Pause" : "Play";
}

// --- what is drawn -------------------------------------------------------------------------------------------------

const PLOTS = ["angle", "error", "phase", "distance", "section"];
const CAPTIONS = {
  angle: "Angle against time; the accurate solution is pale",
  error: "Residual: the error in the energy balance, as a share of the energy at the start, or of m g L if that energy is 0",
  phase: "Phase portrait; the accurate orbit is pale",
  distance: "Distance of the angle from the accurate solution",
  section: "Poincaré section: the state once in each period of the drive",
};
const TURNS = 3; // frames in which every plot is drawn once
const REACH = 36; // distance from a bob within which it is grabbed [CSS pixels]
const LANE_PICTURES = [];

function show(now) {
  const colour = paint();
  for (const [i, lane] of lab.lanes.entries()) drawApparatus(LANE_PICTURES[i], lane, lab.torque, colour);
  byId("clock").textContent = `${(Math.floor(100 * lab.time + 1e-6) / 100).toFixed(2)} s${lab.late ? ", slower than asked" : ""}`;
  PLOTS.forEach((name, i) => {
    if (now === undefined || i % TURNS === lab.drawn % TURNS) PLOTTED[name](colour);
  });
  lab.drawn += 1;
}

/** The number of the pendulum with the shortest step, whose readings of the accurate solution are the densest. */
function finest() {
  return lab.lanes.reduce((best, lane, i) => (lane.dt < lab.lanes[best].dt ? i : best), 0);
}

/** The axis of time, and the readings of every pendulum in it. */
function recent() {
  const start = Math.max(0, lab.time - 20);
  return { time: [start, Math.max(lab.time, start + 2)],
    rows: lab.lanes.map((lane) => lane.history.rows.filter((row) => row[0] >= start - 0.5)) };
}

/** Draw a quantity of every pendulum, a function of a reading, against time on a logarithmic axis. */
function drawLogarithm(name, ylabel, quantity, colour) {
  const { time, rows } = recent();
  const curves = lab.lanes.map((lane, i) => ({ colour: lane.colour,
    points: rows[i].map((row) => [row[0], logarithm(quantity(row, lane))]) }));
  drawPlot(byId(`plot-${name}`), { x: time, y: decades(curves), log: true, xlabel: "time [s]", ylabel, curves }, colour);
}

const PLOTTED = {
  angle(colour) {
    const { time, rows } = recent();
    const curves = [{ colour: colour("faint-ink"), alpha: 0.45, width: 4,
      points: rows[finest()].map((row) => [row[0], row[5] * DEGREES]) }];
    if (PAGE.recording) {
      const [times, degrees] = PAGE.recording;
      curves.push({ colour: colour("ink"), dots: true, points: times.map((t, i) => [t, degrees[i]]).filter(
        ([t]) => t >= time[0] && t <= time[1]) });
    }
    lab.lanes.forEach((lane, i) => curves.push({ colour: lane.colour, points: rows[i].map((row) => [row[0], row[1] * DEGREES]) }));
    drawPlot(byId("plot-angle"), { x: time, y: around(valuesOf(curves), 1), xlabel: "time [s]", ylabel: "angle [°]", curves },
      colour);
  },
  error(colour) {
    drawLogarithm("error", "relative error", (row, lane) => row[4] / lane.reference, colour);
  },
  phase,
  distance(colour) {
    drawLogarithm("distance", "distance [°]", (row) => Math.abs(row[1] - row[5]) * DEGREES, colour);
  },
  section(colour) {
    const driven = lab.lanes.some((lane) => Number.isFinite(lane.period));
    byId("plot-section").parentElement.hidden = !driven;
    if (!driven) return;
    const all = lab.lanes.flatMap((lane) => lane.section);
    const top = all.filter(([angle]) => Math.abs(angle) > 90).length > 0.5 * all.length; // then about the top
    const curves = lab.lanes.map((lane) => ({ colour: lane.colour, dots: true,
      points: lane.section.map(([angle, v]) => [top && angle < 0 ? angle + 360 : angle, v]) }));
    drawPlot(byId("plot-section"), { x: top ? [0, 360] : [-180, 180], y: around(valuesOf(curves), 0.1), xlabel: "angle [°]",
      ylabel: "velocity [rad/s]", curves }, colour);
  },
};

/** Draw the phase portrait, in turns of 360 degrees if a pendulum goes over the top. */
function phase(colour) {
  const rows = lab.lanes.map((lane) => lane.history.rows.slice(-1200));
  const over = rows.some((some) => some.some((row) => Math.abs(row[1]) > 1.05 * Math.PI));
  const path = (some, a, v) => {
    const points = [];
    let before = 0;
    for (const row of some) {
      const angle = over ? wrapped(row[a]) : row[a];
      if (over && Math.abs(angle - before) > Math.PI) points.push([NaN, NaN]);
      points.push([angle * DEGREES, row[v]]);
      before = angle;
    }
    return points;
  };
  const curves = lab.lanes.map((lane, i) => ({ colour: lane.colour, points: path(rows[i], 1, 2) }));
  const ghost = { colour: colour("faint-ink"), alpha: 0.45, width: 4, points: path(rows[finest()], 5, 6) };
  const x = over ? [-180, 180] : around(valuesOf([ghost, ...curves], 0), 2);
  const y = around(valuesOf([ghost, ...curves]), 0.02);
  const { gravity_rate: rate } = parametersOf(lab.scene, lab.values);
  const edge = [];
  if (rate > 0 && PAGE.scenes[lab.scene].periodic) {
    for (const side of [1, -1]) {
      for (let degrees = -180; degrees <= 180; degrees += 3) {
        edge.push([degrees, side * 2 * Math.sqrt(rate) * Math.cos(degrees / DEGREES / 2)]);
      }
      edge.push([NaN, NaN]);
    }
  }
  const caption = `${CAPTIONS.phase}${edge.length ? ", the separatrix dashed" : ""}`;
  byId("plot-phase").parentElement.firstChild.textContent = caption;
  const dots = lab.lanes.map((lane) => ({ colour: lane.colour, dots: true, width: 5, points: [
    [(over ? wrapped(lane.machine.last.angle) : lane.machine.last.angle) * DEGREES, lane.machine.last.velocity]] }));
  drawPlot(byId("plot-phase"), { x, y, xlabel: "angle [°]", ylabel: "velocity [rad/s]", curves: [ghost,
    { colour: colour("ink"), dash: [5, 4], width: 1, points: edge }, ...curves, ...dots] }, colour);
}

function valuesOf(curves, column = 1) {
  return curves.flatMap((curve) => curve.points.map((point) => point[column])).filter(Number.isFinite);
}

function logarithm(value) {
  const size = Math.abs(value);
  return size > 0 ? Math.max(Math.log10(size), -17) : NaN;
}

/** Limits of a logarithmic axis, whole powers of ten. */
function decades(curves) {
  const values = valuesOf(curves);
  if (!values.length) return [-16, 0];
  const [low, high] = around(values, 0);
  return [Math.max(-17, Math.floor(low)), Math.max(Math.ceil(high), Math.floor(low) + 2)];
}

// --- controls ------------------------------------------------------------------------------------------------------

/** Choose a scene, with its usual numbers, and give every pendulum a method that fits it. */
function chooseScene(name) {
  const place = PAGE.scenes[name];
  lab.scene = name;
  lab.values = place.settings.map((setting) => setting.value);
  lab.angle = place.run.angle;
  lab.velocity = place.run.velocity;
  lab.torque = 0;
  byId("torque").value = "0";
  for (const lane of lab.lanes) {
    if (!place.shown.includes(lane.method)) lane.method = place.shown[0];
    lane.dt = place.run.dt;
  }
  rebuild();
}

/** Make all controls and pictures anew for the present scene and pendulums. */
function rebuild() {
  const place = PAGE.scenes[lab.scene];
  byId("scene").value = lab.scene;
  byId("about").textContent = place.about;
  byId("equation").innerHTML = place.equation;
  byId("torque-label").hidden = !place.motor;
  const groups = { "body-settings": [], "damping-settings": [], "drive-settings": [] };
  place.settings.forEach((setting, i) => {
    const group = setting.effect === "" || setting.kind === "conservative" ? "body-settings"
      : setting.kind === "dissipative" ? "damping-settings" : "drive-settings";
    groups[group].push(settingControl(setting, i));
  });
  for (const [id, controls] of Object.entries(groups)) {
    byId(id).replaceChildren(...(controls.length || id === "body-settings" ? controls
      : [element("p", { className: "hint", textContent: id === "damping-settings" ? "Nothing: no energy is lost."
        : place.motor ? "" : "Nothing." })]));
  }
  const colour = paint();
  lab.lanes.forEach((lane) => { lane.colour = colour(`hue-${hueOf(lane)}`); });
  LANE_PICTURES.length = 0;
  byId("pendulums").replaceChildren(...lab.lanes.map(lanePicture));
  byId("lanes").replaceChildren(...lab.lanes.map(laneControl));
  byId("add").disabled = lab.lanes.length >= PAGE.most;
  fill();
  restart();
}

/** The hue of a pendulum: that of its method in our figures, or the next free one if another pendulum has it. */
function hueOf(lane) {
  const taken = lab.lanes.slice(0, lab.lanes.indexOf(lane)).map((other) => other.hue);
  let hue = PAGE.methods[lane.method].hue;
  while (taken.includes(hue)) hue = (hue + 1) % 8;
  lane.hue = hue;
  return hue;
}

/** Write the present numbers into equation and start. */
function fill() {
  const parameters = parametersOf(lab.scene, lab.values);
  for (const one of byId("equation").querySelectorAll("[data-number]")) {
    one.textContent = short6(parameters[one.dataset.number]);
  }
  byId("angle").value = String(Number((lab.angle * DEGREES).toPrecision(7)));
  byId("velocity").value = String(lab.velocity);
}

/** A number with six digits, as Python's format ".6g" writes it. */
function short6(value) {
  return String(Number(value.toPrecision(6))).replace("-", "−");
}

function settingControl(setting, i) {
  const id = `setting-${i}`, usual = setting.value;
  const box = element("input", { type: "number", step: "any", inputmode: "decimal", id, value: String(lab.values[i]) });
  const slider = element("input", { type: "range", min: "-1", max: "1", step: "0.01", "aria-label": `${setting.label}, slider` });
  slider.value = String(usual > 0 && lab.values[i] > 0 ? Math.log(lab.values[i] / usual) / Math.log(5) : 0);
  const unit = setting.unit === "1" ? "" : ` [${setting.unit}]`;
  const label = element("label", { htmlFor: id, title: setting.about },
    `${setting.effect ? `${setting.effect}: ` : ""}${setting.label}${unit}`);
  const take = (value) => {
    const least = setting.least;
    if (!Number.isFinite(value) || (least !== null && (setting.exclusive ? value <= least : value < least))) {
      say(`${setting.label} must be a number${least === null ? "" : ` ${setting.exclusive ? "above" : "of at least"} ${least}`}.`);
      box.value = String(lab.values[i]);
      return;
    }
    lab.values[i] = value;
    box.value = String(value);
    slider.setAttribute("aria-valuetext", `${value}${unit}`);
    fill();
    restart();
  };
  box.addEventListener("change", () => take(box.value === "" ? NaN : Number(box.value)));
  slider.addEventListener("input", () => take(Number((usual * 5 ** Number(slider.value)).toPrecision(4))));
  return element("div", { className: "setting" }, label, box, ...(usual > 0 ? [slider] : []));
}

function lanePicture(lane) {
  const canvas = element("canvas", { role: "img" });
  LANE_PICTURES.push(canvas);
  canvas.setAttribute("aria-label", `pendulum by ${lane.name}, step ${lane.dt} s`);
  const caption = element("figcaption", {}, lane.name, element("small", { textContent: `step ${lane.dt} s` }));
  let dragged = false, played = false;
  const aim = (event) => {
    const box = canvas.getBoundingClientRect(), { x, y } = geometry(box.width);
    const degrees = Math.atan2(event.clientX - box.left - x, event.clientY - box.top - y) * DEGREES;
    lab.angle = (Math.round(degrees * 10) / 10) / DEGREES;
    lab.velocity = 0;
    fill();
    restart();
  };
  canvas.addEventListener("pointerdown", (event) => {
    const box = canvas.getBoundingClientRect(), { x, y, length } = geometry(box.width), { angle } = lane.machine.last;
    const away = Math.hypot(event.clientX - box.left - x - length * Math.sin(angle), event.clientY - box.top - y - length * Math.cos(angle));
    if (away > REACH) return;
    event.preventDefault();
    canvas.setPointerCapture(event.pointerId);
    [dragged, played] = [true, lab.playing];
    play(false);
    aim(event);
  });
  canvas.addEventListener("pointermove", (event) => { if (dragged) aim(event); });
  const release = () => {
    if (!dragged) return;
    dragged = false;
    play(played);
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  return element("figure", {}, caption, canvas);
}

/** The largest stable step of a method in small swings [s]; null for none. */
function limitOf(lane) {
  const { scale, inertia } = parametersOf(lab.scene, lab.values), { limit } = PAGE.methods[lane.method];
  return limit === null || !(scale > 0) ? null : limit / Math.sqrt(scale / inertia);
}

function laneControl(lane, i) {
  const choose = element("select", { "aria-label": `method of pendulum ${i + 1}` }, ...PAGE.scenes[lab.scene].shown.map(
    (name) => element("option", { value: name, textContent: `${PAGE.methods[name].title} (order ${PAGE.methods[name].order})` })));
  choose.value = lane.method;
  choose.addEventListener("change", () => {
    lane.method = choose.value;
    rebuild();
  });
  const place = (dt) => Math.log(dt / LEAST_STEP) / Math.log(MOST_STEP / LEAST_STEP);
  const slider = element("input", { type: "range", min: "0", max: "1", step: "0.001", value: String(place(lane.dt)),
    "aria-label": `step of pendulum ${i + 1}, slider` });
  const box = element("input", { type: "number", step: "any", inputmode: "decimal", value: String(lane.dt),
    "aria-label": `step of pendulum ${i + 1} in seconds` });
  const take = (dt) => {
    if (!(dt >= SHORTEST && dt <= LONGEST)) {
      say(`A step must be a number of seconds from ${SHORTEST} to ${LONGEST}.`);
      box.value = String(lane.dt);
      return;
    }
    lane.dt = dt;
    box.value = String(dt);
    slider.value = String(place(dt));
    rebuild();
  };
  slider.addEventListener("change", () => take(Number((LEAST_STEP * (MOST_STEP / LEAST_STEP) ** Number(slider.value)).toPrecision(2))));
  box.addEventListener("change", () => take(box.value === "" ? NaN : Number(box.value)));
  const method = PAGE.methods[lane.method], limit = limitOf(lane);
  const mark = element("div", { className: "limit" });
  if (limit > 0 && place(limit) < 1) mark.append(element("i", { style: `left: ${100 * place(limit)}%` }));
  const words = limit === null ? "Stable in small swings at every step."
    : limit === 0 ? "Unstable in small swings at every step." : `Stable in small swings up to a step of ${limit.toPrecision(3)} s (mark).`;
  const remove = element("button", { type: "button", textContent: "Remove", disabled: lab.lanes.length < 2,
    "aria-label": `remove pendulum ${i + 1}` });
  remove.addEventListener("click", () => {
    lab.lanes.splice(i, 1);
    rebuild();
  });
  const made = element("div", { className: "lane" }, choose, element("div", { className: "setting" },
    element("label", { textContent: "step [s]" }), box, slider), mark,
  element("p", { className: "hint", textContent: `${method.summary}. ${words} Source: ${method.source}.` }), remove);
  made.style.borderColor = lane.colour;
  return made;
}

function say(text) {
  byId("message").textContent = text;
}

// --- links, code, files --------------------------------------------------------------------------------------------

/** The whole state as the part of an address behind "#". */
function linkText(timed = true) {
  const place = PAGE.scenes[lab.scene];
  const entries = [["v", PAGE.version], ["scene", lab.scene],
    ["methods", lab.lanes.map((lane) => `${lane.method}:${lane.dt}`).join(",")], ["angle", lab.angle],
    ["velocity", lab.velocity]];
  if (lab.torque) entries.push(["control", lab.torque]);
  if (timed) entries.push(["time", lab.time || 10]);
  place.settings.forEach((setting, i) => {
    if (lab.values[i] !== setting.value) entries.push([setting.name, lab.values[i]]);
  });
  return entries.map(([name, value]) => `${name}=${value}`).join("&");
}

/** Take a link; returns a sentence on what is wrong with it, or "". */
function readLink(text) {
  const pairs = text.split("&").filter(Boolean).map((part) => {
    const at = part.indexOf("=");
    return [part.slice(0, at), part.slice(at + 1)].map(decodeURIComponent);
  });
  const entries = new Map(pairs);
  const number = (name, usual) => {
    if (!entries.has(name)) return usual;
    const value = entries.get(name).trim() === "" ? NaN : Number(entries.get(name));
    if (!Number.isFinite(value)) throw new Error(`${name} must be a finite number, not '${entries.get(name)}'`);
    return value;
  };
  try {
    if (entries.size < pairs.length) throw new Error("it gives an entry twice");
    if (entries.get("v") !== PAGE.version) throw new Error(`it is not of version ${PAGE.version}`);
    const place = PAGE.scenes[entries.get("scene")];
    if (!place) throw new Error(`this page has no scene '${entries.get("scene")}'; it has ${Object.keys(PAGE.scenes).join(", ")}`);
    if (!entries.get("methods")) throw new Error("it names no methods, as methods=rk4:0.01");
    const lanes = entries.get("methods").split(",").map((part) => {
      const at = part.lastIndexOf(":"), name = part.slice(0, at), dt = Number(part.slice(at + 1));
      if (!place.shown.includes(name)) throw new Error(`no method '${name}' for this scene on this page`);
      if (!(dt >= SHORTEST && dt <= LONGEST)) throw new Error(`the step of ${name} must be from ${SHORTEST} to ${LONGEST} s`);
      return new Lane(name, dt);
    });
    if (lanes.length > PAGE.most) throw new Error(`it has more than ${PAGE.most} pendulums`);
    const values = place.settings.map((setting) => {
      const value = number(setting.name, setting.value);
      if (setting.least !== null && (setting.exclusive ? value <= setting.least : value < setting.least)) {
        throw new Error(`${setting.name} must be ${setting.exclusive ? "above" : "at least"} ${setting.least}`);
      }
      return value;
    });
    const known = new Set(["v", "scene", "methods", "angle", "velocity", "time", "control", ...place.settings.map((s) => s.name)]);
    for (const name of entries.keys()) if (!known.has(name)) throw new Error(`the scene has no number '${name}'`);
    const [angle, velocity] = [number("angle", place.run.angle), number("velocity", place.run.velocity)];
    const torque = number("control", 0);
    if (!(Math.abs(torque) <= 1) || (torque && !place.motor)) throw new Error("control must be from -1 to 1, in a scene with a motor");
    Object.assign(lab, { scene: entries.get("scene"), lanes, values, angle, velocity, torque });
    byId("torque").value = String(torque);
    return "";
  } catch (error) {
    return `The link cannot be used: ${error.message}.`;
  }
}

/** The Python code that computes the run of every pendulum. */
function pythonText() {
  const link = linkText();
  const runs = lab.lanes.map((lane, i) => `run${i + 1} = run(read_link(link, ${i + 1}))  # ${lane.method}, step ${lane.dt} s`);
  return ["from pendulum_env.engine.rollout import run", "from pendulum_env.web import read_link", "",
    `link = "${link}"`, ...runs, "print(run1.angle[-1], run1.energy[-1])  # the same bits as here", ""].join("\n");
}

function csvText() {
  const head = "method,time_s,angle_rad,velocity_rad_s,energy_J,energy_residual_J,accurate_angle_rad";
  const rows = lab.lanes.flatMap((lane) => lane.history.rows.map((row) => [lane.method, ...row.slice(0, 6)].join(",")));
  return `# ${PAGE.software}, ${linkText()}\n${[head, ...rows].join("\n")}\n`;
}

function showText(text) {
  const area = byId("text");
  area.hidden = false;
  area.value = text;
  area.select();
  navigator.clipboard?.writeText(text).catch(() => {});
}

/** All pendulums and plots as one picture, with their captions and the link. */
function picture() {
  const dense = Math.min(globalThis.devicePixelRatio || 1, 2), [across, gap, line] = [3, 16 * dense, 22 * dense];
  const parts = [...lab.lanes.map((lane, i) => [LANE_PICTURES[i], `${lane.name}, step ${lane.dt} s`]),
    ...PLOTS.map((name) => byId(`plot-${name}`)).filter((one) => !one.parentElement.hidden).map(
      (one) => [one, one.parentElement.firstChild.textContent])];
  const rows = [parts.slice(0, lab.lanes.length)];
  for (let i = lab.lanes.length; i < parts.length; i += across) rows.push(parts.slice(i, i + across));
  const width = across * 460 * dense;
  const cells = rows.map((row) => {
    const cell = (width - gap * (row.length + 1)) / Math.max(row.length, across);
    return { row, cell, height: Math.max(...row.map(([one]) => (one.height / one.width) * cell)) };
  });
  const whole = element("canvas", { width, height: cells.reduce((sum, { height }) => sum + height + line + gap, 3 * line) });
  const c = whole.getContext("2d"), colour = paint();
  c.fillStyle = colour("paper");
  c.fillRect(0, 0, whole.width, whole.height);
  c.fillStyle = colour("ink");
  c.font = `${14 * dense}px system-ui, sans-serif`;
  c.fillText(`${lab.scene}: ${PAGE.scenes[lab.scene].about}`, gap, line, width - 2 * gap);
  let top = 1.5 * line;
  for (const { row, cell, height } of cells) {
    row.forEach(([one, words], i) => {
      const left = gap + i * (cell + gap);
      c.fillText(words, left, top + 0.7 * line, cell);
      c.drawImage(one, left, top + line, cell, (one.height / one.width) * cell);
    });
    top += height + line + gap;
  }
  c.fillText(`${PAGE.software} · ${linkText()}`, gap, whole.height - 0.5 * line, width - 2 * gap);
  return whole;
}

// --- the check -----------------------------------------------------------------------------------------------------

async function check() {
  const line = byId("check");
  const wrong = [];
  let done = 0;
  const all = Object.entries(PAGE.scenes).flatMap(([scene, place]) => Object.entries(place.programs).map(
    ([method, one]) => ({ scene, method, sum: one.sum })));
  for (const { scene, method, sum } of all) {
    let found = NaN;
    try {
      found = checksumOf(scene, method);
    } catch (error) {
      console.warn(error);
    }
    if (found !== sum) wrong.push(`${scene} with ${method}`);
    done += 1;
    if (done % 4 === 0) {
      line.textContent = `same bits as Python: ${done} of ${all.length} programs checked`;
      await new Promise((resolve) => { setTimeout(resolve, 0); });
    }
  }
  line.classList.toggle("differs", wrong.length > 0);
  line.textContent = wrong.length ? `differs from Python: ${wrong.slice(0, 8).join(", ")}${wrong.length > 8
    ? ` and ${wrong.length - 8} more` : ""}.` : `same bits as Python: checked (${all.length} programs)`;
}

// --- the start -----------------------------------------------------------------------------------------------------

function tab(controls) {
  document.body.classList.toggle("controls", controls);
  byId("tab-plots").setAttribute("aria-pressed", String(!controls));
  byId("tab-controls").setAttribute("aria-pressed", String(controls));
  show();
  byId(controls ? "controls" : "plots").scrollIntoView();
}

async function begin() {
  await unpack();
  globalThis.LabPendulum = { lab, linkText, readLink, rebuild, advance, play, say, show, Machine };
  for (const [name, place] of Object.entries(PAGE.scenes)) {
    byId("scene").append(element("option", { value: name, textContent: `${name.replaceAll("_", " ")}: ${place.about}` }));
  }
  for (const speed of SPEEDS) byId("speed").append(element("option", { value: String(speed), textContent: `${speed}×` }));
  byId("speed").value = "1";
  for (const name of PLOTS) {
    const canvas = element("canvas", { id: `plot-${name}`, role: "img", "aria-label": CAPTIONS[name] });
    byId("plots").append(element("figure", {}, element("figcaption", { textContent: CAPTIONS[name] }), canvas));
  }
  const shown = PAGE.scenes[lab.scene].shown;
  const dt = PAGE.scenes[lab.scene].run.dt;
  lab.lanes = PAGE.first.map((name) => new Lane(shown.includes(name) ? name : shown[0], dt));
  byId("scene").addEventListener("change", () => chooseScene(byId("scene").value));
  byId("speed").addEventListener("change", () => { lab.speed = Number(byId("speed").value); });
  byId("play").addEventListener("click", () => play(!lab.playing));
  byId("step").addEventListener("click", singleStep);
  byId("restart").addEventListener("click", restart);
  byId("torque").addEventListener("input", () => { lab.torque = Number(byId("torque").value); });
  byId("add").addEventListener("click", () => {
    const free = PAGE.scenes[lab.scene].shown.find((name) => !lab.lanes.some((lane) => lane.method === name));
    lab.lanes.push(new Lane(free ?? lab.lanes[0].method, lab.lanes.at(-1).dt));
    rebuild();
  });
  byId("angle").addEventListener("change", () => {
    const degrees = byId("angle").value === "" ? NaN : Number(byId("angle").value);
    if (Math.abs(degrees) <= 360) {
      lab.angle = degrees / DEGREES;
      restart();
    } else say("The start angle must be a number of degrees from -360 to 360.");
    fill();
  });
  byId("velocity").addEventListener("change", () => {
    const value = byId("velocity").value === "" ? NaN : Number(byId("velocity").value);
    if (Math.abs(value) <= 1e4) {
      lab.velocity = value;
      restart();
    } else say("The start velocity must be a number from -10000 to 10000 rad/s.");
    fill();
  });
  byId("tab-plots").addEventListener("click", () => tab(false));
  byId("tab-controls").addEventListener("click", () => tab(true));
  byId("link").addEventListener("click", () => {
    if (location.protocol === "about:") { // a page within a notebook has no address
      showText(`#${linkText()}`);
      return;
    }
    history.replaceState(null, "", `#${linkText()}`);
    showText(location.href);
  });
  byId("python").addEventListener("click", () => showText(pythonText()));
  byId("csv").addEventListener("click", () => download("lab.csv", new Blob([csvText()], { type: "text/csv" })));
  byId("png").addEventListener("click", () => picture().toBlob((blob) => download("lab.png", blob)));
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary") || event.ctrlKey || event.metaKey) return;
    if (event.key === " ") play(!lab.playing);
    else if (event.key === ".") singleStep();
    else if (event.key === "r" || event.key === "R") restart();
    else if (event.key === "ArrowRight" || event.key === "ArrowLeft") {
      if (!PAGE.scenes[lab.scene].motor) return;
      lab.torque = event.key === "ArrowRight" ? 1 : -1;
      byId("torque").value = String(lab.torque);
    } else return;
    event.preventDefault();
  });
  document.addEventListener("keyup", (event) => {
    if ((event.key === "ArrowRight" || event.key === "ArrowLeft") && !event.target.closest("input, select")) {
      lab.torque = 0;
      byId("torque").value = "0";
    }
  });
  const link = () => (location.hash.length > 1 ? readLink(location.hash.slice(1)) : "");
  let wrong = link();
  if (!lab.values.length) {
    const place = PAGE.scenes[lab.scene];
    lab.values = place.settings.map((setting) => setting.value);
    [lab.angle, lab.velocity] = [place.run.angle, place.run.velocity];
  }
  rebuild();
  if (wrong) say(wrong);
  addEventListener("hashchange", () => {
    wrong = link();
    rebuild();
    if (wrong) say(wrong);
  });
  addEventListener("resize", () => show());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => rebuild());
  play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  requestAnimationFrame((now) => {
    last = now;
    frame(now);
  });
  await check();
}

begin().catch((error) => {
  console.error(error);
  say(`This browser cannot run the page: ${error.message}.`);
});
