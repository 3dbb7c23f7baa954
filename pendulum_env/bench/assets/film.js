// The page of track: the film with what was clicked and tracked over it, the plots with the stretches that are left out.

const ENDED = "The program behind this page has ended; its terminal says what was written.";
const NEAR = 14; // distance from a mark within which it is dragged [CSS pixels]
const TAIL = 0.7; // time for which the way is drawn behind the bob [s]
const SHORTEST = 4; // width of a stretch below which a drag is a click [CSS pixels]
const BOB = "#D55E00", PIVOT = "#0072B2", RIM = "#FFFFFF"; // on the film, whose brightness is not the page's

const desk = { state: null, track: null, time: 0, playing: false, places: { bob: null, pivot: null }, drop: [], cross: null,
  held: null, frame: null, loading: false, wanted: null, marking: null };

// --- the film ------------------------------------------------------------------------------------------------------

/** Show the frame at a time; one at a time is fetched, the latest that was wanted last. */
function seek(time) {
  if (!desk.state) return;
  desk.time = Math.min(Math.max(time, 0), Math.max(desk.state.end - 0.5 * desk.state.step, 0));
  byId("time").value = String(desk.time);
  byId("time").setAttribute("aria-valuetext", `${desk.time.toFixed(2)} s`);
  put("clock", `${desk.time.toFixed(2)} s`);
  desk.wanted = desk.time;
  fetchFrame();
  draw();
  plots();
}

function fetchFrame() {
  if (desk.loading || desk.wanted === null) return;
  desk.loading = true;
  byId("frame").src = `frame/${desk.wanted.toFixed(4)}`;
  byId("frame").alt = `frame of the film at ${desk.wanted.toFixed(2)} s`;
  desk.wanted = null;
}

function play(wanted) {
  desk.playing = wanted;
  put("play", wanted ? "Pause" : "Play");
  if (!wanted) return;
  if (desk.time > desk.state.end - 2 * desk.state.step) seek(0);
  let last = performance.now();
  const next = (now) => {
    if (!desk.playing) return;
    if (!desk.loading) {
      const time = desk.time + (now - last) / 1000;
      last = now;
      if (time >= desk.state.end - desk.state.step) play(false);
      seek(time);
    }
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
}

/** Pixels of the screen per pixel of the film. */
function scale() {
  return byId("frame").clientWidth / desk.state.size[0];
}

/** The place in the film of a point of the screen. */
function placeOf(event) {
  const box = byId("frame").getBoundingClientRect(), share = scale();
  const [x, y] = [(event.clientX - box.left) / share - 0.5, (event.clientY - box.top) / share - 0.5];
  return [Math.round(10 * x) / 10, Math.round(10 * y) / 10];
}

function set(name, place) {
  desk.places[name] = place;
  byId(`${name}-x`).value = place ? String(place[0]) : "";
  byId(`${name}-y`).value = place ? String(place[1]) : "";
  settings();
  draw();
}

function mode() {
  return document.querySelector("input[name=mode]:checked").value;
}

/** After the first click on the bob, the next one is for the pivot. */
function clicked(name, place) {
  set(name, place);
  say(`${name === "bob" ? "The bob" : "The pivot"} is set at ${place[0]}, ${place[1]}.`);
  if (name === "bob" && !desk.places.pivot) document.querySelector("input[name=mode][value=pivot]").checked = true;
}

/** Index of the last reading up to a time, -1 before the first. */
function upTo(time) {
  const { t } = desk.track;
  let low = -1, high = t.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  return low;
}

function draw() {
  const canvas = byId("over"), image = byId("frame");
  if (!desk.state || !image.clientWidth) return;
  const dense = Math.min(globalThis.devicePixelRatio || 1, 2), share = scale();
  canvas.width = Math.round(image.clientWidth * dense);
  canvas.height = Math.round(image.clientHeight * dense);
  const c = canvas.getContext("2d");
  c.scale(dense, dense);
  const at = ([x, y]) => [(x + 0.5) * share, (y + 0.5) * share];
  const twice = (colour, width, path) => { // with a white rim, to be seen on every film
    for (const [tone, wide] of [[RIM, width + 2], [colour, width]]) {
      c.strokeStyle = tone;
      c.lineWidth = wide;
      c.beginPath();
      path();
      c.stroke();
    }
  };
  const plus = ([x, y], half) => {
    c.moveTo(x - half, y);
    c.lineTo(x + half, y);
    c.moveTo(x, y - half);
    c.lineTo(x, y + half);
  };
  if (desk.track) drawTrack(c, at, twice, plus, share);
  c.font = "600 13px system-ui, sans-serif";
  for (const [name, colour] of [["bob", BOB], ["pivot", PIVOT]]) {
    if (!desk.places[name]) continue;
    const [x, y] = at(desk.places[name]);
    twice(colour, 2, () => {
      c.moveTo(x + 9, y);
      c.arc(x, y, 9, 0, 2 * Math.PI);
      plus([x, y], 4);
    });
    c.lineWidth = 3;
    c.strokeStyle = RIM;
    c.strokeText(name, x + 13, y - 7);
    c.fillStyle = colour;
    c.fillText(name, x + 13, y - 7);
  }
  if (desk.cross && document.activeElement === byId("stage")) twice(mode() === "bob" ? BOB : PIVOT, 1.5, () => plus(at(desk.cross), 16));
}

function drawTrack(c, at, twice, plus, share) {
  const { t, px, py, pivot, radius, arc, bob } = desk.track;
  const [x0, y0] = at(pivot), last = upTo(desk.time + 1e-6);
  twice(PIVOT, 1, () => c.arc(x0, y0, radius * share, Math.PI / 2 - arc[1], Math.PI / 2 - arc[0]));
  twice(PIVOT, 2, () => plus([x0, y0], 8));
  const first = upTo(desk.time - TAIL) + 1;
  if (last > first) {
    twice(BOB, 1.5, () => {
      for (let i = first; i <= last; i += 1) c[i === first ? "moveTo" : "lineTo"](...at([px[i], py[i]]));
    });
  }
  if (last >= 0 && desk.time - t[last] < 0.75 * desk.state.step) {
    const [x, y] = at([px[last], py[last]]);
    twice(BOB, 2, () => c.arc(x, y, Math.max(bob * share, 4), 0, 2 * Math.PI));
  }
}

function stageMoves() {
  const stage = byId("stage");
  const nearest = (event) => {
    const box = byId("frame").getBoundingClientRect(), share = scale();
    return ["bob", "pivot"].find((name) => desk.places[name] && Math.hypot(
      (desk.places[name][0] + 0.5) * share - (event.clientX - box.left),
      (desk.places[name][1] + 0.5) * share - (event.clientY - box.top)) < NEAR);
  };
  stage.addEventListener("pointerdown", (event) => {
    if (event.button || !desk.state || desk.state.over) return;
    event.preventDefault();
    stage.focus({ preventScroll: true });
    desk.cross = null;
    desk.held = nearest(event) ?? null;
    if (desk.held) stage.setPointerCapture(event.pointerId);
    else clicked(mode(), placeOf(event));
  });
  stage.addEventListener("pointermove", (event) => {
    if (desk.held) set(desk.held, placeOf(event));
  });
  for (const kind of ["pointerup", "pointercancel"]) stage.addEventListener(kind, () => { desk.held = null; });
  stage.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!desk.state || event.ctrlKey || event.metaKey) return;
    const [width, height] = desk.state.size;
    if (step) {
      const by = event.shiftKey ? 1 : Math.max(1, Math.round(width / 60));
      const [x, y] = desk.cross ?? desk.places[mode()] ?? [Math.round(width / 2), Math.round(height / 2)];
      desk.cross = [Math.min(Math.max(x + by * step[0], 0), width - 1), Math.min(Math.max(y + by * step[1], 0), height - 1)];
      say(`Cross at ${desk.cross[0]}, ${desk.cross[1]}; Enter sets the ${mode()}.`);
    } else if (event.key === "Enter" && desk.cross) clicked(mode(), desk.cross);
    else return;
    event.preventDefault();
    draw();
  });
  for (const kind of ["focus", "blur"]) stage.addEventListener(kind, draw);
}

// --- the plots and the stretches -------------------------------------------------------------------------------------

function plots() {
  if (!desk.track || byId("plots").hidden) return;
  const colour = paint(), { t, y, off, missing } = desk.track;
  const wide = [0, Math.max(desk.state.end, t.at(-1))];
  for (const [id, values, ylabel, least] of [["plot-angle", y, "angle in degrees", 1], ["plot-off", off, "pixels", 0.2]]) {
    const canvas = byId(id), ratio = Math.min(0.55, (id === "plot-off" ? 130 : 200) / Math.max(canvas.clientWidth, 40));
    const area = drawPlot(canvas, { x: wide, y: around(values, least), ratio, xlabel: "time in s", ylabel,
      curves: [{ points: t.map((one, i) => [one, values[i]]), colour: colour("track-ink"), dots: true }],
      lines: [{ x: desk.time, colour: colour("ink") }] }, colour);
    desk.frame = area;
    const c = canvas.getContext("2d"), at = (time) => area.x + (time / wide[1]) * area.w;
    c.fillStyle = colour("left-out");
    for (const one of missing) c.fillRect(at(one), area.y + area.h - 5, 1, 5);
    c.globalAlpha = 0.25;
    for (const [from, to] of [...desk.drop, ...(desk.marking ? [desk.marking] : [])]) {
      const [left, right] = [at(Math.min(from, to)), at(Math.max(from, to))];
      c.fillRect(left, area.y, Math.max(right - left, 1), area.h);
    }
    c.globalAlpha = 1;
  }
}

function timeAt(canvas, event) {
  const box = canvas.getBoundingClientRect();
  const share = (event.clientX - box.left - desk.frame.x) / desk.frame.w;
  return Math.min(Math.max(share, 0), 1) * Math.max(desk.state.end, desk.track.t.at(-1));
}

function plotMoves() {
  for (const id of ["plot-angle", "plot-off"]) {
    const canvas = byId(id);
    let begun = null;
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button || !desk.frame) return;
      canvas.setPointerCapture(event.pointerId);
      begun = event;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!begun) return;
      const far = Math.abs(event.clientX - begun.clientX) >= SHORTEST;
      desk.marking = far && !desk.state.over ? [timeAt(canvas, begun), timeAt(canvas, event)] : null;
      seek(timeAt(canvas, event));
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!begun) return;
      if (desk.marking) leaveOut(...desk.marking);
      else seek(timeAt(canvas, event));
      begun = desk.marking = null;
      plots();
    });
    canvas.addEventListener("pointercancel", () => {
      begun = desk.marking = null;
      plots();
    });
  }
}

/** Leave out the readings between two times; stretches that touch become one. */
function leaveOut(one, two) {
  let [from, to] = [Math.min(one, two), Math.max(one, two)].map((time) => Math.round(1000 * time) / 1000);
  const apart = desk.drop.filter(([a, b]) => b < from || a > to);
  for (const [a, b] of desk.drop) if (!apart.some(([first]) => first === a)) [from, to] = [Math.min(from, a), Math.max(to, b)];
  desk.drop = [...apart, [from, to]].sort((a, b) => a[0] - b[0]);
  say(`${from.toFixed(2)} s to ${to.toFixed(2)} s will be left out; Track again shows the track without it.`);
  listed();
}

function listed() {
  byId("dropped").replaceChildren(...desk.drop.map(([from, to]) => {
    const text = `${from.toFixed(2)} to ${to.toFixed(2)} s`;
    const button = element("button", { type: "button", textContent: `${text} ×`, "aria-label": `keep ${text} after all` });
    button.addEventListener("click", () => {
      desk.drop = desk.drop.filter(([first]) => first !== from);
      listed();
      byId("drop").focus();
    });
    return element("li", {}, button);
  }));
  settings();
  plots();
}

// --- the server ----------------------------------------------------------------------------------------------------

function typed(id) {
  const value = byId(id).valueAsNumber;
  return Number.isFinite(value) ? value : null;
}

/** What the page has set, as orders take it. */
function wish() {
  return { bob: desk.places.bob, pivot: desk.places.pivot, length: typed("length"), until: typed("until"), rate: typed("rate"),
    drop: desk.drop };
}

/** Enable what can be done now. */
function settings() {
  if (!desk.state) return;
  const { work, over } = desk.state;
  for (const one of document.querySelectorAll("#controls input, #controls button, #stretch input, #stretch button, #dropped button")) {
    one.disabled = over || (work !== null && one.id !== "stop");
  }
  byId("stop").disabled = work === null || over;
  byId("go").disabled = work !== null || over || !desk.track;
  put("track", desk.track ? "Track again" : "Track");
  byId("go").classList.toggle("next", Boolean(desk.track));
  byId("track").classList.toggle("main", !desk.track);
}

const HEARD = {
  state(event) {
    const before = desk.state;
    desk.state = event;
    const { size, step, end, settings: own } = event;
    put("source", `${event.name}: ${size[0]} × ${size[1]} pixels, ${Number((1 / step).toPrecision(4))} frames per second, ${end.toFixed(1)} s`);
    byId("time").max = String(end);
    byId("stage").style.setProperty("--shape", String(size[0] / size[1]));
    if (!before) {
      for (const name of ["bob", "pivot"]) set(name, own[name]);
      for (const name of ["length", "until", "rate"]) byId(name).value = own[name] ?? "";
      byId("more").open = ["length", "until", "rate"].some((name) => own[name]);
      desk.drop = own.drop ?? [];
      listed();
      say("Track finds the bob by its motion to and fro. If several things swing, click the bob first.");
    }
    if (!before || before.step !== step) seek(desk.time);
    byId("progress").hidden = !event.work;
    byId("progress").value = event.work?.done ?? 0;
    if (event.over) say("The terminal goes on and writes track.csv, track.png and track.mp4. This page can be closed.");
    else if (event.problem && event.problem !== before?.problem) say(event.problem);
    else if (event.work && !before?.work) say("The bob is being looked for and followed; the film can be looked at meanwhile.");
    settings();
  },
  track(event) {
    desk.track = event;
    byId("result").hidden = byId("plots").hidden = false;
    byId("table").tBodies[0].replaceChildren(...event.rows.map(([name, value]) => element("tr", {},
      element("th", { scope: "row", textContent: name }), element("td", { textContent: value }))));
    byId("text").replaceChildren(...event.text.map((line) => element("li", { textContent: line })));
    say("Tracked. See whether the ring stays on the bob, leave out bad stretches, then go on.");
    settings();
  },
};

function begin() {
  byId("frame").addEventListener("load", () => {
    desk.loading = false;
    draw();
    fetchFrame();
  });
  byId("frame").addEventListener("error", () => { desk.loading = false; });
  byId("play").addEventListener("click", () => play(!desk.playing));
  const step = (by) => {
    play(false);
    seek(desk.time + by * desk.state.step);
  };
  byId("back").addEventListener("click", () => step(-1));
  byId("forth").addEventListener("click", () => step(1));
  byId("time").addEventListener("input", () => {
    play(false);
    seek(byId("time").valueAsNumber);
  });
  for (const name of ["bob", "pivot"]) {
    for (const axis of ["x", "y"]) {
      byId(`${name}-${axis}`).addEventListener("change", () => {
        const place = [typed(`${name}-x`), typed(`${name}-y`)];
        desk.places[name] = place.includes(null) ? null : place;
        draw();
      });
    }
    byId(`${name}-clear`).addEventListener("click", () => set(name, null));
  }
  byId("track").addEventListener("click", () => order("track", wish()));
  byId("stop").addEventListener("click", () => order("stop"));
  byId("go").addEventListener("click", () => order("go", wish()));
  byId("drop").addEventListener("click", () => {
    const [from, to] = [typed("from"), typed("to")];
    if (from === null || to === null) say("Type both times in s, or drag over the plot.");
    else leaveOut(from, to);
  });
  stageMoves();
  plotMoves();
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary, a") || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") play(!desk.playing);
    else if (event.key === ",") step(-1);
    else if (event.key === ".") step(1);
    else return;
    event.preventDefault();
  });
  const again = () => {
    draw();
    plots();
  };
  addEventListener("resize", again);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  globalThis.LabPendulum = { desk, order, seek };
  const events = listen(HEARD, () => {
    again();
    if (desk.state?.over) events.close();
  }, () => {
    if (!desk.state?.over) say(ENDED);
  });
}

begin();
