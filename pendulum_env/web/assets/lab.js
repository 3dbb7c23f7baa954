// The lab: its state, its controls, the clock, the plots, links, and the check of all bits.

const KEEP = 3000; // readings kept of a run; beyond, every other one goes
const BUDGET = 8; // milliseconds of computing in a frame
const SLICE = 256; // steps of the finest pendulum between two looks at the clock
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 50];
const LEAST_STEP = 1e-4, MOST_STEP = 2; // of the sliders [s]
const { shortest: SHORTEST, longest: LONGEST } = PAGE; // steps that can be typed [s]
const SMALL = 20; // largest start angle at which nothing is said of small angles [degrees]

const lab = {
  scene: Object.keys(PAGE.scenes)[0], lanes: [], chosen: -1, playing: true, speed: 1, time: 0, torque: 0, reach: 0.2,
  note: "", shown: { trail: true, velocity: false, acceleration: false, force: false, ruler: false, protractor: false },
  tools: null, watch: null, secret: false, recording: PAGE.recording, checked: null,
  pushed: false, drawn: 0,
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

  /** The smallest and largest value of a column, times a factor, as text. */
  range(column, factor) {
    let low = Infinity, high = -Infinity;
    for (const row of this.rows) [low, high] = [Math.min(low, row[column]), Math.max(high, row[column])];
    return t("from {} to {}", (factor * low).toPrecision(3), (factor * high).toPrecision(3)).replaceAll("-", "−");
  }
}

/** One of the pendulums side by side: its numbers and start, its method and step, its run and the accurate run beside it. */
class Lane {
  constructor(method, dt, values = usualValues(), angle = PAGE.scenes[lab.scene].run.angle,
    velocity = PAGE.scenes[lab.scene].run.velocity) {
    const { radius, reach, suspension, outline } = PAGE.scenes[lab.scene];
    Object.assign(this, { method, dt, values, angle, velocity, radius, reach, suspension, outline });
  }

  start() {
    const place = PAGE.scenes[lab.scene];
    this.machine = new Machine(lab.scene, this.method, this.values, this.dt, this.angle, this.velocity);
    this.parts = Math.max(1, Math.ceil(this.dt / place.run.dt - 1e-9)); // steps of the accurate run in one of this
    this.ghost = new Machine(lab.scene, place.accurate, this.values, this.dt / this.parts, this.angle, this.velocity);
    this.steps = 0;
    this.ended = "";
    this.history = new History();
    this.section = [];
    this.periods = 0; // of the drive, that are over
    const info = this.machine.last, parameters = parametersOf(lab.scene, this.values);
    this.period = place.beat ? (2 * Math.PI) / Math.abs(parameters[place.beat]) : Infinity;
    // what errors of the energy are compared with: the energy at the start or, from rest, m g L
    const first = Math.abs(info.energy);
    this.reference = first > 1e-6 * parameters.scale ? first : parameters.scale || 1;
    this.scale = Math.max(Math.abs(info.energy), 0.002 * parameters.scale) * 1.25; // of the bar of energies; it grows
    this.begun = info.energy;
    this.motion = { fastest: 0, strongest: 0, heaviest: 0, weight: this.number("gravity") ?? 0 };
    const labelled = (label) => this.values[place.settings.findIndex((setting) => setting.label === label)] ?? 0;
    this.drives = Object.fromEntries(["horizontal", "vertical"].map(
      (way) => [way, ["amplitude", "rate", "phase"].map((what) => labelled(`${way} ${what}`))]));
    this.move(info, this.acceleration());
    const numbers = String(this.values);
    if (numbers !== this.swung) [this.swung, this.swings] = [numbers, []]; // periods with these numbers, whatever the start
    this.largest = 0; // angle of the present swing
    this.crossed = NaN; // when the bob last went through the bottom to the right, and the time between the last two
    this.swing = NaN;
    this.read(info, this.ghost.last);
  }

  /** A number of the scene by its name, or undefined where the page has none. */
  number(name) {
    return this.values[PAGE.scenes[lab.scene].settings.findIndex((setting) => setting.name === name)];
  }

  /** The length, or another size of the body that it has in its place [m]. */
  get length() {
    return this.number("body.length") ?? this.reach;
  }

  /** The scale of a picture in which the longest pendulum is drawn with this length [CSS pixels per metre]. */
  perMetre(length) {
    return this.outline.length ? length / extent(this.outline) : (length * this.share) / this.length;
  }

  get name() {
    return t(PAGE.methods[this.method].title);
  }

  /** The displacement of the pivot by a drive, "horizontal" or "vertical", over the length; with `twice` the
   * displacement's second derivative in time. */
  shaken(way, time, twice = false) {
    const [amplitude, rate, phase] = this.drives[way];
    return amplitude && (twice ? -(rate ** 2) : 1) * (amplitude / this.length) * Math.cos(rate * time + phase);
  }

  /** The angular acceleration at the start, from one short step of the accurate run [rad/s²]. */
  acceleration() {
    const probe = new Machine(lab.scene, this.ghost.method, this.values, 1e-6, this.angle, this.velocity);
    probe.take(1, 1, lab.torque);
    const change = (probe.info().velocity - this.velocity) / 1e-6;
    return Number.isFinite(change) ? change : 0;
  }

  /** Keep the motion now: velocity, acceleration, and by Newton's second law what pulls the bob, over its mass and in
   * the directions of the screen: its weight, and all other forces together. */
  move(info, tangential) {
    const { motion } = this, { angle, velocity, time } = info, [sin, cos] = [Math.sin(angle), Math.cos(angle)];
    const central = velocity ** 2, { weight } = motion;
    const pull = [this.length * (tangential * cos - central * sin + this.shaken("horizontal", time, true)),
      -this.length * (tangential * sin + central * cos + this.shaken("vertical", time, true)) - weight];
    Object.assign(motion, { velocity, tangential, central, pull });
    motion.fastest = Math.max(motion.fastest, Math.abs(velocity));
    motion.strongest = Math.max(motion.strongest, Math.hypot(tangential, central));
    motion.heaviest = Math.max(motion.heaviest, weight, Math.hypot(...pull));
  }

  /** Store a reading. */
  read(info, ghost) {
    const energies = { kinetic: info.kinetic_energy, potential: info.potential_energy, heat: info.heat, work: info.work,
      residual: info.energy_residual };
    this.energies = energies;
    this.scale = Math.max(this.scale, 1.02 * (energies.kinetic + Math.max(energies.potential, 0) + energies.heat) || 0);
    lab.reach = Math.min(Math.max(lab.reach, Math.abs(info.angle), Math.abs(ghost.angle) || 0), Math.PI);
    this.history.add([info.time, info.angle, info.velocity, info.energy, info.energy_residual, ghost.angle, ghost.velocity,
      info.kinetic_energy]);
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
        this.time(before, info);
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

  /** Measure the motion between two states: acceleration, and the period from bottom to bottom in one direction. */
  time(before, info) {
    const step = info.time - before.time;
    this.move(info, (info.velocity - before.velocity) / step);
    const [one, other] = [wrapped(before.angle), wrapped(info.angle)];
    const turn = before.velocity / (before.velocity - info.velocity); // of the step, if it turns in it
    const far = turn >= 0 && turn <= 1 ? before.angle + 0.5 * before.velocity * turn * step : info.angle;
    this.largest = Math.max(this.largest, Math.abs(far));
    if (!(one < 0 && other >= 0 && other - one < 1)) return;
    let s = -one / (other - one); // of the step; then by Newton on the cubic through both states
    for (let i = 0; i < 4; i += 1) {
      const r = 1 - s, [old, now] = [before.velocity * step, info.velocity * step];
      const value = one + s * s * (3 - 2 * s) * (other - one) + s * r * (r * old - s * now);
      s -= value / (6 * s * r * (other - one) + r * (1 - 3 * s) * old + s * (3 * s - 2) * now);
    }
    const at = before.time + Math.min(Math.max(s, 0), 1) * step;
    this.swing = at - this.crossed;
    this.crossed = at;
    if (Number.isFinite(this.swing) && this.largest < Math.PI) this.swings.push([this.largest * DEGREES, this.swing]);
    if (this.swings.length > MOST_SWINGS) this.swings.splice(0, MOST_SWINGS / 2);
    this.largest = 0;
  }

  end(code) {
    const info = this.machine.last;
    this.ended = t("at {} s: {}", info.time.toFixed(2), t(PAGE.stops[code] ?? "its numbers are no longer finite"));
    const ends = new Set(lab.lanes.map((lane) => lane.ended).filter(Boolean)); // one sentence for all that end alike
    say([lab.note, ...[...ends].map((how) => t("{} stopped {}.", lab.lanes.filter((lane) => lane.ended === how)
      .map((lane) => lane.name).join(", "), how))].filter(Boolean).join(" "));
  }
}

/** The usual numbers of the present scene. */
function usualValues() {
  return PAGE.scenes[lab.scene].settings.map((setting) => setting.value);
}

/** The pendulums that a change is for: the chosen one, or all. */
function meant() {
  return lab.chosen < 0 ? lab.lanes : [lab.lanes[lab.chosen]];
}

/** The pendulum whose numbers the controls show: the chosen one or, of all, the first. */
function lead() {
  return lab.lanes[Math.max(lab.chosen, 0)];
}

/** The length of the longest pendulum [m]. */
function longestOf() {
  return Math.max(...lab.lanes.map((lane) => (lane.outline.length ? extent(lane.outline) : lane.length)));
}

/** Whether two pendulums have the same numbers and the same start. */
function alike(one, other) {
  return one.angle === other.angle && one.velocity === other.velocity && one.values.every((value, i) => value === other.values[i]);
}

/** An angle within half a turn of the bottom [rad]. */
function wrapped(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

// --- the clock -----------------------------------------------------------------------------------------------------

function restart() {
  lab.time = 0;
  lab.pushed = false; // whether the torque was another one during the run
  const starts = lab.lanes.map((lane) => lane.angle * DEGREES);
  const small = !PAGE.scenes[lab.scene].periodic && starts.some((degrees) => Math.abs(degrees) > SMALL);
  const recorded = lab.recording ? lab.recording[1][0] : NaN; // the first reading; 0 of a sensor that is zeroed at its start
  const apart = recorded !== 0 && starts.some((degrees) => Math.abs(recorded - degrees)
    > 0.1 * Math.max(Math.abs(recorded), Math.abs(degrees)));
  const large = Object.keys(PAGE.scenes).find((name) => PAGE.scenes[name].periodic);
  lab.note = [small ? t("This scene's force grows with the angle itself, which is right for small angles only.") : "",
    small && large ? t("Large ones: choose the scene {}.", large.replaceAll("_", " ")) : "",
    apart ? t("The recording begins at {}°: type it as the start angle to compare.", short6(recorded)) : ""].filter(Boolean).join(" ");
  say(lab.note);
  lab.reach = 0.2; // the largest angle of any pendulum so far, at least so much [rad]; the picture has room for it
  for (const lane of lab.lanes) lane.start();
  const longest = longestOf(); // parts of a rigid body are drawn as they are
  lab.tools ??= { across: 0.6 * longest, down: 0, turned: 90, long: 1.15 * longest,
    hand: Math.round(wrapped(lead().angle) * DEGREES * 10) / 10 };
  fillTools();
  for (const lane of lab.lanes) lane.share = lane.outline.length || !(longest > 0) ? 1 : lane.length / longest;
  if (lab.watch) {
    lab.watch = null;
    byId("watch").textContent = t("Stopwatch");
  }
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
  byId("play").textContent = wanted ? t("Pause") : t("Play");
  if (!wanted) describe();
}

/** Set the share of the motor's torque. */
function push(torque) {
  if (torque === lab.torque) return;
  lab.pushed ||= lab.time > 0;
  lab.torque = torque;
  byId("torque").value = String(torque);
  byId("torque").setAttribute("aria-valuetext", t("{} % of the largest torque", short6(100 * torque)));
}

/** Let go of a key that pushes: also when the key is released in another window, or in a field. */
function letGo() {
  if (!lab.held) return;
  lab.held = false;
  push(0);
}

// --- what is drawn -------------------------------------------------------------------------------------------------

const PLOTS = ["angle", "energy", "error", "phase", "distance", "period", "free", "section"];
const CAPTIONS = {
  angle: "Angle against time; the accurate solution is pale",
  energy: "Energy against time; dashed: kinetic (orange) and potential energy (blue) of one pendulum",
  error: "Error of the energy, as a share of that at the start (of m g L if that is 0); a gain is solid, a loss dashed",
  phase: "Phase portrait: velocity against angle; the accurate orbit is pale",
  distance: "Distance of the angle from the accurate solution",
  period: "Period of each swing against its amplitude; pale: the closed form without losses",
  free: "Any quantity against any other",
  section: "Poincaré section: the state once in each period of the drive",
};
const MOST_SWINGS = 1000; // whose periods are kept
const TURNS = 4; // frames in which every plot is drawn once
const MOST_POINTS = 800; // of a curve against time: more than it has pixels
const REACH = 36; // distance from a bob within which it is grabbed [CSS pixels]
const PLANETS = { Earth: 9.81, Moon: 1.62, Mars: 3.72, Jupiter: 24.8 }; // gravity at the surface [m/s²]
const OFTEN = 20; // frames between two descriptions of what the canvases show
const LANE_PICTURES = [], LEDGERS = [];

function show(now) {
  const colour = paint();
  for (const [i, lane] of lab.lanes.entries()) {
    const drawn = drawApparatus(LANE_PICTURES[i], lane, lab.torque, lab.reach, lab.shown, colour);
    if (lab.shown.ruler) drawRuler(drawn, lab.tools, lane.perMetre(drawn.length), colour);
    if (lab.shown.protractor) drawProtractor(drawn, lab.tools, lane.outline.length ? Math.PI : lab.reach, colour);
    if (now === undefined || i % TURNS === lab.drawn % TURNS) fillLedger(lane, LEDGERS[i]);
  }
  if (lab.watch) byId("watch").textContent = watchText();
  byId("clock").textContent = `${local((Math.floor(100 * lab.time + 1e-6) / 100).toFixed(2))} s${lab.late ? t(", slower than asked") : ""}`;
  PLOTS.forEach((name, i) => {
    if (now === undefined || i % TURNS === lab.drawn % TURNS) PLOTTED[name](colour);
  });
  if (now === undefined || lab.drawn % OFTEN === 0) label();
  lab.drawn += 1;
}

/** A share in percent, with its sign, as text. */
function percent(share) {
  const size = Math.abs(share);
  const text = String(size === 0 || (size >= 1e-3 && size < 1e6) ? Number(size.toPrecision(3)) : size.toExponential(1)).replace("-", "−");
  return local(`${share > 0 ? "+" : share < 0 ? "−" : ""}${text} %`);
}

/** Write the energies of a pendulum, what its method added to them, and its period. */
function fillLedger(lane, places) {
  const { heat, work, residual } = lane.energies, share = (100 * residual) / lane.reference;
  const texts = { kinetic: joules(lane.energies.kinetic), potential: joules(lane.energies.potential), heat: joules(heat), work: joules(work),
    error: `${residual > 0 ? "+" : ""}${joules(residual)}`, share: `(${percent(share)})`,
    period: Number.isFinite(lane.swing) && !lane.ended ? local(`${lane.swing.toPrecision(5)} s`) : "–" };
  for (const name of ["ruler", "protractor"]) {
    places[name].parentElement.hidden = !lab.shown[name];
    if (lab.shown[name]) texts[name] = reading(name, lane);
  }
  for (const [name, place] of Object.entries(places)) if (texts[name] && place.textContent !== texts[name]) place.textContent = texts[name];
}

/** What a person reads of a pendulum now: where along the ruler the bob's centre is, or its angle on the protractor. */
function reading(name, lane) {
  const { angle } = lane.machine.last;
  const text = name === "ruler" ? `${(100 * alongRuler(lab.tools, bobAt(lane))).toFixed(1)} cm` : `${(wrapped(angle) * DEGREES).toFixed(1)}°`;
  return local(text.replace("-", "−"));
}

/** Where a pendulum's bob is, to the right of and below the pivot at rest [m]. */
function bobAt(lane) {
  const { angle, time } = lane.machine.last, far = lane.outline.length ? extent(lane.outline) : lane.length;
  return [far * (Math.sin(angle) + lane.shaken("horizontal", time)), far * (Math.cos(angle) - lane.shaken("vertical", time))];
}

/** The stopwatch: the time since it was started, or at which it was stopped [s of the pendulums]. */
function watchText() {
  const { from, to } = lab.watch;
  return local(`${((to ?? lab.time) - from).toFixed(2)} s`);
}

/** One pendulum now, in words. */
function words(lane) {
  const { angle, velocity, energy_residual: lost } = lane.machine.last;
  const share = (100 * lost) / lane.reference;
  const [degrees, speed] = [angle * DEGREES, velocity].map((value) => value.toPrecision(3).replace("-", "−"));
  const measured = (lab.shown.ruler ? t(", on the ruler {}", reading("ruler", lane)) : "")
    + (lab.shown.protractor ? t(", on the protractor {}", reading("protractor", lane)) : "");
  return t("{}, step {} s: {}°, {} rad/s, energy {}{}", lane.name, lane.dt, degrees, speed,
    Math.abs(share) < 1e-6 ? t("kept") : percent(share), measured + (lane.ended ? t(", stopped") : ""));
}

/** Say what each canvas shows now, for people who do not see it. */
function label() {
  lab.lanes.forEach((lane, i) => LANE_PICTURES[i].setAttribute("aria-label", words(lane)));
  const angles = lab.lanes.map((lane) => `${lane.name} ${lane.history.range(1, DEGREES)}°`).join(", ");
  byId("plot-angle").setAttribute("aria-label", `${t(CAPTIONS.angle)}; ${t("until {} s", lab.time.toFixed(1))}: ${angles}`);
  const swings = lab.lanes.filter((lane) => lane.swings.length).map(
    (lane) => `${lane.name} ${lane.swings.at(-1).map((number, i) => `${short6(Number(number.toPrecision(5)))}${["°", " s"][i]}`).join(", ")}`);
  byId("plot-period").setAttribute("aria-label", [t(CAPTIONS.period), ...swings].join("; "));
  const losses = lab.lanes.map((lane) => `${lane.name} ${short6(Number((lane.energies.residual / lane.reference).toPrecision(2)))}`);
  byId("plot-error").setAttribute("aria-label", `${t(CAPTIONS.error)}; ${t("now")}: ${losses.join(", ")}`);
}

/** Tell a person who listens how the pendulums move: whenever they pause. */
function describe() {
  byId("spoken").textContent = `${t("At {} s", lab.time.toFixed(2))}: ${lab.lanes.map(words).join(". ")}.`;
}

/** The numbers of the pendulums whose accurate solutions are drawn: of those alike the one with the shortest step. */
function finest() {
  const found = [];
  lab.lanes.forEach((lane, i) => {
    const at = found.findIndex((j) => alike(lane, lab.lanes[j]));
    if (at < 0) found.push(i);
    else if (lane.dt < lab.lanes[found[at]].dt) found[at] = i;
  });
  return found;
}

/** The axis of time, and the readings of every pendulum in it; computed once a frame. */
function recent() {
  if (lab.recent?.frame === lab.drawn && lab.recent.at === lab.time) return lab.recent;
  const start = Math.max(0, lab.time - 20);
  const rows = lab.lanes.map((lane) => {
    const { rows: all } = lane.history;
    let first = all.length;
    while (first > 0 && all[first - 1][0] >= start - 0.5) first -= 1;
    const every = Math.ceil((all.length - first) / MOST_POINTS);
    return every < 2 ? all.slice(first) : all.filter((_, i) => i >= first && (i % every === 0 || i === all.length - 1));
  });
  lab.recent = { frame: lab.drawn, at: lab.time, time: [start, Math.max(lab.time, start + 2)], rows };
  return lab.recent;
}

/** Quantities of the free plot: what a reading has of them, and the words beside the axis. */
const QUANTITIES = {
  time: { label: "time [s]", of: (row) => row[0] },
  angle: { label: "angle [°]", of: (row) => row[1] * DEGREES },
  velocity: { label: "velocity [rad/s]", of: (row) => row[2] },
  kinetic: { label: "kinetic energy [J]", of: (row) => row[7] },
  potential: { label: "potential energy [J]", of: (row) => row[3] - row[7] },
  energy: { label: "energy [J]", of: (row) => row[3] },
  error: { label: "error of the energy [J]", of: (row) => row[4] },
  distance: { label: "angle's error [°]", of: (row) => (row[1] - row[5]) * DEGREES },
};

/** Draw a quantity of every pendulum, a function of a reading, against time on a logarithmic axis. */
function drawLogarithm(name, ylabel, quantity, colour) {
  const { time, rows } = recent();
  const curves = lab.lanes.map((lane, i) => ({ colour: lane.colour,
    points: rows[i].map((row) => [row[0], logarithm(quantity(row, lane))]) }));
  drawPlot(byId(`plot-${name}`), { x: time, y: decades(curves), log: true, xlabel: t("time [s]"), ylabel, curves }, colour);
}

const PLOTTED = {
  angle(colour) {
    const { time, rows } = recent();
    const curves = finest().map((i) => ({ colour: colour("faint-ink"), alpha: 0.45, width: 4,
      points: rows[i].map((row) => [row[0], row[5] * DEGREES]) }));
    if (lab.recording) {
      const [times, degrees] = lab.recording;
      curves.push({ colour: colour("ink"), dots: true, points: times.map((at, i) => [at, degrees[i]]).filter(
        ([at]) => at >= time[0] && at <= time[1]) });
    }
    lab.lanes.forEach((lane, i) => curves.push({ colour: lane.colour, points: rows[i].map((row) => [row[0], row[1] * DEGREES]) }));
    drawPlot(byId("plot-angle"), { x: time, y: around(valuesOf(curves), 1), xlabel: t("time [s]"), ylabel: t("angle [°]"), curves },
      colour);
  },
  energy(colour) {
    const { time, rows } = recent(), whose = lead(), at = lab.lanes.indexOf(whose);
    const [unit, factor] = whose.scale >= 1 ? ["J", 1] : whose.scale >= 1e-3 ? ["mJ", 1e3] : ["µJ", 1e6];
    const parts = [["kinetic", (row) => row[7]], ["potential", (row) => row[3] - row[7]]];
    const curves = parts.map(([name, of]) => ({ colour: colour(`energy-${name}`), dash: [5, 3], width: 1, points: rows[at].map((row) => [row[0], factor * of(row)]) }));
    lab.lanes.forEach((lane, i) => curves.push({ colour: lane.colour, width: 2, points: rows[i].map((row) => [row[0], factor * row[3]]) }));
    drawPlot(byId("plot-energy"), { x: time, y: around([0, ...valuesOf(curves)], 1e-12), xlabel: t("time [s]"), ylabel: `${t("energy")} [${unit}]`,
      curves }, colour);
  },
  error(colour) {
    const { time, rows } = recent();
    const curves = lab.lanes.flatMap((lane, i) => [1, -1].map((sign) => ({ colour: lane.colour, dash: sign < 0 ? [4, 3] : [],
      points: rows[i].map((row) => [row[0], sign * row[4] > 0 ? logarithm(row[4] / lane.reference) : NaN]) })));
    drawPlot(byId("plot-error"), { x: time, y: decades(curves), log: true, xlabel: t("time [s]"), ylabel: t("relative error"), curves }, colour);
  },
  free(colour) {
    const [x, y] = ["x", "y"].map((axis) => QUANTITIES[byId(`free-${axis}`).value]);
    const curves = lab.lanes.map((lane) => ({ colour: lane.colour,
      points: lane.history.rows.slice(-1200).map((row) => [x.of(row, lane), y.of(row, lane)]) }));
    drawPlot(byId("plot-free"), { x: around(valuesOf(curves, 0), 1e-9), y: around(valuesOf(curves), 1e-9), xlabel: t(x.label),
      ylabel: t(y.label), curves }, colour);
  },
  phase,
  distance(colour) {
    drawLogarithm("distance", t("distance [°]"), (row) => Math.abs(row[1] - row[5]) * DEGREES, colour);
  },
  period(colour) {
    const driven = Boolean(PAGE.scenes[lab.scene].beat); // then the drive decides
    byId("plot-period").parentElement.hidden = driven;
    if (driven) return;
    const seen = lab.lanes.flatMap((lane) => [Math.abs(lane.angle) * DEGREES, ...lane.swings.map(([angle]) => angle)]);
    const x = [0, around([0, ...seen], 10)[1]];
    const curves = finest().map((i) => ({ colour: colour("faint-ink"), alpha: 0.45, width: 4, points: periods(lab.lanes[i], Math.min(x[1], 175)) }));
    curves.push(...lab.lanes.map((lane) => ({ colour: lane.colour, dots: true, width: 5, points: lane.swings })));
    drawPlot(byId("plot-period"), { x, y: around(valuesOf(curves), 0.02), xlabel: t("amplitude [°]"), ylabel: t("period [s]"), curves }, colour);
  },
  section(colour) {
    const driven = lab.lanes.some((lane) => Number.isFinite(lane.period));
    byId("plot-section").parentElement.hidden = !driven;
    if (!driven) return;
    const all = lab.lanes.flatMap((lane) => lane.section);
    const top = all.filter(([angle]) => Math.abs(angle) > 90).length > 0.5 * all.length; // then about the top
    const curves = lab.lanes.map((lane) => ({ colour: lane.colour, dots: true,
      points: lane.section.map(([angle, v]) => [top && angle < 0 ? angle + 360 : angle, v]) }));
    drawPlot(byId("plot-section"), { x: top ? [0, 360] : [-180, 180], y: around(valuesOf(curves), 0.1), xlabel: t("angle [°]"),
      ylabel: t("velocity [rad/s]"), curves }, colour);
  },
};

/** Periods without losses up to an amplitude [degrees]: 2 pi / omega, over the arithmetic-geometric mean of 1 and
 * cos(amplitude / 2) where the force is that of the sine (Gauss 1799). */
function periods(lane, most) {
  const { scale, inertia } = parametersOf(lab.scene, lane.values), omega = Math.sqrt(scale / inertia), found = [];
  for (let i = 0; omega > 0 && i <= 60; i += 1) {
    let [one, other] = [1, PAGE.scenes[lab.scene].periodic ? Math.cos((i / 120) * (most / DEGREES)) : 1];
    for (let k = 0; k < 6; k += 1) [one, other] = [(one + other) / 2, Math.sqrt(one * other)];
    found.push([(i / 60) * most, (2 * Math.PI) / omega / one]);
  }
  return found;
}

/** Draw the phase portrait, in turns of 360 degrees if a pendulum goes over the top. */
function phase(colour) {
  const rows = lab.lanes.map((lane) => lane.history.rows.slice(-1200));
  const over = rows.some((some) => { // more than a turn; a swing about the top is none
    const [low, high] = ends(some.map((row) => row[1]));
    return high - low > 2.1 * Math.PI;
  });
  const middles = rows.map((some) => { const [low, high] = ends(some.map((row) => row[1])); return 0.5 * (low + high); });
  const first = middles[0] - 2 * Math.PI * Math.floor((middles[0] + 0.5 * Math.PI) / (2 * Math.PI)); // bottom or top
  const turned = middles.map((middle) => 2 * Math.PI * Math.round((middle - first) / (2 * Math.PI)));
  const place = (angle, lane) => (over ? wrapped(angle) : angle - turned[lane]);
  const path = (some, a, v, lane) => {
    const points = [];
    let before = 0;
    for (const row of some) {
      const angle = place(row[a], lane);
      if (over && Math.abs(angle - before) > Math.PI) points.push([NaN, NaN]);
      points.push([angle * DEGREES, row[v]]);
      before = angle;
    }
    return points;
  };
  const curves = lab.lanes.map((lane, i) => ({ colour: lane.colour, points: path(rows[i], 1, 2, i) }));
  const ghosts = finest().map((i) => ({ colour: colour("faint-ink"), alpha: 0.45, width: 4, points: path(rows[i], 5, 6, i) }));
  const x = over ? [-180, 180] : around(valuesOf([...ghosts, ...curves], 0), 2);
  const y = around(valuesOf([...ghosts, ...curves]), 0.02);
  const rates = new Set(lab.lanes.map((lane) => parametersOf(lab.scene, lane.values).gravity_rate));
  const edge = [];
  for (const rate of PAGE.scenes[lab.scene].periodic ? rates : []) {
    for (const side of rate > 0 ? [1, -1] : []) {
      for (let degrees = -540; degrees <= 540; degrees += 3) {
        edge.push([degrees, side * 2 * Math.sqrt(rate) * Math.abs(Math.cos(degrees / DEGREES / 2))]);
      }
      edge.push([NaN, NaN]);
    }
  }
  const caption = `${t(CAPTIONS.phase)}${edge.length ? t(", the separatrix dashed") : ""}`;
  byId("plot-phase").parentElement.firstChild.textContent = caption;
  const dots = lab.lanes.map((lane, i) => ({ colour: lane.colour, dots: true, width: 5, points: [
    [place(lane.machine.last.angle, i) * DEGREES, lane.machine.last.velocity]] }));
  lab.phaseRange = x;
  drawPlot(byId("plot-phase"), { x, y, xlabel: t("angle [°]"), ylabel: t("velocity [rad/s]"), curves: [...ghosts,
    { colour: colour("ink"), dash: [5, 4], width: 1, points: edge }, ...curves, ...dots] }, colour);
}

/** The smallest and the largest finite number; [0, 0] for none. */
function ends(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : [0, 0];
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
  [lab.secret, lab.tools] = [false, null];
  push(0);
  lab.lanes = lab.lanes.map(({ method }) => new Lane(place.shown.includes(method) ? method : place.shown[0], place.run.dt));
  rebuild();
}

/** Make all controls and pictures anew for the present scene and pendulums, and begin the run again. */
function rebuild() {
  keepingFocus(() => {
    LANE_PICTURES.length = LEDGERS.length = 0;
    byId("pendulums").replaceChildren(...lab.lanes.map(lanePicture));
    makeControls();
  });
  restart();
}

/** Make the controls anew, as of another pendulum; the run goes on. */
function rebuildControls() {
  keepingFocus(makeControls);
}

/** Do what makes elements anew; the focus stays where it was, or goes to "Add" if its place is gone. */
function keepingFocus(work) {
  const held = document.activeElement?.id;
  work();
  if (held) (byId(held) ?? byId("add")).focus({ preventScroll: true });
}

function makeControls() {
  const place = PAGE.scenes[lab.scene];
  if (lab.chosen >= lab.lanes.length || lab.lanes.length < 2) lab.chosen = -1;
  byId("scene").value = lab.scene;
  byId("about").textContent = t(place.about);
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
      : [element("p", { className: "hint", textContent: id === "damping-settings" ? t("Nothing: no energy is lost.")
        : place.motor ? "" : t("Nothing.") })]));
  }
  byId("whose").replaceChildren(...(lab.lanes.length < 2 ? [] : ["all", ...lab.lanes.map((_, i) => String(i + 1))]).map(whoseButton));
  const full = lab.lanes.length >= PAGE.most;
  byId("add").disabled = full;
  byId("add").textContent = full ? t("{} pendulums at most", PAGE.most) : t("Add a pendulum");
  recolour();
  byId("lanes").replaceChildren(...lab.lanes.map(laneControl));
  byId("tools").replaceChildren(...Object.keys(TOOLS).map(toolControl));
  if (lab.tools) fillTools();
  fill();
}

/** Where ruler and protractor's hand can be put: words, which of the two it is, the largest number, its unit, and the factor to it. */
const TOOLS = {
  across: { label: "ruler, to the right", of: "ruler", most: () => 150 * longestOf(), unit: " cm", factor: 100 },
  down: { label: "ruler, down", of: "ruler", most: () => 150 * longestOf(), unit: " cm", factor: 100 },
  turned: { label: "ruler, turned", of: "ruler", most: () => 180, unit: "°", factor: 1 },
  hand: { label: "protractor's hand", of: "protractor", most: () => 180, unit: "°", factor: 1 },
};

/** A slider, which arrow keys move, for the place of a tool. */
function toolControl(name) {
  const { label, of, factor } = TOOLS[name];
  const slider = element("input", { type: "range", id: `tool-${name}`, step: name === "turned" ? "1" : "0.1", "aria-label": t(label) });
  slider.addEventListener("input", () => {
    lab.tools[name] = Number(slider.value) / factor;
    fillTools();
    show();
  });
  const words = element("span", { textContent: `${t(label)}: ` });
  return element("label", { hidden: !lab.shown[of] }, words, element("output"), slider);
}

/** Write the places of the tools into their sliders. */
function fillTools() {
  byId("forces").hidden = !lab.shown.force;
  for (const [name, { factor, unit, of, most }] of Object.entries(TOOLS)) {
    const slider = byId(`tool-${name}`), value = factor * lab.tools[name];
    const text = local(`${value.toFixed(name === "turned" ? 0 : 1)}${unit}`.replace("-", "−"));
    [slider.min, slider.max] = [String(-Math.ceil(most())), String(Math.ceil(most()))];
    slider.value = String(value);
    slider.setAttribute("aria-valuetext", text);
    slider.previousSibling.textContent = text;
    slider.parentElement.hidden = !lab.shown[of];
  }
}

/** Give all pendulums the colours of the present theme. */
function recolour() {
  const colour = paint();
  lab.lanes.forEach((lane) => { lane.colour = colour(`hue-${hueOf(lane)}`); });
  document.querySelectorAll(".lane").forEach((one, i) => { one.style.borderColor = lab.lanes[i]?.colour; });
  document.querySelectorAll("#whose button").forEach((one, i) => { one.style.borderBottomColor = lab.lanes[i - 1]?.colour ?? ""; });
}

/** The hue of a pendulum: that of its method in our figures, or the first free one if another pendulum has it. */
function hueOf(lane) {
  const taken = lab.lanes.slice(0, lab.lanes.indexOf(lane)).map((other) => other.hue);
  const own = PAGE.methods[lane.method].hue;
  lane.hue = taken.includes(own) ? [0, 1, 2, 3, 4, 5, 6, 7].find((hue) => !taken.includes(hue)) : own;
  return lane.hue;
}

/** A button that says whose numbers the controls show and change: those of all pendulums, or of one. */
function whoseButton(name, i) {
  const made = element("button", { type: "button", id: `whose-${name}`, textContent: name === "all" ? t("All") : name,
    "aria-pressed": String(lab.chosen === i - 1), "aria-label": name === "all" ? t("numbers of all pendulums") : t("numbers of pendulum {}", name) });
  made.addEventListener("click", () => {
    lab.chosen = i - 1;
    rebuildControls();
  });
  return made;
}

/** Write the present numbers into equation, start and captions. */
function fill() {
  const parameters = parametersOf(lab.scene, lead().values);
  for (const one of byId("equation").querySelectorAll("[data-number]")) {
    one.textContent = lab.secret ? "?" : short6(parameters[one.dataset.number]);
  }
  byId("angle").value = String(Number((lead().angle * DEGREES).toPrecision(7)));
  byId("velocity").value = String(lead().velocity);
  const apart = lab.chosen < 0 && lab.lanes.some((lane) => !alike(lane, lab.lanes[0]));
  byId("whose-hint").textContent = lab.lanes.length < 2 ? "" : apart
    ? t("The pendulums differ; shown are the numbers of pendulum 1, and a change is for all.")
    : lab.chosen < 0 ? t("A change is for all pendulums.") : t("A change is for pendulum {} alone.", lab.chosen + 1);
  lab.lanes.forEach((lane, i) => { LANE_PICTURES[i].parentElement.querySelector("small").textContent = described(lane); });
}

/** Step and, where the pendulums differ, the numbers and the start of one. */
function described(lane) {
  const { settings } = PAGE.scenes[lab.scene], parts = [t("step {} s", lane.dt)];
  settings.forEach((setting, i) => {
    if (lab.lanes.some((other) => other.values[i] !== lane.values[i]) && !(lab.secret && setting.name === "gravity")) {
      parts.push(`${t(setting.label)} ${short6(lane.values[i])}${setting.unit === "1" ? "" : ` ${setting.unit}`}`);
    }
  });
  if (lab.lanes.some((other) => other.angle !== lane.angle)) parts.push(t("from {}°", short6(lane.angle * DEGREES)));
  if (lab.lanes.some((other) => other.velocity !== lane.velocity)) parts.push(t("from {} rad/s", short6(lane.velocity)));
  return parts.join(", ");
}

/** A number with six digits, as Python's format ".6g" writes it. */
function short6(value) {
  return local(String(Number(value.toPrecision(6))).replace("-", "−"));
}

/** A slider between its two ends in words, with marks where it has the values `marks`, and a limit at another. */
function slide(slider, ends, marks, limit = NaN) {
  // where the middle of its thumb is
  const place = (value) => `calc(10px + ${(value - slider.min) / (slider.max - slider.min)} * (100% - 20px))`;
  const inside = [...marks.map((value) => element("i", { style: `left: ${place(value)}` })),
    ...(limit > slider.min && limit < slider.max ? [element("i", { className: "limit", style: `left: ${place(limit)}` })] : [])];
  return element("div", { className: "slide" }, ends[0], element("div", {}, slider, ...inside), ends[1]);
}

function settingControl(setting, i) {
  const id = `setting-${i}`, usual = setting.value;
  const ends = setting.name === "gravity" ? [1, 50] : [usual / 5, 5 * usual]; // from the Moon to Jupiter and beyond
  const [first, last] = ends.map((value) => (usual > 0 ? Math.log(value / usual) / Math.log(5) : 0).toFixed(2));
  const box = element("input", { type: "number", step: "any", inputmode: "decimal", id, value: String(lead().values[i]) });
  const slider = element("input", { type: "range", min: first, max: last, step: "0.01", id: `${id}-slider`,
    "aria-label": t("{}, slider", t(setting.label)), "aria-valuetext": `${lead().values[i]}${setting.unit === "1" ? "" : ` ${setting.unit}`}` });
  slider.value = String(usual > 0 && lead().values[i] > 0 ? Math.log(lead().values[i] / usual) / Math.log(5) : 0);
  const unit = setting.unit === "1" ? "" : ` [${setting.unit}]`;
  const label = element("label", { htmlFor: id, title: t(setting.about) },
    `${setting.effect ? `${t(setting.effect)}: ` : ""}${t(setting.label)}${unit}`);
  const take = (value) => {
    const least = setting.least;
    if (!Number.isFinite(value) || (least !== null && (setting.exclusive ? value <= least : value < least))) {
      say(least === null ? t("{} must be a number.", t(setting.label)) : setting.exclusive ? t("{} must be a number above {}.", t(setting.label), least)
        : t("{} must be a number of at least {}.", t(setting.label), least));
      box.value = String(lead().values[i]);
      return;
    }
    for (const lane of meant()) lane.values[i] = value;
    box.value = String(value);
    slider.setAttribute("aria-valuetext", `${value}${setting.unit === "1" ? "" : ` ${setting.unit}`}`);
    fill();
    restart();
  };
  box.addEventListener("change", () => take(box.value === "" ? NaN : Number(box.value)));
  slider.addEventListener("input", () => take(Number((usual * 5 ** Number(slider.value)).toPrecision(4))));
  const secret = setting.name === "gravity" && lab.secret;
  if (secret) {
    [box.value, box.placeholder, slider.value, slider.disabled] = ["", "?", "0", true];
    slider.setAttribute("aria-valuetext", "?");
  }
  const planets = setting.name !== "gravity" ? [] : [element("div", { className: "row planets", role: "group", "aria-label": t("gravity of") },
    ...Object.entries(PLANETS).map(([name, value]) => {
      const made = element("button", { type: "button", id: `planet-${name}`, textContent: t(name) });
      made.addEventListener("click", () => {
        lab.secret = false;
        take(value);
        rebuildControls();
      });
      return made;
    }), secretButton(take))];
  const said = ends.map((value) => local(String(Number(value.toPrecision(2)))));
  return element("div", { className: "setting" }, label, box, ...(usual > 0 ? [slide(slider, said, [0])] : []), ...planets,
    ...(secret ? [element("p", { className: "hint", textContent: t("Measure the period T of a small swing: g = 4 π² L / T².") })] : []));
}

/** A button that lands on a planet whose gravity is not told until it is asked for. */
function secretButton(take) {
  const made = element("button", { type: "button", id: "planet-x", textContent: lab.secret ? t("Show X") : t("Planet X") });
  made.addEventListener("click", () => {
    lab.secret = !lab.secret;
    if (lab.secret) take(Number((1.5 * 20 ** Math.random()).toPrecision(3)));
    rebuildControls();
  });
  return made;
}

/** Where a pendulum's pivot at rest and its bob are on the screen [CSS pixels]. */
function seen(lane) {
  const box = LANE_PICTURES[lab.lanes.indexOf(lane)].getBoundingClientRect(), { angle } = lane.machine.last;
  const { x, y, length } = geometry(box.width, lane.outline.length ? Math.PI : lab.reach);
  const [u, v, far] = [box.left + x, box.top + y, length * lane.share], scale = lane.perMetre(length);
  return { x: u, y: v, scale, length, bob: { x: u + far * Math.sin(angle), y: v + far * Math.cos(angle) } };
}

/** What of a picture can be grabbed at a place of the screen: how far from it it is, and how the pointer then moves it. */
function grips(lane, event) {
  const { x, y, scale, length, bob } = seen(lane), { tools } = lab, [u, v] = [event.clientX - x, event.clientY - y];
  const found = [{ away: Math.hypot(event.clientX - bob.x, event.clientY - bob.y), bob: true }];
  if (lab.shown.ruler) {
    const [across, down] = [tools.across - u / scale, tools.down - v / scale];
    found.push({ away: awayFromRuler(tools, u / scale, v / scale) * scale, move(now) {
      tools.across = across + (now.clientX - x) / scale;
      tools.down = down + (now.clientY - y) / scale;
    } }, { away: Math.hypot(...endOfRuler(tools).map((end, i) => end * scale - [u, v][i])) - RULER / 2, move(now) {
      const [right, below] = [(now.clientX - x) / scale - tools.across, (now.clientY - y) / scale - tools.down];
      tools.turned = Math.round(Math.atan2(below, right) * DEGREES);
    } });
  }
  if (lab.shown.protractor) {
    const [sin, cos] = [Math.sin(tools.hand / DEGREES), Math.cos(tools.hand / DEGREES)];
    found.push({ away: Math.hypot(HAND * length * sin - u, HAND * length * cos - v), move(now) {
      tools.hand = Math.round(Math.atan2(now.clientX - x, now.clientY - y) * DEGREES * 10) / 10;
    } });
  }
  return found.filter(({ away }) => away < REACH).sort((one, other) => one.away - other.away);
}

function lanePicture(lane) {
  const canvas = element("canvas", { role: "img" });
  LANE_PICTURES.push(canvas);
  const caption = element("figcaption", {}, lane.name, element("small"));
  let dragged = false, played = false, tool = null;
  const aim = (event) => {
    const { x, y } = seen(lane);
    const degrees = Math.atan2(event.clientX - x, event.clientY - y) * DEGREES;
    const angle = (Math.round(degrees * 10) / 10) / DEGREES;
    for (const one of lab.chosen < 0 ? lab.lanes : [lane]) [one.angle, one.velocity] = [angle, 0]; // with the lock open this one alone
    fill();
    restart();
  };
  canvas.addEventListener("pointerdown", (event) => {
    const [nearest] = grips(lane, event);
    if (!nearest) return;
    event.preventDefault();
    canvas.setPointerCapture(event.pointerId);
    if (!nearest.bob) {
      tool = nearest;
      return;
    }
    [dragged, played] = [true, lab.playing];
    play(false);
    aim(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (dragged) aim(event);
    if (tool) {
      tool.move(event);
      fillTools();
      show();
    }
  });
  const release = () => {
    tool = null;
    if (!dragged) return;
    dragged = false;
    play(played);
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  const place = PAGE.scenes[lab.scene], driven = place.motor || place.beat;
  const losing = place.settings.some((setting) => setting.kind === "dissipative" || setting.kind === "medium");
  const names = ["kinetic", "potential", ...(losing ? ["heat"] : []), ...(driven ? ["work"] : []), "error", "period", "ruler", "protractor"];
  const values = names.map(() => element("dd"));
  const places = Object.fromEntries(names.map((name, i) => [name, values[i]])), [error, share] = [element("span"), element("span")];
  places.error.append(error, share);
  LEDGERS.push({ ...places, error, share });
  return element("figure", {}, caption, canvas, element("dl", { className: "ledger" }, ...names.map((name, i) => element("div", {},
    element("dt", { className: name, textContent: t(name) }), values[i]))));
}

/** The largest stable step of a method in small swings [s]; null for none. */
function limitOf(lane) {
  const { scale, inertia } = parametersOf(lab.scene, lane.values), { limit } = PAGE.methods[lane.method];
  return limit === null || !(scale > 0) ? null : limit / Math.sqrt(scale / inertia);
}

function laneControl(lane, i) {
  const choose = element("select", { id: `method-${i}`, "aria-label": t("method of pendulum {}", i + 1) }, ...PAGE.scenes[lab.scene].shown.map(
    (name) => element("option", { value: name, textContent: t("{} (order {})", t(PAGE.methods[name].title), t(PAGE.methods[name].order)) })));
  choose.value = lane.method;
  choose.addEventListener("change", () => {
    lane.method = choose.value;
    rebuild();
  });
  const place = (dt) => Math.log(dt / LEAST_STEP) / Math.log(MOST_STEP / LEAST_STEP);
  const slider = element("input", { type: "range", min: "0", max: "1", step: "0.001", value: String(place(lane.dt)),
    id: `step-${i}-slider`, "aria-label": t("step of pendulum {}, slider", i + 1), "aria-valuetext": `${lane.dt} s` });
  const box = element("input", { type: "number", step: "any", inputmode: "decimal", value: String(lane.dt), id: `step-${i}`,
    "aria-label": t("step of pendulum {} in seconds", i + 1) });
  const take = (dt) => {
    if (!(dt >= SHORTEST && dt <= LONGEST)) {
      say(t("A step must be a number of seconds from {} to {}.", SHORTEST, LONGEST));
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
  const words = limit === null ? t("Stable in small swings at every step.")
    : limit === 0 ? t("Unstable in small swings at every step.")
      : t("Stable in small swings up to a step of {} s (mark).", limit.toPrecision(3));
  const remove = element("button", { type: "button", id: `remove-${i}`, textContent: t("Remove"), disabled: lab.lanes.length < 2,
    "aria-label": t("remove pendulum {}", i + 1) });
  remove.addEventListener("click", () => {
    lab.lanes.splice(i, 1);
    rebuild();
  });
  const made = element("div", { className: "lane" }, choose, element("div", { className: "setting" },
    element("label", { htmlFor: `step-${i}`, textContent: t("step [s]") }), box,
    slide(slider, [local(String(LEAST_STEP)), `${MOST_STEP} s`], [1e-4, 1e-3, 1e-2, 0.1, 1].map(place), limit > 0 ? place(limit) : NaN)),
  element("p", { className: "hint", textContent: t("{}. {} Source: {}.", t(method.summary), words, method.source) }), remove);
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
    ["methods", lab.lanes.map((lane) => `${lane.method}:${lane.dt}`).join(",")], ["angle", lab.lanes[0].angle],
    ["velocity", lab.lanes[0].velocity]];
  if (lab.torque) entries.push(["control", lab.torque]);
  if (timed) entries.push(["time", lab.time || 10]);
  place.settings.forEach((setting, i) => {
    if (lab.lanes[0].values[i] !== setting.value) entries.push([setting.name, lab.lanes[0].values[i]]);
  });
  lab.lanes.forEach((lane, k) => { // what others have of their own, as 2.body.length=0.5
    if (lane.angle !== lab.lanes[0].angle) entries.push([`${k + 1}.angle`, lane.angle]);
    if (lane.velocity !== lab.lanes[0].velocity) entries.push([`${k + 1}.velocity`, lane.velocity]);
    place.settings.forEach((setting, i) => {
      if (lane.values[i] !== lab.lanes[0].values[i]) entries.push([`${k + 1}.${setting.name}`, lane.values[i]]);
    });
  });
  return entries.map(([name, value]) => `${name}=${value}`).join("&");
}

const NUMBER = new RegExp(`^(?:${PAGE.number})$`);

/** The number that a link gives; NaN for any other text. Python reads them by the same grammar (links.py). */
function numberIn(text) {
  return NUMBER.test(text) ? Number(text) : NaN;
}

/** A part of a link, with its percent signs read. */
function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    throw new Error(t("'{}' is no part of an address: a percent sign is written %25", part));
  }
}

/** Take a link; returns a sentence on what is wrong with it, or "". */
function readLink(text) {
  try {
    const pairs = text.split("&").filter(Boolean).map((part) => {
      const at = part.indexOf("=");
      return (at < 0 ? [part, ""] : [part.slice(0, at), part.slice(at + 1)]).map(decoded);
    });
    const entries = new Map(pairs);
    const number = (name, usual) => {
      if (!entries.has(name)) return usual;
      const value = numberIn(entries.get(name));
      if (!Number.isFinite(value)) throw new Error(t("{} must be a finite number, not '{}'", name, entries.get(name)));
      return value;
    };
    if (entries.size < pairs.length) throw new Error(t("it gives an entry twice"));
    if (entries.get("v") !== PAGE.version) throw new Error(t("it is not of version {}", PAGE.version));
    const place = Object.hasOwn(PAGE.scenes, entries.get("scene") ?? "") && PAGE.scenes[entries.get("scene")];
    if (!place) throw new Error(t("this page has no scene '{}'; it has {}", entries.get("scene"), Object.keys(PAGE.scenes).join(", ")));
    if (!entries.get("methods")) throw new Error(t("it names no methods, as methods=rk4:0.01"));
    const lanes = entries.get("methods").split(",").map((part) => {
      const at = part.lastIndexOf(":"), given = part.slice(0, Math.max(at, 0)), dt = numberIn(part.slice(at + 1));
      const name = Object.hasOwn(PAGE.aliases, given) ? PAGE.aliases[given] : given;
      if (!place.shown.includes(name)) throw new Error(t("no method '{}' for this scene on this page", name));
      if (!(dt >= SHORTEST && dt <= LONGEST)) throw new Error(t("the step of {} must be from {} to {} s", name, SHORTEST, LONGEST));
      return { method: name, dt };
    });
    if (lanes.length > PAGE.most) throw new Error(t("it has more than {} pendulums", PAGE.most));
    const own = (setting, k) => { // of pendulum k + 1, or of all
      const value = number(`${k + 1}.${setting.name}`, number(setting.name, setting.value));
      if (setting.least !== null && (setting.exclusive ? value <= setting.least : value < setting.least)) {
        throw new Error(`${setting.name} must be ${setting.exclusive ? "above" : "at least"} ${setting.least}`);
      }
      return value;
    };
    const each = ["angle", "velocity", ...place.settings.map((setting) => setting.name)];
    const known = new Set(["v", "scene", "methods", "time", "control", ...each,
      ...lanes.flatMap((_, k) => each.map((name) => `${k + 1}.${name}`))]);
    for (const name of entries.keys()) if (!known.has(name)) throw new Error(t("the scene has no number '{}'", name));
    for (const setting of place.settings) if (entries.has(setting.name)) own(setting, -1);
    lanes.forEach((lane, k) => {
      lane.values = place.settings.map((setting) => own(setting, k));
      lane.angle = number(`${k + 1}.angle`, number("angle", place.run.angle));
      lane.velocity = number(`${k + 1}.velocity`, number("velocity", place.run.velocity));
    });
    const torque = number("control", 0);
    number("time", 0);
    if (!(Math.abs(torque) <= 1) || (torque && !place.motor)) throw new Error(t("control must be from -1 to 1, in a scene with a motor"));
    [lab.scene, lab.secret, lab.tools] = [entries.get("scene"), false, null];
    lab.lanes = lanes.map(({ method, dt, values, angle, velocity }) => new Lane(method, dt, values, angle, velocity));
    push(torque);
    return "";
  } catch (error) {
    return t("The link cannot be used: {}.", error.message);
  }
}

/** What a link cannot say of this run, as a sentence; "" if it says all. */
function unsaid() {
  return lab.pushed ? t("The motor was pushed during this run, and a link cannot say when: link and program begin again, with the present torque from the start.") : "";
}

/** Take a file that was dropped or chosen as the recording; nothing of it leaves the browser. */
async function takeFile(file) {
  if (!file) return;
  try {
    const { said, readings } = readText(await file.text());
    lab.recording = readings;
    byId("fit").disabled = byId("forget").disabled = false;
    restart();
    byId("fitted").textContent = t("{}: {} readings over {} s. {}", file.name, readings[0].length, readings[0].at(-1).toFixed(1), said);
  } catch (error) {
    byId("fitted").textContent = t("{} cannot be used: {}.", file.name, error.message);
  }
}

/** Fit the present scene to the recording, and give the result to the pendulums. */
function fitHere() {
  try {
    const { values, angle, velocity, zero, scatter, period, found } = fitRecording(lab.recording, PAGE.scenes[lab.scene], lead().values);
    const [times, degrees] = lab.recording;
    lab.recording = [times, degrees.map((value) => value - zero)];
    for (const lane of meant()) Object.assign(lane, { values: [...values], angle, velocity });
    rebuild();
    const numbers = found.map(({ effect, label: name, value, error, unit }) => {
      const digits = Math.max(0, Math.min(9, 1 - Math.floor(Math.log10(error || 1))));
      return `${effect ? `${t(effect)}: ` : ""}${t(name)} ${value.toFixed(digits)} ± ${error.toFixed(digits)}${unit}`;
    });
    const moved = Math.abs(zero) > 0.05 * scatter
      ? t("The zero of the sensor, {}°, is taken away.", zero.toPrecision(2).replace("-", "−")) : "";
    byId("fitted").textContent = [t("Period {} s.", period.toPrecision(5)), `${local(numbers.join("; "))}.`,
      t("Scatter {}°.", scatter.toPrecision(2)), moved,
      t("The errors are those of scatter alone; lab-pendulum fit also looks for faults.")].filter(Boolean).join(" ");
  } catch (error) {
    byId("fitted").textContent = t("The recording cannot be fitted: {}.", error.message);
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
  const head = "pendulum,method,step_s,time_s,angle_rad,velocity_rad_s,energy_J,energy_residual_J,accurate_angle_rad";
  const rows = lab.lanes.flatMap((lane, k) => lane.history.rows.map(
    (row) => [k + 1, lane.method, lane.dt, ...row.slice(0, 6)].join(",")));
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
  const parts = [...lab.lanes.map((lane, i) => [LANE_PICTURES[i], `${lane.name}, ${described(lane)}`]),
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
  let done = 0, begun = performance.now();
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
    if (performance.now() - begun > BUDGET) { // the pendulums swing meanwhile
      line.textContent = t("same bits as Python: {} of {} programs checked", done, all.length);
      await new Promise((resolve) => { setTimeout(resolve, 0); });
      begun = performance.now();
    }
  }
  line.classList.toggle("differs", wrong.length > 0);
  const more = () => (wrong.length > 8 ? t(" and {} more", wrong.length - 8) : "");
  lab.checked = () => (wrong.length ? t("differs from Python: {}{}.", wrong.slice(0, 8).join(", "), more())
    : t("same bits as Python: checked ({} programs)", all.length));
  line.textContent = lab.checked();
}

// --- the start -----------------------------------------------------------------------------------------------------

function tab(controls) {
  document.body.classList.toggle("controls", controls);
  byId("tab-plots").setAttribute("aria-pressed", String(!controls));
  byId("tab-controls").setAttribute("aria-pressed", String(controls));
  show();
  scrollTo(0, document.querySelector("main").offsetTop);
}

/** Say everything that stays on the page in a language; pictures and controls are made anew after it. */
function speak(wanted) {
  translate(wanted);
  byId("language").value = wanted;
  for (const option of byId("scene").options) {
    option.textContent = `${option.value.replaceAll("_", " ")}: ${t(PAGE.scenes[option.value].about)}`;
  }
  for (const axis of ["x", "y"]) {
    byId(`free-${axis}`).setAttribute("aria-label", t("quantity of the {} axis", axis));
    for (const option of byId(`free-${axis}`).options) option.textContent = t(QUANTITIES[option.value].label);
  }
  for (const name of PLOTS) {
    const canvas = byId(`plot-${name}`);
    canvas.parentElement.firstChild.textContent = t(CAPTIONS[name]);
    canvas.setAttribute("aria-label", t(CAPTIONS[name]));
  }
  for (const name of Object.keys(lab.shown)) byId(`show-${name}`).nextSibling.textContent = t(name);
  byId("play").textContent = lab.playing ? t("Pause") : t("Play");
  if (lab.watch) byId("watch").textContent = watchText();
  if (lab.checked) byId("check").textContent = lab.checked();
}

async function begin() {
  await unpack();
  globalThis.LabPendulum = { lab, seen, linkText, readLink, rebuild, advance, periods, play, say, show, Machine };
  remember();
  for (const name of Object.keys(PAGE.scenes)) byId("scene").append(element("option", { value: name }));
  for (const name of ["en", ...Object.keys(PAGE.texts)]) {
    byId("language").append(element("option", { value: name, lang: name, textContent: name === "en" ? "English" : PAGE.texts[name].English }));
  }
  byId("language").addEventListener("change", () => {
    speak(byId("language").value);
    keepingFocus(() => {
      LANE_PICTURES.length = LEDGERS.length = 0;
      byId("pendulums").replaceChildren(...lab.lanes.map(lanePicture));
      makeControls();
    });
    show();
  });
  for (const speed of SPEEDS) byId("speed").append(element("option", { value: String(speed), textContent: `${speed}×` }));
  byId("speed").value = "1";
  const axes = ["x", "y"].map((axis, i) => {
    const select = element("select", { id: `free-${axis}` }, ...Object.keys(QUANTITIES).map((value) => element("option", { value })));
    select.value = ["angle", "energy"][i];
    select.addEventListener("change", () => show());
    return select;
  });
  for (const name of PLOTS) {
    const canvas = element("canvas", { id: `plot-${name}`, role: "img" });
    byId("plots").append(element("figure", {}, element("figcaption"),
      ...(name === "free" ? [element("div", { className: "row" }, axes[1], t(" against "), axes[0])] : []), canvas));
  }
  for (const name of Object.keys(lab.shown)) {
    const box = element("input", { type: "checkbox", id: `show-${name}`, checked: lab.shown[name] });
    box.addEventListener("change", () => {
      lab.shown[name] = box.checked;
      fillTools();
      show();
    });
    byId("shown").append(element("label", { className: "check" }, box, element("span")));
  }
  byId("watch").addEventListener("click", () => { // starts, stops, goes back
    lab.watch = lab.watch === null ? { from: lab.time } : lab.watch.to === undefined ? { ...lab.watch, to: lab.time } : null;
    byId("watch").textContent = lab.watch ? watchText() : t("Stopwatch");
  });
  const shown = PAGE.scenes[lab.scene].shown;
  const dt = PAGE.scenes[lab.scene].run.dt;
  lab.lanes = PAGE.first.map((name) => new Lane(shown.includes(name) ? name : shown[0], dt));
  byId("scene").addEventListener("change", () => chooseScene(byId("scene").value));
  byId("speed").addEventListener("change", () => { lab.speed = Number(byId("speed").value); });
  byId("play").addEventListener("click", () => play(!lab.playing));
  byId("step").addEventListener("click", singleStep);
  byId("restart").addEventListener("click", restart);
  byId("torque").addEventListener("input", () => push(Number(byId("torque").value)));
  byId("add").addEventListener("click", () => {
    const free = PAGE.scenes[lab.scene].shown.find((name) => !lab.lanes.some((lane) => lane.method === name));
    const { dt, values, angle, velocity } = lab.lanes.at(-1);
    lab.lanes.push(new Lane(free ?? lab.lanes[0].method, dt, [...values], angle, velocity));
    rebuild();
  });
  byId("angle").addEventListener("change", () => {
    const degrees = byId("angle").value === "" ? NaN : Number(byId("angle").value);
    if (Math.abs(degrees) <= 360) {
      for (const lane of meant()) lane.angle = degrees / DEGREES;
      restart();
    } else say(t("The start angle must be a number of degrees from -360 to 360."));
    fill();
  });
  byId("velocity").addEventListener("change", () => {
    const value = byId("velocity").value === "" ? NaN : Number(byId("velocity").value);
    if (Math.abs(value) <= 1e4) {
      for (const lane of meant()) lane.velocity = value;
      restart();
    } else say(t("The start velocity must be a number from -10000 to 10000 rad/s."));
    fill();
  });
  byId("tab-plots").addEventListener("click", () => tab(false));
  byId("tab-controls").addEventListener("click", () => tab(true));
  byId("link").addEventListener("click", () => {
    say(unsaid());
    if (location.protocol === "about:") { // a page within a notebook has no address
      showText(`#${linkText()}`);
      return;
    }
    history.replaceState(null, "", `#${linkText()}`);
    // of a file on a disk the name alone: its folders are nobody else's, and may tell who somebody is
    showText(location.protocol === "file:" ? `${location.pathname.split("/").at(-1)}${location.hash}` : location.href);
  });
  byId("python").addEventListener("click", () => {
    say(unsaid());
    showText(pythonText());
  });
  byId("csv").addEventListener("click", () => download("lab.csv", new Blob([csvText()], { type: "text/csv" })));
  byId("png").addEventListener("click", () => picture().toBlob((blob) => download("lab.png", blob)));
  byId("file").addEventListener("change", () => takeFile(byId("file").files[0]));
  byId("fit").addEventListener("click", fitHere);
  byId("forget").addEventListener("click", () => {
    lab.recording = null;
    byId("fit").disabled = byId("forget").disabled = true;
    byId("fitted").textContent = byId("file").value = "";
    restart();
  });
  byId("fit").disabled = byId("forget").disabled = !lab.recording;
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    takeFile(event.dataTransfer.files[0]);
  });
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary") || event.ctrlKey || event.metaKey) return;
    if (event.key === " ") play(!lab.playing);
    else if (event.key === ".") singleStep();
    else if (event.key === "r" || event.key === "R") restart();
    else if (event.key === "ArrowRight" || event.key === "ArrowLeft") {
      if (!PAGE.scenes[lab.scene].motor) return;
      lab.held = true;
      push(event.key === "ArrowRight" ? 1 : -1);
    } else return;
    event.preventDefault();
  });
  document.addEventListener("keyup", (event) => {
    if (event.key === "ArrowRight" || event.key === "ArrowLeft") letGo();
  });
  addEventListener("blur", letGo);
  document.addEventListener("visibilitychange", letGo);
  document.addEventListener("focusin", letGo);
  speak(Object.keys(PAGE.texts).find((name) => navigator.language.startsWith(name)) ?? "en");
  const link = () => (location.hash.length > 1 ? readLink(location.hash.slice(1)) : "");
  let wrong = link();
  rebuild();
  if (wrong) say(wrong);
  addEventListener("hashchange", () => {
    wrong = link();
    rebuild();
    if (wrong) say(wrong);
  });
  addEventListener("resize", () => show());
  const repaint = () => {
    recolour();
    show();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  for (const [moment, paper] of [["beforeprint", true], ["afterprint", false]]) {
    addEventListener(moment, () => { // paper is white, whatever the screen is
      document.documentElement.classList.toggle("paper", paper);
      repaint();
    });
  }
  play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  requestAnimationFrame((now) => {
    last = now;
    frame(now);
  });
  setTimeout(check, 200); // first they swing
}

begin().catch((error) => {
  console.error(error);
  say(t("This browser cannot run the page: {}.", error.message));
});
