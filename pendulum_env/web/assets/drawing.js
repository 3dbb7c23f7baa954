// The apparatus on a canvas: stand, dial, sensor, suspension, bob, the pale accurate solution, and the bar of energies.

const LETTERS = "12px system-ui, sans-serif";
const STACK = ["kinetic", "potential", "heat"]; // what the bar of energies adds up
const BAR = 26; // height of the bar with the room above it [CSS pixels]
const TRAIL = 90; // readings behind the bob

/** The colours of the page now, by the names of CSS variables without dashes in front. */
function paint() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

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

/** The pivot and the drawn length of a pendulum that swings up to an angle [rad], in a picture of this width.
 *
 * A small swing hangs from the upper edge, as large as it fits; the further it goes, the smaller it is drawn and the
 * lower the pivot stands, without a jump. */
function geometry(width, reach) {
  const above = Math.max(-Math.cos(reach), 0); // how far the bob rises over the pivot, in lengths
  const widest = 0.4 / Math.max(Math.sin(Math.min(1.1 * reach + 0.1, Math.PI / 2)), 0.01);
  const length = Math.min(0.64, widest, 0.65 / (1 + above));
  return { x: 0.5 * width, y: Math.max(0.1, 0.08 + 1.14 * length * above) * width, length: length * width };
}

/** Draw one pendulum; returns the context with the size of the picture and its geometry.
 *
 * `lane` has machine, ghost, colour, energies if they are shown, and `share`, its length over that of the longest; `reach` is
 * the largest angle that any of the pendulums has reached [rad]. */
function drawApparatus(canvas, lane, torque, reach, shown, colour) {
  const { context: c, width, height } = fitted(canvas, (wide) => 0.92 * wide + (lane.energies ? BAR : 0));
  const rest = geometry(width, lane.outline.length ? Math.PI : reach), length = rest.length * lane.share;
  const now = lane.machine.last;
  const [x, y] = [rest.x + lane.shaken("horizontal", now.time) * length, rest.y - lane.shaken("vertical", now.time) * length];
  c.lineCap = "round";
  stand(c, width, rest, x, y, colour);
  dial(c, width, x, y, rest.length, lane.outline.length ? Math.PI : reach, colour);
  if (shown.trail && !lane.outline.length) trail(c, lane, x, y, length, width);
  if (lane.ghost) bob(c, x, y, length, lane.ghost.last.angle, width, lane, colour("faint-ink"), colour, 0.35);
  c.fillStyle = colour("sensor");
  c.beginPath();
  c.roundRect(x - 0.05 * width, y - 0.05 * width, 0.1 * width, 0.1 * width, 0.012 * width);
  c.fill();
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
  if (shown.velocity || shown.acceleration || shown.force) arrows(c, lane, x, y, length, width, shown, colour);
  if (lane.energies) energyBar(c, lane, width, height, colour);
  return { context: c, width, height, ...rest };
}

/** Draw the post and the arm that hold the sensor at (x, y), which a drive may move away from its rest. */
function stand(c, width, rest, x, y, colour) {
  c.strokeStyle = colour("steel-dark");
  c.lineWidth = Math.max(2, 0.016 * width);
  c.beginPath();
  c.moveTo(0.02 * width, 0.9 * width);
  c.lineTo(0.02 * width, 0.03 * width);
  c.moveTo(0.02 * width, rest.y);
  c.lineTo(rest.x, rest.y);
  c.lineTo(x, y);
  c.stroke();
}

/** Draw the scale of degrees: a whole circle, or the arc of a small swing. */
function dial(c, width, x, y, length, reach, colour) {
  const whole = reach > 165 / DEGREES, most = whole ? 180 : Math.ceil((reach * DEGREES) / 5 + 0.4) * 5;
  const radius = 1.14 * length, room = width > 200 ? 30 : 44; // pixels between two numbers
  const fine = [1, 5, 10, 30, 90].find((step) => radius * step > 4 * DEGREES);
  const numbered = [1, 2, 5, 10, 15, 30, 45, 90].find((step) => radius * step > room * DEGREES);
  const start = 0.5 * Math.PI - most / DEGREES, end = 0.5 * Math.PI + most / DEGREES;
  c.fillStyle = colour("dial");
  c.strokeStyle = colour("dial-edge");
  c.lineWidth = 1;
  c.beginPath();
  if (!whole) c.moveTo(x, y);
  c.arc(x, y, radius, start, end);
  c.fill();
  c.beginPath();
  c.arc(x, y, radius, start, end);
  c.stroke();
  c.fillStyle = colour("faint-ink");
  c.font = LETTERS;
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.strokeStyle = colour("rule");
  for (let degrees = -Math.floor(most / fine) * fine; degrees <= most; degrees += fine) {
    if (whole && degrees === -180) continue;
    const [sin, cos] = [Math.sin(degrees / DEGREES), Math.cos(degrees / DEGREES)];
    const inner = radius - (degrees % numbered === 0 ? 8 : 4);
    c.beginPath();
    c.moveTo(x + radius * sin, y + radius * cos);
    c.lineTo(x + inner * sin, y + inner * cos);
    c.stroke();
    const [u, v] = [x + (radius + 17) * sin, y + (radius + 10) * cos];
    if (degrees % numbered === 0 && width > 110 && degrees !== -90 && u > 0.07 * width + 12 && u < width - 16 && v > 7) {
      c.fillText(`${degrees}°`.replace("-", "−"), u, v);
    }
  }
}

/** Draw where the bob was, paler the longer ago. */
function trail(c, lane, x, y, length, width) {
  const rows = lane.history.rows.slice(-TRAIL);
  c.strokeStyle = lane.colour;
  c.lineWidth = Math.max(1.5, 0.012 * width);
  const piece = 10; // readings of one opacity
  c.lineCap = "butt"; // round ends of two pieces would be a darker dot
  for (let first = 0; first < rows.length - 1; first += piece) {
    c.globalAlpha = 0.4 * ((first + piece) / TRAIL) ** 2;
    c.beginPath();
    c.moveTo(x + length * Math.sin(rows[first][1]), y + length * Math.cos(rows[first][1]));
    for (let i = first + 1; i < Math.min(first + piece + 1, rows.length); i += 1) {
      const [one, other] = [rows[i - 1][1], rows[i][1]];
      if (Math.abs(other - one) > 1.5) c.moveTo(x + length * Math.sin(other), y + length * Math.cos(other)); // too far apart
      else c.arc(x, y, length, 0.5 * Math.PI - one, 0.5 * Math.PI - other, other > one);
    }
    c.stroke();
  }
  c.lineCap = "round";
  c.globalAlpha = 1;
}

/** Draw arrows of velocity, acceleration and forces at the bob, each as long as its size over the largest of this run.
 * Of the forces, one is the weight and one the sum of all others, most of it the pull of the suspension. */
function arrows(c, lane, x, y, length, width, shown, colour) {
  if (lane.outline.length) return;
  const { angle } = lane.machine.last, [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  const [u, v] = [x + length * sin, y + length * cos];
  const wanted = [["velocity", [lane.motion.velocity, 0], lane.motion.fastest, colour("torque")],
    ["acceleration", [lane.motion.tangential, lane.motion.central], lane.motion.strongest, colour("warning")]];
  if (shown.force && lane.motion.heaviest > 0) {
    const scale = (0.16 * width) / lane.motion.heaviest;
    arrow(c, u, v, 0, scale * lane.motion.weight, colour("ink"));
    arrow(c, u, v, scale * lane.motion.pull[0], scale * lane.motion.pull[1], colour("ink"));
  }
  for (const [name, [along, inward], largest, tone] of wanted) {
    if (!shown[name] || !(largest > 0)) continue;
    const scale = (0.24 * width) / largest;
    arrow(c, u, v, scale * (along * cos - inward * sin), scale * (-along * sin - inward * cos), tone);
  }
}

function arrow(c, x, y, dx, dy, tone) {
  const size = Math.hypot(dx, dy);
  if (size < 2) return;
  const head = Math.min(9, 0.5 * size), [a, b] = [dx / size, dy / size];
  c.strokeStyle = c.fillStyle = tone;
  c.lineWidth = 2.5;
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(x + dx - head * a, y + dy - head * b);
  c.stroke();
  c.beginPath();
  c.moveTo(x + dx, y + dy);
  c.lineTo(x + dx - head * (a + 0.5 * b), y + dy - head * (b - 0.5 * a));
  c.lineTo(x + dx - head * (a - 0.5 * b), y + dy - head * (b + 0.5 * a));
  c.fill();
}

/** How far the parts of a rigid body reach from the pivot [m]. */
function extent(outline) {
  return Math.max(...outline.map(([kind, one, two, half]) => Math.max(Math.abs(one), Math.abs(two)) + (kind === "bar" ? 0 : half)));
}

/** Draw suspension and bob, or the parts of a rigid body to scale, at an angle [rad]. */
function bob(c, x, y, length, angle, width, lane, tone, colour, strength) {
  const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  c.globalAlpha = strength;
  if (lane.outline.length) {
    const scale = length / extent(lane.outline), mixed = lane.outline.some(([kind]) => kind !== "bar");
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
  const radius = Math.min(0.06 * width, Math.max(0.022 * width, 4, (lane.radius / lane.reach) * length));
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

/** Draw one bar that kinetic and potential energy and heat share, and a mark for what they should add up to: the energy
 * at the start and the work since. What is beyond the mark, or missing, is the method's error. */
function energyBar(c, lane, width, height, colour) {
  const [left, right] = [0.02 * width, 0.98 * width], top = height - BAR + 8, thick = BAR - 12;
  const scale = (right - left) / lane.scale;
  c.fillStyle = colour("track");
  c.fillRect(left, top, right - left, thick);
  let end = left;
  for (const name of STACK) {
    const next = Math.min(end + Math.max(lane.energies[name], 0) * scale, right);
    c.fillStyle = colour(`energy-${name}`);
    if (next > end) c.fillRect(end, top, next - end, thick); // not numbers: nothing
    end = next > end ? next : end;
  }
  const mark = left + (lane.begun + lane.energies.work) * scale;
  if (mark >= left && mark <= right + 1) {
    c.fillStyle = colour("energy-residual");
    c.fillRect(Math.min(end, mark), top + thick - 4, Math.abs(end - mark), 4);
    c.fillStyle = colour("ink");
    c.fillRect(mark - 1, top - 5, 2, thick + 8);
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
  return `${local(text.replaceAll("-", "−"))} ${unit}`;
}
