// The apparatus on a canvas: stand, dial, sensor, suspension, bob, the pale accurate solution, and bars of energy.

const BARS = ["kinetic", "potential", "heat", "work", "residual"];

/** The colours of the page now, by the names of CSS variables without dashes in front. */
function paint() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

const LETTERS = "12px system-ui, sans-serif";

/** Fit a canvas to its place on the screen; returns the context with lengths in CSS pixels, and the size.
 * `tall` is a function from the width to the height. */
function fitted(canvas, tall) {
  const width = Math.max(canvas.clientWidth, 40), height = Math.round(tall(width));
  const dense = Math.min(globalThis.devicePixelRatio || 1, 2);
  if (canvas.width !== Math.round(width * dense) || canvas.height !== Math.round(height * dense)) {
    canvas.width = Math.round(width * dense);
    canvas.height = Math.round(height * dense);
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d");
  context.setTransform(dense, 0, 0, dense, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** The pivot and the drawn length in a picture of the apparatus. */
function geometry(width) {
  return { x: 0.5 * width, y: 0.42 * width, length: 0.31 * width };
}

/** Draw one pendulum: `lane` has machine, ghost, colour and, for the bars, energies and scale. */
function drawApparatus(canvas, lane, torque, colour) {
  const { context: c, width, height } = fitted(canvas, (wide) => 0.88 * wide + BARS.length * barRow(wide));
  const rest = geometry(width), { length } = rest;
  const now = lane.machine.last;
  const [x, y] = [rest.x + lane.shaken("horizontal", now.time) * length, rest.y - lane.shaken("vertical", now.time) * length];
  c.lineCap = "round";
  c.fillStyle = colour("dial");
  c.strokeStyle = colour("dial-edge");
  c.lineWidth = 1;
  c.beginPath();
  c.arc(x, y, 1.16 * length, 0, 2 * Math.PI);
  c.fill();
  c.stroke();
  c.strokeStyle = colour("steel-dark");
  c.lineWidth = 0.018 * width;
  c.beginPath();
  c.moveTo(0.06 * width, 0.84 * width);
  c.lineTo(0.06 * width, 0.06 * width);
  c.moveTo(0.06 * width, rest.y);
  c.lineTo(rest.x, rest.y);
  c.moveTo(rest.x, rest.y);
  c.lineTo(x, y);
  c.stroke();
  c.fillStyle = colour("faint-ink");
  c.font = LETTERS;
  c.textAlign = "center";
  c.textBaseline = "middle";
  for (let degrees = -150; degrees <= 180; degrees += 30) {
    const angle = (degrees * Math.PI) / 180;
    const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
    c.beginPath();
    c.strokeStyle = colour("rule");
    c.lineWidth = 1;
    c.moveTo(x + 1.16 * length * sin, y + 1.16 * length * cos);
    c.lineTo(x + 1.11 * length * sin, y + 1.11 * length * cos);
    c.stroke();
    if (width > 200 && degrees !== -90) c.fillText(`${degrees}°`.replace("-", "−"), x + 1.29 * length * sin, y + 1.25 * length * cos);
  }
  if (lane.ghost) bob(c, x, y, length, lane.ghost.last.angle, width, lane, colour("faint-ink"), colour, 0.35);
  c.fillStyle = colour("sensor");
  c.fillRect(x - 0.05 * width, y - 0.05 * width, 0.1 * width, 0.1 * width);
  bob(c, x, y, length, now.angle, width, lane, lane.colour, colour, 1);
  c.fillStyle = colour("steel-light");
  c.beginPath();
  c.arc(x, y, 0.015 * width, 0, 2 * Math.PI);
  c.fill();
  if (torque) {
    c.strokeStyle = colour("torque");
    c.lineWidth = 3;
    c.beginPath();
    c.arc(x, y, 0.08 * width, 0.5 * Math.PI, 0.5 * Math.PI - 2.2 * torque, torque > 0);
    c.stroke();
  }
  bars(c, lane, width, 0.88 * width, colour);
}

/** Draw suspension and bob, or the parts of a rigid body to scale, at an angle [rad]. */
function bob(c, x, y, length, angle, width, lane, tone, colour, strength) {
  const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  c.globalAlpha = strength;
  if (lane.outline.length) {
    const far = Math.max(...lane.outline.map(([kind, one, two, half]) => Math.max(Math.abs(one), Math.abs(two))
      + (kind === "bar" ? 0 : half)));
    const scale = length / far, mixed = lane.outline.some(([kind]) => kind !== "bar");
    for (const [kind, one, two, half] of lane.outline) {
      c.beginPath();
      if (kind === "bar") {
        c.strokeStyle = mixed && strength === 1 ? colour("steel") : tone;
        c.lineWidth = Math.max(3, 2 * half * scale);
        c.moveTo(x + one * scale * sin, y + one * scale * cos);
        c.lineTo(x + two * scale * sin, y + two * scale * cos);
        c.stroke();
      } else {
        c.fillStyle = tone;
        c.arc(x + one * scale * sin, y + one * scale * cos, Math.max(2.5, half * scale), 0, 2 * Math.PI);
        c.fill();
      }
    }
    c.globalAlpha = 1;
    return;
  }
  const radius = Math.min(0.07, Math.max(0.018, (0.31 * lane.radius) / lane.reach)) * width;
  c.strokeStyle = strength < 1 ? tone : colour(lane.suspension === "wire" ? "wire" : "steel");
  c.lineWidth = lane.suspension === "wire" ? 1.5 : 4;
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(x + length * sin, y + length * cos);
  c.stroke();
  c.fillStyle = tone;
  c.beginPath();
  c.arc(x + length * sin, y + length * cos, radius, 0, 2 * Math.PI);
  c.fill();
  c.globalAlpha = 1;
}

const NAMES = 62, NUMBERS = 76, TRACK = 70; // widths of the longest name, the longest number, the shortest bar [CSS pixels]

/** Whether names and numbers have no room beside the bars, and stand above them. */
function stacked(width) {
  return width < NAMES + TRACK + NUMBERS;
}

/** The height of a bar with its name and its number [CSS pixels]. */
function barRow(width) {
  return stacked(width) ? 30 : Math.max(17, 0.06 * width);
}

/** Draw bars of kinetic, potential, heat, work and residual [J]; an arrow marks a bar that is longer than its track. */
function bars(c, lane, width, top, colour) {
  const above = stacked(width), [left, right] = above ? [2, width - 2] : [NAMES, width - NUMBERS];
  const zero = left + 0.3 * (right - left), row = barRow(width), thick = above ? 11 : 0.7 * row;
  c.textBaseline = "middle";
  c.font = LETTERS;
  for (const [i, name] of BARS.entries()) {
    const value = lane.energies[name], middle = top + (i + 0.5) * row;
    const y = above ? middle + 7 : middle, words = above ? middle - 7 : middle;
    const room = value < 0 ? zero - left : right - zero;
    const full = (Math.abs(value) / lane.scale) * (right - zero);
    c.fillStyle = colour("track");
    c.fillRect(left, y - 0.5 * thick, right - left, thick);
    c.fillStyle = colour(`energy-${name}`);
    const length = Math.min(full, room) || 0;
    c.fillRect(value < 0 ? zero - length : zero, y - 0.5 * thick, length, thick);
    if (full > room) {
      c.fillStyle = colour("ink");
      c.textAlign = value < 0 ? "left" : "right";
      c.fillText(value < 0 ? "◀" : "▶", value < 0 ? left : right, y);
    }
    c.fillStyle = colour("ink");
    c.textAlign = above ? "left" : "right";
    c.fillText(name, above ? left : left - 6, words);
    c.textAlign = above ? "right" : "left";
    c.fillText(joules(value), above ? right : right + 6, words);
    c.fillStyle = colour("rule");
    c.fillRect(zero - 0.5, y - 0.5 * thick - 1, 1, thick + 2);
  }
}

/** An energy with its unit, as text. */
function joules(value) {
  if (!Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  const [unit, factor] = size >= 1e3 || size === 0 ? ["J", 1] : size >= 1 ? ["J", 1] : size >= 1e-3 ? ["mJ", 1e3]
    : size >= 1e-6 ? ["µJ", 1e6] : size >= 1e-9 ? ["nJ", 1e9] : ["J", 1];
  const scaled = value * factor;
  const text = Math.abs(scaled) >= 1e4 || (scaled && Math.abs(scaled) < 1e-2) ? scaled.toExponential(1)
    : scaled.toPrecision(3);
  return `${text.replaceAll("-", "−")} ${unit}`;
}
