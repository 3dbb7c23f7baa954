// Plots on canvases, with all pendulums in the colours of their bobs.

const MARGIN = { left: 68, right: 14, top: 6, bottom: 32 };
const LEAST_HEIGHT = 190; // of a plot, so that the words beside its axis have room [CSS pixels]

/** Round steps for the ticks of an axis from low to high. */
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
  const found = [];
  for (let n = Math.ceil(low / step); n * step <= high + 1e-9 * step; n += 1) found.push(n * step);
  return found;
}

/** Powers of ten for the ticks of a logarithmic axis; low and high are logarithms. */
function powers(low, high, most) {
  const step = Math.max(1, Math.ceil((high - low) / most));
  const found = [];
  for (let n = Math.ceil(low / step) * step; n <= high; n += step) found.push(n);
  return found;
}

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** A power of ten as text. */
function power(n) {
  return `10${n < 0 ? "⁻" : ""}${[...String(Math.abs(n))].map((digit) => RAISED[digit]).join("")}`;
}

/** A number for a tick. */
function short(value) {
  return value === 0 ? "0" : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3 ? value.toExponential(0)
    : local(String(Number(value.toPrecision(6))).replace("-", "−"));
}

/** Draw axes and curves.
 * plot: { x: [low, high], y: [low, high], log: bool, xlabel, ylabel, curves: [{ points: [[x, y], ...], colour, width,
 * dots }], lines: [{ x, colour }], rings: [{ x, y, colour }], ratio: height over width }
 * Returns the frame of the plot in CSS pixels, { x, y, w, h }.
 */
function drawPlot(canvas, plot, colour) {
  const { context: c, width, height } = fitted(canvas, (wide) => (plot.ratio ? plot.ratio * wide : Math.max(0.56 * wide, LEAST_HEIGHT)));
  const area = { x: MARGIN.left, y: MARGIN.top, w: width - MARGIN.left - MARGIN.right, h: height - MARGIN.top - MARGIN.bottom };
  const [x0, x1] = plot.x, [y0, y1] = plot.y;
  const at = (x) => area.x + ((x - x0) / (x1 - x0)) * area.w;
  const up = (y) => area.y + area.h - ((y - y0) / (y1 - y0)) * area.h;
  c.font = LETTERS;
  c.lineWidth = 1;
  c.fillStyle = colour("ink");
  c.strokeStyle = colour("hairline");
  c.textAlign = "right";
  c.textBaseline = "middle";
  for (const y of plot.log ? powers(y0, y1, 5) : ticks(y0, y1, 5)) {
    c.beginPath();
    c.moveTo(area.x, up(y));
    c.lineTo(area.x + area.w, up(y));
    c.stroke();
    c.fillText(plot.log ? power(y) : short(y), area.x - 5, up(y));
  }
  c.textAlign = "center";
  c.textBaseline = "top";
  for (const x of ticks(x0, x1, Math.max(3, Math.floor(area.w / 60)))) {
    c.beginPath();
    c.moveTo(at(x), area.y);
    c.lineTo(at(x), area.y + area.h);
    c.stroke();
    c.fillText(short(x), at(x), area.y + area.h + 3);
  }
  c.fillText(plot.xlabel, area.x + 0.5 * area.w, area.y + area.h + 17);
  c.save();
  c.translate(10, area.y + 0.5 * area.h);
  c.rotate(-0.5 * Math.PI);
  c.textBaseline = "middle";
  c.fillText(plot.ylabel, 0, 0);
  c.restore();
  c.save();
  c.beginPath();
  c.rect(area.x, area.y, area.w, area.h);
  c.clip();
  for (const curve of plot.curves) {
    c.strokeStyle = c.fillStyle = curve.colour;
    c.globalAlpha = curve.alpha ?? 1;
    c.lineWidth = curve.width ?? 1.5;
    c.setLineDash(curve.dash ?? []);
    if (curve.dots) {
      const size = curve.width ?? 2;
      for (const [x, y] of curve.points) c.fillRect(at(x) - size / 2, up(y) - size / 2, size, size);
      continue;
    }
    c.beginPath();
    let joined = false;
    for (const [x, y] of curve.points) {
      if (!Number.isFinite(x) || !Number.isFinite(y)) {
        joined = false;
        continue;
      }
      if (joined) c.lineTo(at(x), up(y));
      else c.moveTo(at(x), up(y));
      joined = true;
    }
    c.stroke();
  }
  c.globalAlpha = 1;
  c.setLineDash([]);
  c.lineWidth = 1.5;
  for (const { x, colour: tone } of plot.lines ?? []) {
    c.strokeStyle = tone;
    c.beginPath();
    c.moveTo(at(x), area.y);
    c.lineTo(at(x), area.y + area.h);
    c.stroke();
  }
  for (const { x, y, colour: tone } of plot.rings ?? []) {
    c.strokeStyle = tone;
    c.beginPath();
    c.arc(at(x), up(y), 5, 0, 2 * Math.PI);
    c.stroke();
  }
  c.restore();
  c.lineWidth = 1;
  c.strokeStyle = colour("rule");
  c.strokeRect(area.x, area.y, area.w, area.h);
  return area;
}

/** Limits of an axis around values, with room; `least` is the smallest range. */
function around(values, least) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!(high - low >= least)) {
    const middle = Number.isFinite(low) ? 0.5 * (low + high) : 0;
    [low, high] = [middle - 0.5 * least, middle + 0.5 * least];
  }
  const room = 0.06 * (high - low);
  return [low - room, high + room];
}
