// A pendulum in the browser: the generated program of a scene and a method, its parameters and its state.

"use strict";

const PAGE = JSON.parse(document.getElementById("data").textContent);
const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let bit = 0; bit < 8; bit += 1) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n;
});
let TEXTS = [];
const COMPILED = new Map();

/** Unpack the programs, which the browser inflates itself. */
async function unpack() {
  const packed = Uint8Array.from(atob(document.getElementById("programs").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  TEXTS = JSON.parse(await new Response(stream).text());
}

/** Return the functions of a program by its number. */
function compiled(number) {
  if (!COMPILED.has(number)) {
    const text = TEXTS[number].replaceAll("export function", "function");
    COMPILED.set(number, new Function(`"use strict";\n${text}\nreturn { run, info };`)());
  }
  return COMPILED.get(number);
}

/** Continue a CRC-32 with the bytes of an array. */
function crc32(bytes, before = 0) {
  let sum = ~before;
  for (const byte of bytes) sum = (sum >>> 8) ^ CRC[(sum ^ byte) & 255];
  return ~sum >>> 0;
}

const FORMULAS = new Map();

/** Return all parameters of a scene's programs by name, for values of its settings. */
function parametersOf(scene, values) {
  const place = PAGE.scenes[scene];
  if (!FORMULAS.has(scene)) FORMULAS.set(scene, new Function("x", place.formulas));
  const found = FORMULAS.get(scene)(values);
  return Object.fromEntries(place.names.map((name, i) => [name, found[i]]));
}

/** One pendulum: a scene with values of its settings, a method, a step [s] and a start [rad, rad/s]. */
class Machine {
  constructor(scene, method, values, dt, angle, velocity) {
    this.scene = PAGE.scenes[scene];
    this.method = method;
    this.dt = dt;
    this.program = this.scene.programs[method];
    this.code = compiled(this.program.program);
    const known = parametersOf(scene, values);
    this.parameters = this.program.numbers.map((name, i) => (name in known ? known[name] : this.program.parameters[i]));
    this.width = this.program.names.length;
    this.rows = [];
    this.seen = [0, 0, 0];
    this.stopped = 0;
    this.begin(angle, velocity);
    this.take(0, 1, 0.0);
    this.last = this.info();
  }

  /** Put the state to a start. */
  begin(angle, velocity) {
    const halves = this.scene.periodic ? half_turns(angle) : 0.0;
    const tilt = this.scene.periodic ? without_half_turns(angle, halves) : angle;
    this.state = [0.0, tilt, 0.5 * halves, velocity, 0.0, 0.0, ...this.program.start];
  }

  /** Take rows * every steps with a share of the motor's torque; returns the states, the initial one first. */
  take(rows, every, control) {
    while (this.rows.length <= rows) this.rows.push(new Float64Array(this.width));
    const code = this.code.run(this.state, this.parameters, control, this.dt, rows, every, Infinity, this.rows, this.seen);
    if (code !== 0) this.stopped = code;
    return this.rows;
  }

  /** The quantities that info has in Python: time, angle, velocity, energies. */
  info(state = this.state) {
    return this.code.info(state);
  }
}

/** Run a program as Python did when the page was made, and return the checksum of all bits. */
function checksumOf(scene, method) {
  const place = PAGE.scenes[scene];
  const usual = place.settings.map((setting) => setting.value);
  const machine = new Machine(scene, method, usual, place.run.dt, place.run.angle, place.run.velocity);
  machine.begin(place.run.angle, place.run.velocity);
  const { steps, torques } = PAGE.check;
  let sum = 0;
  for (const torque of torques) {
    const rows = Array.from({ length: steps + 1 }, () => new Float64Array(machine.width));
    const code = machine.code.run(machine.state, machine.parameters, torque, place.run.dt, steps, 1, Infinity, rows,
      machine.seen);
    for (const row of [...rows, Float64Array.from(machine.state)]) sum = crc32(new Uint8Array(row.buffer), sum);
    sum = crc32([code], sum);
  }
  return sum;
}
