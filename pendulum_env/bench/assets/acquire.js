// The page of acquire: events from the server, the plots, the cursors, the tools, and orders to the server.

const DATA = JSON.parse(byId("data").textContent);
const GROWS = 5, LAST = 30; // seconds that the plot shows at least, and of a long run while it is recorded
const MARKED = 250; // milliseconds between two searches for crossings and turning points while samples come
const NARROWEST = 0.02; // seconds that the plot shows when zoomed in
const REACH = 40; // distance from a bob within which it is grabbed [CSS pixels]
const LATEST = 600; // draws whose times are kept for a measurement of the latency
const TURNS = 3; // frames of a run in which the second plot is drawn once
const NOTHING = { t: [], y: [], v: [] };

const desk = {
  state: null, run: 0, now: NaN, trace: new Trace(), curves: { fit: NOTHING, beside: NOTHING }, window: null, moved: true,
  cursors: [NaN, NaN], snap: "crossing", marks: { crossings: [], turnings: [] }, markedAt: 0, marked: -1, rows: [], lift: null,
  drawn: [], frames: 0,
};

// --- the server ----------------------------------------------------------------------------------------------------

const ENDED = "The program behind this page has ended. What was recorded is in its file.";
const HEARD = {
  samples(event) {
    desk.now = event.now;
    desk.turned = event.angle;
    if (event.run === desk.run && event.t.length) desk.trace.add(event.t, event.y);
  },
  past(event) {
    desk.run = event.run;
    desk.now = event.now ?? NaN;
    desk.trace = new Trace();
    desk.trace.add(event.t, event.y);
    desk.curves = { fit: NOTHING, beside: NOTHING };
    desk.window = null;
    desk.cursors = [NaN, NaN];
    desk.marked = -1;
    mark(true);
  },
  curve(event) {
    desk.curves[event.name] = event;
    if (event.body) desk.body = event.body;
    if (desk.state) fill();
  },
  state(event) {
    const before = desk.state;
    desk.state = event;
    if (before && before.problem !== event.problem) say(event.problem);
    else if (!before && event.problem) say(event.problem);
    if (before?.recording && !event.recording) desk.window = null;
    fill();
  },
};

function connection(text, live) {
  byId("connection").textContent = text;
  byId("connection").classList.toggle("live", live);
}

// --- units and text ------------------------------------------------------------------------------------------------

/** The factor from the server's unit to the shown one, and the shown unit. */
function unit() {
  if (!desk.state) return [1, ""];
  if (desk.state.quantity !== "angle") return [1, ` ${desk.state.unit}`];
  return byId("unit").value === "rad" ? [1 / DEGREES, " rad"] : [1, "°"];
}

function reading(value, more = 0) {
  const [factor, sign] = unit();
  if (!Number.isFinite(value)) return "–";
  const text = (value * factor).toFixed((sign === " rad" ? 4 : 2) + more);
  return `${minus(Number(text) === 0 ? text.replace("-", "") : text)}${sign}`;
}

function seconds(value, digits = 3) {
  return Number.isFinite(value) ? `${minus(value.toFixed(digits))} s` : "–";
}

/** Write the state of the server into the page. */
function fill() {
  const { state } = desk, angle = state.quantity === "angle";
  put("source", `${state.source}: ${state.about}`);
  const rate = state.rate === null ? "" : `, ${Number(state.rate.toPrecision(3))} readings per second`;
  connection(state.live ? `connected${rate}` : "not connected", state.live);
  document.body.classList.toggle("recording", state.recording);
  byId("start").disabled = state.recording;
  put("start", state.run ? "Start again" : "Start");
  byId("stop").disabled = !state.recording;
  const lost = state.lost ? `, ${state.lost} lost` : "";
  put("counted", state.run ? `${state.samples} samples${lost} in ${state.file}` : "");
  byId("sign").setAttribute("aria-pressed", String(state.sign < 0));
  byId("sign").disabled = state.recording;
  byId("unit-label").hidden = !angle;
  byId("counts-label").hidden = !state.counted;
  if (document.activeElement !== byId("counts")) byId("counts").value = String(state.counts ?? "");
  byId("hand").hidden = byId("hand-key").hidden = !state.hand;
  byId("pendulums").classList.toggle("hand", state.hand);
  byId("apparatus").hidden = state.quantity === "force";
  put("now-name", angle ? "the sensor's angle now" : `${state.title} now`);
  put("caption", `${angle ? "Angle" : state.title} against time`);
  put("cursor-unit", angle ? "angle" : "reading");
  const notes = byId("notes"), told = state.notes.join("\n");
  if (notes.dataset.told !== told) {
    notes.dataset.told = told;
    notes.replaceChildren(...state.notes.map((note) => element("li", { textContent: note })));
  }
  for (const id of ["fit", "report"]) byId(id).disabled = !state.run || state.work !== null;
  byId("save").disabled = !state.run;
  put("working", state.work ? `The ${state.work.what} is being computed: ${Math.round(100 * state.work.done)} %, ${state.work.text}` : "");
  const words = state.fit ? [...state.fit.words, ...state.fit.warnings] : [];
  if (byId("fitted").dataset.told !== words.join("\n")) {
    byId("fitted").dataset.told = words.join("\n");
    byId("fitted").replaceChildren(...words.map((word) => element("p", { textContent: word })));
  }
  const link = byId("report-link");
  link.hidden = !state.report;
  if (state.report) link.href = state.report.link;
  byId("file").hidden = !state.run;
  byId("file").href = "file";
  if (document.activeElement !== byId("name") && !byId("name").dataset.own) byId("name").value = state.save_as;
  byId("beside").setAttribute("aria-pressed", String(state.beside.shown));
  put("beside", state.beside.shown ? "Leave it out" : "Draw it");
  const { beside } = desk.curves;
  put("beside-said", state.beside.twin ? "The twin: the scene under the same actions as the bench, from the same start." : !state.beside.shown ? "It starts from the swing's own release." : state.beside.problem || (beside.t.length
    ? `Released at ${seconds(beside.release)} from ${reading(beside.start)}, steps of ${beside.dt} s.` : state.run ? "It begins after the first half swing." : "It begins with the run."));
}

// --- what is drawn -------------------------------------------------------------------------------------------------

/** The times that the plot shows [s]: as they were chosen, or those of the run. */
function shownTimes() {
  if (desk.window) return desk.window;
  const { end } = desk.trace;
  if (desk.state?.recording) return [Math.max(0, end - LAST), Math.max(end, GROWS)];
  return [0, Math.max(end, 1)];
}

/** The readings in the plot as points [time, value], at most a lowest and a highest for each pixel. */
function visible(from, to, pixels, value) {
  const { trace } = desk, low = Math.max(0, trace.after(from) - 1), high = Math.min(trace.count, trace.after(to) + 1);
  const points = [];
  if (high - low <= 3 * pixels) {
    for (let i = low; i < high; i += 1) points.push([trace.t[i], value(i)]);
    return points;
  }
  const step = (high - low) / pixels;
  for (let p = 0; p < pixels; p += 1) {
    const first = Math.floor(low + p * step), end = Math.floor(low + (p + 1) * step);
    let least = first, most = first;
    for (let i = first; i < end; i += 1) {
      if (trace.y[i] < trace.y[least]) least = i;
      if (trace.y[i] > trace.y[most]) most = i;
    }
    for (const i of least < most ? [least, most] : [most, least]) points.push([trace.t[i], value(i)]);
  }
  return points;
}

/** The points of a curve from the server in the plot, up to the present. */
function along(curve, from, to, pixels, factor) {
  const until = Math.min(to, desk.trace.end), points = [];
  if (!curve.t.length) return points;
  for (let p = 0; p <= pixels; p += 1) {
    const time = from + ((until - from) * p) / pixels;
    points.push([time, factor * valueOf(curve, time)]);
  }
  return points;
}

function tones(colour) {
  return { recorded: colour("ink"), simulated: colour("simulated"), fitted: colour("fitted") };
}

function drawAngle(colour) {
  const canvas = byId("plot-angle"), pixels = Math.max(100, canvas.clientWidth - 80), [from, to] = shownTimes();
  const [factor, sign] = unit(), { trace } = desk, tone = tones(colour);
  const points = visible(from, to, pixels, (i) => factor * trace.y[i]);
  const curves = [
    { colour: tone.simulated, width: 5, alpha: 0.55, points: along(desk.curves.beside, from, to, pixels, factor) },
    { colour: tone.recorded, width: 1.5, points },
    { colour: tone.fitted, width: 2, dash: [7, 5], points: along(desk.curves.fit, from, to, pixels, factor) },
  ];
  if (points.length < pixels / 6) curves.push({ colour: tone.recorded, dots: true, points });
  const name = desk.state?.quantity === "angle" ? "angle" : desk.state?.title ?? "";
  const lines = [], rings = [];
  desk.cursors.forEach((time, k) => {
    if (!Number.isFinite(time)) return;
    const shade = colour(k ? "second" : "first");
    lines.push({ x: time, colour: shade });
    rings.push({ x: time, y: factor * cursorValue(time), colour: shade });
  });
  desk.frame = drawPlot(canvas, { x: [from, to], y: around(points.map((point) => point[1]), factor), ratio: plotRatio(canvas, 0.5),
    xlabel: "time [s]", ylabel: `${name} [${sign.trim()}]`, curves, lines, rings }, colour);
  desk.cursors.forEach((time, k) => {
    const handle = byId(`handle-${k + 1}`), inside = time >= from && time <= to;
    handle.hidden = !inside;
    if (inside) handle.style.left = `${desk.frame.x + ((time - from) / (to - from)) * desk.frame.w}px`;
  });
}

/** The height of a plot over its width: not so high that two of them leave the screen. */
function plotRatio(canvas, most) {
  return Math.min(most, Math.max(220, 0.36 * innerHeight) / Math.max(canvas.clientWidth, 40));
}

const SECOND = {
  velocity(colour, factor, sign) {
    const [from, to] = shownTimes(), canvas = byId("plot-second"), pixels = Math.max(100, canvas.clientWidth - 80);
    const points = visible(from, to, pixels, (i) => factor * desk.trace.slope(i));
    return { x: [from, to], y: around(points.map((point) => point[1]), factor), xlabel: "time [s]",
      ylabel: `${desk.state?.quantity === "angle" ? "velocity" : "rate"} [${sign.trim()}/s]`, curves: [{ colour: colour("ink"), points }] };
  },
  phase(colour, factor, sign) {
    const [from, to] = shownTimes(), points = [];
    const low = desk.trace.after(from), high = desk.trace.after(to), step = Math.max(1, Math.ceil((high - low) / 3000));
    for (let i = low; i < high; i += step) points.push([factor * desk.trace.y[i], factor * desk.trace.slope(i)]);
    return { x: around(points.map((point) => point[0]), factor), y: around(points.map((point) => point[1]), factor),
      xlabel: `angle [${sign.trim()}]`, ylabel: `velocity [${sign.trim()}/s]`, curves: [{ colour: colour("ink"), points }] };
  },
  residual(colour, factor, sign) {
    const [from, to] = shownTimes(), canvas = byId("plot-second"), pixels = Math.max(100, canvas.clientWidth - 80);
    const tone = tones(colour);
    const low = desk.trace.after(from), high = desk.trace.after(to), step = Math.max(1, Math.ceil((high - low) / (2 * pixels)));
    const curves = ["beside", "fit"].filter((name) => desk.curves[name].t.length).map((name) => {
      const points = [];
      for (let i = low; i < high; i += step) points.push([desk.trace.t[i], factor * (desk.trace.y[i] - valueOf(desk.curves[name], desk.trace.t[i]))]);
      return { colour: name === "fit" ? tone.fitted : tone.simulated, dots: true, points };
    });
    const values = curves.flatMap((curve) => curve.points.map((point) => point[1])).filter(Number.isFinite);
    return { x: [from, to], y: around(values, 0.2 * factor), xlabel: "time [s]",
      ylabel: `residual [${sign.trim()}]`, curves, empty: curves.length ? "" : "Draw a simulation or a fit: this is the recording minus it." };
  },
};

function drawSecond(colour) {
  const canvas = byId("plot-second"), plot = SECOND[byId("second").value](colour, ...unit());
  const frame = drawPlot(canvas, { ...plot, ratio: plotRatio(canvas, 0.4) }, colour);
  if (!plot.empty) return;
  const c = canvas.getContext("2d");
  c.fillStyle = colour("faint-ink");
  c.font = "13px system-ui, sans-serif";
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.fillText(plot.empty, frame.x + 0.5 * frame.w, frame.y + 0.5 * frame.h, frame.w - 10);
}

function drawPendulum(colour) {
  if (byId("apparatus").hidden) return;
  const body = desk.body ?? DATA.body, now = desk.turned ?? desk.now, angle = Number.isFinite(now) ? now : 0;
  const beside = desk.state?.recording && desk.turned === undefined ? valueOf(desk.curves.beside, desk.trace.end) : NaN;
  const lane = { ...body, machine: { last: { time: 0, angle: angle / DEGREES } }, colour: colour("bob"), share: 1, shaken: () => 0,
    ghost: Number.isFinite(beside) ? { last: { angle: beside / DEGREES } } : null };
  drawApparatus(byId("apparatus"), lane, 0, Math.PI, {}, colour);
}

function legend() {
  const parts = [["recorded", "recorded"]];
  if (desk.curves.beside.t.length) parts.push(["simulated", "simulated"]);
  if (desk.curves.fit.t.length) parts.push(["fitted", "fitted"]);
  const place = byId("legend");
  if (place.children.length !== parts.length || place.lastChild?.className !== parts.at(-1)[0]) {
    place.replaceChildren(...parts.map(([kind, text]) => element("span", { className: kind, textContent: text })));
  }
}

/** Draw all that moves. */
function show() {
  desk.frames += 1;
  const colour = paint();
  mark(false);
  drawPendulum(colour);
  put("now", reading(desk.now));
  put("integrated", desk.turned === undefined ? "" : `${minus(desk.turned.toFixed(1))}° since zero, integrated`);
  put("clock", seconds(desk.trace.end, 2));
  drawAngle(colour);
  if (!desk.state?.recording || desk.frames % TURNS === 0) drawSecond(colour);
  legend();
}

/** One frame; nothing is drawn unless something changed. */
function frame() {
  requestAnimationFrame(frame);
  if (!desk.moved || document.hidden) return;
  desk.moved = false;
  show();
  const newest = desk.trace.count ? desk.trace.y[desk.trace.count - 1] : NaN, channel = new MessageChannel();
  channel.port1.onmessage = () => { // after this frame was painted
    desk.drawn.push([newest, performance.timeOrigin + performance.now()]);
    if (desk.drawn.length > LATEST) desk.drawn.shift();
    channel.port1.close();
  };
  channel.port2.postMessage(0);
}

// --- crossings, turning points and what follows from them --------------------------------------------------------

/** Search for crossings and turning points; while samples come, not in every frame. */
function mark(surely) {
  const { trace } = desk, now = performance.now();
  if (!surely && (trace.seen === desk.marked || (desk.state?.recording && now - desk.markedAt < MARKED))) return;
  desk.markedAt = now;
  desk.marked = trace.seen;
  desk.marks = trace.count > 3 ? marksOf(trace) : { crossings: [], turnings: [] };
  if (desk.state && desk.cursors.some(Number.isNaN) && trace.count > 3) placeCursors();
  measure();
}

/** What the tools say of the run so far. */
function measure() {
  const { crossings, turnings } = desk.marks;
  const n = Math.max(1, Math.round(Number(byId("oscillations").value)) || 1);
  const start = Math.min(...desk.cursors.filter(Number.isFinite), Infinity);
  desk.period = periodOver(crossings, n, desk.aimed ? start : 0);
  const whole = Math.floor((crossings.length - 1) / 2);
  put("period", desk.period ? `T = ${seconds(desk.period.value, 4)}, the mean of ${n} from ${seconds(desk.period.from)}`
    : `${Math.max(0, whole)} whole oscillation${whole === 1 ? "" : "s"} so far.`);
  byId("read-period").disabled = !desk.period;
  const wanted = Math.max(3, Math.round(Number(byId("amplitudes").value)) || 3);
  desk.amplitudes = spreadOut(amplitudesOf(turnings), wanted);
  const enough = desk.amplitudes.length >= 3;
  desk.decay = enough ? decayOf(desk.amplitudes) : null;
  put("gamma", enough ? `γ = ${withError(desk.decay.gamma, desk.decay.error, "1/s")} of θ ∝ exp(−γt/2), from ${desk.amplitudes.length} amplitudes`
    : "Needs three amplitudes.");
  byId("read-amplitudes").disabled = !enough;
  drawDecay();
  cursorText();
}

function drawDecay() {
  const colour = paint(), [factor, sign] = unit();
  const points = (desk.amplitudes ?? []).map((one) => [one.t, Math.log(one.size * factor)]);
  const fitted = desk.decay ? [0, desk.trace.end].map((time) => [time, desk.decay.at(time) + Math.log(factor)]) : [];
  drawPlot(byId("plot-decay"), { x: [0, Math.max(1, desk.trace.end)], y: around([...points, ...fitted].map((point) => point[1]), 0.05),
    xlabel: "time [s]", ylabel: `ln(A/${sign.trim()})`, ratio: 0.5, curves: [{ colour: colour("fitted"), points: fitted }],
    rings: points.map(([x, y]) => ({ x, y, colour: colour("ink") })) }, colour);
}

// --- cursors -------------------------------------------------------------------------------------------------------

/** The times to which cursors snap now. */
function snaps() {
  return desk.snap === "crossing" ? desk.marks.crossings : desk.marks.turnings;
}

/** The place nearest to a time to which a cursor snaps. */
function snapped(time) {
  const { trace } = desk;
  if (!trace.count) return NaN;
  const places = snaps();
  if (desk.snap === "sample" || !places.length) return trace.t[trace.near(time)];
  return places.reduce((best, one) => (Math.abs(one.t - time) < Math.abs(best.t - time) ? one : best)).t;
}

/** The next place to which a cursor snaps, `steps` away. */
function stepped(time, steps) {
  const { trace } = desk, places = snaps();
  if (desk.snap === "sample" || !places.length) {
    return trace.t[Math.min(Math.max(trace.near(time) + steps, 0), trace.count - 1)];
  }
  const later = places.findIndex((one) => one.t > time + 1e-9), first = later < 0 ? places.length : later;
  const on = first > 0 && Math.abs(places[first - 1].t - time) < 1e-9;
  const at = steps > 0 ? first + steps - 1 : first - (on ? 1 : 0) + steps;
  return places[Math.min(Math.max(at, 0), places.length - 1)].t;
}

function cursorValue(time) {
  const marked = snaps().find((one) => Math.abs(one.t - time) < 1e-9);
  return desk.snap !== "sample" && marked ? marked.y : desk.trace.at(time);
}

function placeCursors() {
  const { crossings } = desk.marks;
  if (desk.snap === "crossing" && crossings.length < 3) return;
  const [from, to] = desk.snap === "crossing" ? [crossings[0].t, crossings[2].t] : shownTimes().map((t, i, [a, b]) => a + (0.2 + 0.6 * i) * (b - a));
  desk.cursors = [snapped(from), snapped(to)];
}

function moveCursor(k, time) {
  if (!Number.isFinite(time)) return;
  desk.cursors[k] = time;
  desk.aimed = true;
  desk.moved = true;
  measure();
}

function cursorText() {
  const [one, two] = desk.cursors, [y1, y2] = desk.cursors.map((time) => (Number.isFinite(time) ? cursorValue(time) : NaN));
  put("t1", seconds(one));
  put("t2", seconds(two));
  put("y1", reading(y1));
  put("y2", reading(y2));
  put("dt", seconds(two - one));
  put("dy", reading(y2 - y1));
  const both = Number.isFinite(one) && Number.isFinite(two);
  const halves = both && desk.snap !== "sample" ? snaps().filter((place) => place.t > Math.min(one, two) + 1e-9 && place.t <= Math.max(one, two) + 1e-9).length : 0;
  desk.between = halves && halves % 2 === 0 ? halves / 2 : 0;
  const apart = Math.abs(two - one);
  put("between", desk.between ? `${desk.between} oscillation${desk.between > 1 ? "s" : ""} of ${seconds(apart / desk.between, 4)}`
    : halves ? `${halves} half oscillation${halves > 1 ? "s" : ""} of ${seconds(apart / halves, 4)}`
      : both && apart > 0 ? `1/Δt = ${(1 / apart).toPrecision(4)} Hz` : "Drag the handles 1 and 2 of the plot, or move them with the arrow keys.");
  byId("read-cursors").disabled = !both;
  for (const k of [0, 1]) {
    const handle = byId(`handle-${k + 1}`), time = desk.cursors[k];
    if (!Number.isFinite(time)) continue;
    handle.setAttribute("aria-valuemax", desk.trace.end.toFixed(3));
    handle.setAttribute("aria-valuenow", time.toFixed(4));
    handle.setAttribute("aria-valuetext", `${seconds(time)}, ${reading([y1, y2][k])}`);
  }
}

function timeAt(event) {
  const box = byId("plot-angle").getBoundingClientRect(), [from, to] = shownTimes();
  return from + ((event.clientX - box.left - desk.frame.x) / desk.frame.w) * (to - from);
}

function cursorHandles() {
  for (const k of [0, 1]) {
    const handle = byId(`handle-${k + 1}`);
    let held = false;
    handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      event.stopPropagation();
      handle.focus();
      handle.setPointerCapture(event.pointerId);
      held = true;
    });
    handle.addEventListener("pointermove", (event) => {
      if (!held) return;
      event.stopPropagation();
      moveCursor(k, snapped(timeAt(event)));
    });
    for (const kind of ["pointerup", "pointercancel"]) handle.addEventListener(kind, () => { held = false; });
    handle.addEventListener("keydown", (event) => {
      const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10, Home: -1e9, End: 1e9 }[event.key];
      if (steps === undefined || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      event.stopPropagation();
      moveCursor(k, stepped(desk.cursors[k], steps));
      reveal(desk.cursors[k]);
    });
  }
}

/** Move the plot's window, if it was chosen, so that a time is in it. */
function reveal(time) {
  const [from, to] = shownTimes();
  if (time >= from && time <= to) return;
  const half = 0.5 * (to - from);
  look(time - half, time + half);
}

// --- the window of the plot ----------------------------------------------------------------------------------------

/** Show the times from one to another [s]. */
function look(from, to) {
  const end = Math.max(desk.trace.end, 1), wide = Math.min(Math.max(to - from, NARROWEST), end);
  const start = Math.min(Math.max(0.5 * (from + to) - 0.5 * wide, 0), end - wide);
  desk.window = wide >= end ? null : [start, start + wide];
  desk.moved = true;
}

function zoom(factor, about) {
  const [from, to] = shownTimes(), middle = about ?? 0.5 * (from + to);
  const wide = Math.min(Math.max((to - from) * factor, NARROWEST), Math.max(desk.trace.end, 1));
  const start = middle - (wide * (middle - from)) / (to - from);
  look(start, start + wide);
}

function pan(share) {
  const [from, to] = shownTimes(), by = share * (to - from);
  look(from + by, to + by);
}

function fitWindow() {
  desk.window = null;
  desk.moved = true;
}

function plotMoves() {
  const view = byId("view"), held = new Map();
  let before = null;
  const spread = () => {
    const [a, b] = [...held.values()];
    return b === undefined ? null : { wide: Math.abs(a.clientX - b.clientX), middle: timeAt({ clientX: 0.5 * (a.clientX + b.clientX) }) };
  };
  view.addEventListener("pointerdown", (event) => {
    view.focus({ preventScroll: true });
    held.set(event.pointerId, event);
    view.setPointerCapture(event.pointerId);
    view.classList.add("moving");
    before = spread();
  });
  view.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last || !desk.frame) return;
    held.set(event.pointerId, event);
    if (held.size === 1) pan((last.clientX - event.clientX) / desk.frame.w);
    else {
      const now = spread();
      if (before?.wide > 10 && now.wide > 10) zoom(before.wide / now.wide, now.middle);
      before = spread();
    }
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    view.addEventListener(kind, (event) => {
      held.delete(event.pointerId);
      if (!held.size) view.classList.remove("moving");
      before = spread();
    });
  }
  view.addEventListener("wheel", (event) => {
    if (!desk.frame || !(event.ctrlKey || document.activeElement === view)) return; // else the page scrolls
    event.preventDefault();
    zoom(Math.exp(0.0015 * event.deltaY), timeAt(event));
  }, { passive: false });
  view.addEventListener("dblclick", fitWindow);
  view.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey) return;
    const act = { ArrowLeft: () => pan(-0.2), ArrowRight: () => pan(0.2), "+": () => zoom(0.7), "=": () => zoom(0.7), "-": () => zoom(1 / 0.7), 0: fitWindow, Home: fitWindow }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  byId("zoom-in").addEventListener("click", () => zoom(0.7));
  byId("zoom-out").addEventListener("click", () => zoom(1 / 0.7));
  byId("pan-left").addEventListener("click", () => pan(-0.4));
  byId("pan-right").addEventListener("click", () => pan(0.4));
  byId("fit-window").addEventListener("click", fitWindow);
}

// --- readings ------------------------------------------------------------------------------------------------------

/** Note a reading: what it is, its value, and from and to which time it was taken, as texts. */
function note(what, value, from, to = "") {
  desk.rows.push([what, value, from, to]);
  showRows();
}

function showRows() {
  byId("readings").tBodies[0].replaceChildren(...desk.rows.map((row) => element("tr", {}, ...row.map((cell) => element("td", { textContent: cell })))));
  byId("no-readings").hidden = desk.rows.length > 0;
  byId("readings").hidden = !desk.rows.length;
  for (const id of ["copy", "save-readings", "clear"]) byId(id).disabled = !desk.rows.length;
}

function rowsText(separator) {
  const quoted = (cell) => (separator === "," && /[",\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
  return [["what", "value", "from", "to"], ...desk.rows].map((row) => row.map((cell) => quoted(cell)).join(separator)).join("\n");
}

function readingTools() {
  byId("read-cursors").addEventListener("click", () => {
    const [one, two] = desk.cursors;
    const apart = Math.abs(two - one);
    if (desk.between) note(`T, ${desk.between} oscillation${desk.between > 1 ? "s" : ""}`, seconds(apart / desk.between, 4), seconds(one), seconds(two));
    else note("difference", `${seconds(two - one)}, ${reading(cursorValue(two) - cursorValue(one))}`, seconds(one), seconds(two));
  });
  byId("read-period").addEventListener("click", () => {
    const { from, to, value } = desk.period;
    note(`T, ${byId("oscillations").value} oscillations`, seconds(value, 4), seconds(from), seconds(to));
  });
  byId("read-amplitudes").addEventListener("click", () => {
    for (const one of desk.amplitudes) note("amplitude", reading(one.size, 1), seconds(one.t));
    note("γ", withError(desk.decay.gamma, desk.decay.error, "1/s"), seconds(desk.amplitudes[0].t), seconds(desk.amplitudes.at(-1).t));
  });
  byId("copy").addEventListener("click", () => {
    const area = byId("text");
    area.hidden = false;
    area.value = rowsText("\t");
    area.select();
    navigator.clipboard?.writeText(area.value).catch(() => {});
  });
  byId("save-readings").addEventListener("click", () => {
    download("readings.csv", new Blob([`# ${DATA.software}, ${desk.state.file}\n${rowsText(",")}\n`], { type: "text/csv" }));
  });
  byId("clear").addEventListener("click", () => {
    desk.rows = [];
    byId("text").hidden = true;
    showRows();
  });
  for (const id of ["oscillations", "amplitudes"]) byId(id).addEventListener("input", measure);
  byId("snap").addEventListener("change", () => {
    desk.snap = byId("snap").value;
    desk.cursors = desk.cursors.map((time) => (Number.isFinite(time) ? snapped(time) : time));
    if (desk.cursors.some(Number.isNaN)) placeCursors();
    desk.moved = true;
    measure();
  });
}

// --- the other controls --------------------------------------------------------------------------------------------

function start() {
  desk.aimed = false;
  order("start");
}

/** Drag the bob of a virtual pendulum: it is held where the sensor then reads the pointer's angle. */
function bobMoves() {
  const canvas = byId("apparatus");
  let sent = 0;
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top, ...{ at: geometry(box.width, Math.PI) } };
  };
  const aim = async (event, surely) => {
    const { x, y, at } = place(event), now = performance.now();
    desk.lift = Math.round(10 * Math.atan2(x - at.x, y - at.y) * DEGREES) / 10;
    if (!surely && now - sent < 40) return;
    sent = now;
    await order("lift", { angle: desk.lift });
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (!desk.state?.hand) return;
    const { x, y, at } = place(event), angle = desk.now / DEGREES;
    if (Math.hypot(x - at.x - at.length * Math.sin(angle), y - at.y - at.length * Math.cos(angle)) > REACH) return;
    event.preventDefault();
    canvas.setPointerCapture(event.pointerId);
    aim(event, true);
  });
  canvas.addEventListener("pointermove", (event) => { if (desk.lift !== null) aim(event, false); });
  canvas.addEventListener("pointerup", async (event) => {
    if (desk.lift === null) return;
    const aimed = aim(event, true);
    desk.lift = null;
    await aimed;
    order("release");
  });
  canvas.addEventListener("pointercancel", () => { desk.lift = null; });
}

/** The number in a box; null if it is empty. */
function typed(id) {
  return byId(id).value.trim() === "" ? null : Number(byId(id).value);
}

function chooseScene() {
  const place = DATA.scenes[byId("scene").value], before = byId("method").value;
  byId("method").replaceChildren(...place.methods.map((name) => element("option", { value: name, textContent: DATA.methods[name] })));
  if (place.methods.includes(before)) byId("method").value = before;
  byId("length").placeholder = `${Number(place.length.toPrecision(4))}`;
}

function beside(shown) {
  return order("beside", { scene: byId("scene").value, integrator: byId("method").value, dt: typed("step"), length: typed("length"), shown });
}

function tab(controls) {
  document.body.classList.toggle("controls", controls);
  byId("tab-plots").setAttribute("aria-pressed", String(!controls));
  byId("tab-controls").setAttribute("aria-pressed", String(controls));
  desk.moved = true;
  if (controls) drawDecay();
}

function begin() {
  byId("scene").append(...Object.entries(DATA.scenes).map(([name, { about }]) => element("option", { value: name,
    textContent: `${name.replaceAll("_", " ")}${about ? `: ${about}` : ""}` })));
  byId("start").addEventListener("click", start);
  byId("stop").addEventListener("click", () => order("stop"));
  byId("zero").addEventListener("click", () => order("zero"));
  byId("sign").addEventListener("click", () => order("sign"));
  byId("counts").addEventListener("change", () => order("counts", { counts: typed("counts") }));
  byId("unit").addEventListener("change", () => {
    desk.moved = true;
    measure();
  });
  byId("second").addEventListener("change", () => { desk.moved = true; });
  byId("rest").addEventListener("click", () => order("lift", { angle: 0, rest: true }));
  byId("lift").addEventListener("click", () => order("lift", { angle: typed("lift-angle") }));
  byId("release").addEventListener("click", () => order("release"));
  byId("fit").addEventListener("click", () => order("fit", { effects: byId("effects").value, mass: typed("mass") }));
  byId("report").addEventListener("click", () => order("report"));
  byId("name").addEventListener("input", () => { byId("name").dataset.own = "1"; });
  byId("save").addEventListener("click", async () => {
    const told = await order("save", { name: byId("name").dataset.own ? byId("name").value.trim() : "", notes: byId("remarks").value,
      readings: desk.rows.map((row) => row.filter(Boolean).join(", ")) });
    if (!told) return;
    delete byId("name").dataset.own;
    put("saved", `Saved as ${told.file}.`);
  });
  byId("beside").addEventListener("click", () => beside(!desk.state.beside.shown));
  byId("scene").addEventListener("change", chooseScene);
  for (const id of ["scene", "method", "step", "length"]) byId(id).addEventListener("change", () => { if (desk.state?.beside.shown) beside(true); });
  byId("tab-plots").addEventListener("click", () => tab(false));
  byId("tab-controls").addEventListener("click", () => tab(true));
  cursorHandles();
  plotMoves();
  readingTools();
  bobMoves();
  showRows();
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary, a, [role=slider]") || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") desk.state?.recording ? order("stop") : start();
    else if (event.key === "z" || event.key === "Z") order("zero");
    else if ((event.key === "l" || event.key === "L") && desk.state?.hand) order("release");
    else return;
    event.preventDefault();
  });
  addEventListener("resize", () => {
    desk.moved = true;
    drawDecay();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    desk.moved = true;
    drawDecay();
  });
  globalThis.LabPendulum = { desk, order, look, moveCursor, show, shownTimes };
  listen(HEARD, () => { desk.moved = true; }, () => {
    if (desk.state) desk.state.live = false;
    connection("not connected; what was recorded is in its file", false);
  });
  const chosen = setInterval(() => { // the server's choice of scene and method, once it is known
    if (!desk.state) return;
    clearInterval(chosen);
    byId("scene").value = desk.state.beside.scene;
    chooseScene();
    byId("method").value = desk.state.beside.integrator;
    if (desk.state.beside.twin) byId("second").value = "residual";
    for (const id of ["scene", "method", "step", "length"]) byId(id).disabled = desk.state.beside.twin;
  }, 50);
  requestAnimationFrame(frame);
}

begin();
