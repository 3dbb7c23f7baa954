// Readings of a run and what is read off them: zero crossings, turning points, period, decay, slopes, curves.

const MOST = 131072; // readings that are kept; beyond, every other one goes
const UNEVEN = 0.25; // of the amplitude: readings nearer to zero give the line of a crossing
const ARC = 0.12; // of a half swing on each side of a turning point gives its arc

/** Times [s] and readings of a run, of which every other one is dropped whenever there are too many. */
class Trace {
  constructor() {
    this.t = new Float64Array(MOST);
    this.y = new Float64Array(MOST);
    this.count = this.seen = 0;
    this.stride = 1;
  }

  add(times, values) {
    for (let i = 0; i < times.length; i += 1) {
      if (this.seen % this.stride === 0) {
        this.t[this.count] = times[i];
        this.y[this.count] = values[i];
        this.count += 1;
      }
      this.seen += 1;
      if (this.count === MOST) {
        for (let k = 0; k < MOST / 2; k += 1) [this.t[k], this.y[k]] = [this.t[2 * k], this.y[2 * k]];
        this.count /= 2;
        this.stride *= 2;
      }
    }
  }

  get end() {
    return this.count ? this.t[this.count - 1] : 0;
  }

  /** The index of the first reading at or after a time [s]. */
  after(time) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The index of the reading nearest to a time [s]. */
  near(time) {
    const i = Math.min(this.after(time), this.count - 1);
    return i > 0 && time - this.t[i - 1] < this.t[i] - time ? i - 1 : i;
  }

  /** The slope at a reading, of the straight line through its neighbours within 0.03 s, at least one on each side. */
  slope(i) {
    let low = i, high = i;
    while (low > 0 && (i - low < 1 || (this.t[i] - this.t[low - 1] <= 0.03 && i - low < 50))) low -= 1;
    while (high < this.count - 1 && (high - i < 1 || (this.t[high + 1] - this.t[i] <= 0.03 && high - i < 50))) high += 1;
    return line(this.t, this.y, low, high + 1).slope;
  }

  /** The reading at a time, between its neighbours. */
  at(time) {
    const i = Math.min(Math.max(this.after(time), 1), this.count - 1);
    const part = (time - this.t[i - 1]) / (this.t[i] - this.t[i - 1]);
    return this.y[i - 1] + part * (this.y[i] - this.y[i - 1]);
  }
}

/** The least-squares line through readings from low to high: its slope, middle and value there, and the slope's error. */
function line(t, y, low, high) {
  const n = high - low;
  let [time, value] = [0, 0];
  for (let i = low; i < high; i += 1) {
    time += t[i] / n;
    value += y[i] / n;
  }
  let [spread, product] = [0, 0];
  for (let i = low; i < high; i += 1) {
    spread += (t[i] - time) ** 2;
    product += (t[i] - time) * (y[i] - value);
  }
  const slope = product / spread;
  let squares = 0;
  for (let i = low; i < high; i += 1) squares += (y[i] - value - slope * (t[i] - time)) ** 2;
  return { slope, time, value, error: n > 2 ? Math.sqrt(squares / (n - 2) / spread) : NaN };
}

/** The size of what is no motion: noise from second differences, and the smallest step between readings. */
function disturbance(trace) {
  const { y, count } = trace, seconds = [], first = Math.max(1, count - 2000);
  let step = Infinity;
  for (let i = first; i < count - 1; i += 1) {
    seconds.push(Math.abs(y[i + 1] - 2 * y[i] + y[i - 1]));
    const jump = Math.abs(y[i] - y[i - 1]);
    if (jump > 1e-9 && jump < step) step = jump;
  }
  seconds.sort((a, b) => a - b);
  const noise = (seconds[seconds.length >> 1] ?? 0) / 1.65;
  return Math.max(4 * noise, Number.isFinite(step) ? 1.5 * step : 0, 1e-9);
}

/** Zero crossings, [{ t, y: 0, up }], and the turning points between them, [{ t, y }].
 *
 * A crossing is the zero of the straight line through all readings near it, from one side beyond the disturbance to the
 * other. A turning point is the vertex of the cosine fitted to its arc.
 */
function marksOf(trace) {
  const { t, y, count } = trace, level = disturbance(trace);
  const crossings = [], turnings = [];
  let side = 0, last = -1, most = 0, before = -1; // before: index of the extreme since the last crossing
  for (let i = 0; i < count; i += 1) {
    const size = Math.abs(y[i]);
    if (size <= level) continue;
    const now = Math.sign(y[i]);
    if (side && now !== side) {
      const high = crossingAt(trace, last, i, UNEVEN * most);
      if (crossings.length) {
        const vertex = vertexAt(trace, before, high.t - crossings.at(-1).t);
        if (vertex) turnings.push(vertex);
      }
      crossings.push({ ...high, up: now > 0 });
      [most, before] = [0, -1];
    }
    if (size > most) [most, before] = [size, i];
    [side, last] = [now, i];
  }
  return { crossings, turnings };
}

/** The crossing between the readings `low` and `high`, with those around it that are within `reach` of zero. */
function crossingAt(trace, low, high, reach) {
  const { t, y, count } = trace;
  let [first, end] = [low, high + 1];
  const most = 40 + (high - low);
  while (first > 0 && low - first < most && Math.abs(y[first - 1]) < reach && y[first - 1] * y[low] > 0) first -= 1;
  while (end < count && end - high < most && Math.abs(y[end]) < reach && y[end] * y[high] > 0) end += 1;
  const width = Math.min(low - first, end - 1 - high); // as many on both sides, so that the curvature cancels
  const fitted = line(t, y, low - width, high + 1 + width);
  const zero = fitted.time - fitted.value / fitted.slope;
  return { t: zero >= t[low] && zero <= t[high] ? zero : t[low] - (y[low] * (t[high] - t[low])) / (y[high] - y[low]), y: 0 };
}

/** The vertex of c + a cos + b sin at the angular frequency of a half swing, fitted to the arc about a reading. */
function vertexAt(trace, at, half) {
  const { t, y, count } = trace, omega = Math.PI / half;
  let centre = t[at], found = { t: t[at], y: y[at] };
  for (let turn = 0; turn < 2; turn += 1) {
    const low = trace.after(centre - ARC * half * 1.5), high = Math.min(trace.after(centre + ARC * half * 1.5), count);
    if (high - low < 4) return found;
    const sums = Array.from({ length: 3 }, () => [0, 0, 0, 0]);
    for (let i = low; i < high; i += 1) {
      const phase = omega * (t[i] - centre), row = [1, Math.cos(phase), Math.sin(phase), y[i]];
      for (let j = 0; j < 3; j += 1) for (let k = 0; k < 4; k += 1) sums[j][k] += row[j] * row[k];
    }
    const [c, a, b] = solved(sums), sign = Math.sign(y[at] - c) || 1;
    const phase = Math.atan2(sign * b, sign * a), value = c + sign * Math.hypot(a, b);
    if (!Number.isFinite(value) || Math.abs(phase) > omega * ARC * 1.5 * half || Math.abs(value) > 1.5 * Math.abs(y[at])) return found;
    centre += phase / omega;
    found = { t: centre, y: value };
  }
  return found;
}

/** The solution of a small system of linear equations, rows with the right side last. */
function solved(rows) {
  const n = rows.length;
  for (let i = 0; i < n; i += 1) {
    const pivot = rows.slice(i).reduce((best, row, k) => (Math.abs(row[i]) > Math.abs(rows[best][i]) ? i + k : best), i);
    [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
    for (let k = 0; k < n; k += 1) {
      if (k === i) continue;
      const factor = rows[k][i] / rows[i][i];
      for (let j = i; j <= n; j += 1) rows[k][j] -= factor * rows[i][j];
    }
  }
  return rows.map((row, i) => row[n] / row[i]);
}

/** The period over n oscillations from the first crossing at or after a time: { from, to, value } in s, or null. */
function periodOver(crossings, n, from) {
  const start = crossings.findIndex((one) => one.t >= from - 1e-9), end = start + 2 * n;
  if (start < 0 || end >= crossings.length) return null;
  return { from: crossings[start].t, to: crossings[end].t, value: (crossings[end].t - crossings[start].t) / n };
}

/** Half the way from each turning point to the next: amplitudes in which the sensor's zero cancels. */
function amplitudesOf(turnings) {
  const found = [];
  for (let i = 1; i < turnings.length - 1; i += 1) {
    const size = Math.abs(turnings[i].y - 0.5 * (turnings[i - 1].y + turnings[i + 1].y)) / 2;
    if (size > 0) found.push({ t: turnings[i].t, size });
  }
  return found;
}

/** At most n of a list, spread evenly from its first to its last. */
function spreadOut(list, n) {
  if (list.length <= n) return list;
  return Array.from({ length: n }, (_, i) => list[Math.round((i * (list.length - 1)) / (n - 1))]);
}

/** The decay rate gamma [1/s] of theta ~ exp(-gamma t / 2), from the line through logarithms of amplitudes. */
function decayOf(amplitudes) {
  const t = amplitudes.map((one) => one.t), y = amplitudes.map((one) => Math.log(one.size));
  const fitted = line(t, y, 0, t.length);
  return { gamma: -2 * fitted.slope, error: 2 * fitted.error, at: (time) => fitted.value + fitted.slope * (time - fitted.time) };
}

/** A curve from the server, { t, y, v } with rates per second: its value at a time, by cubics (Hermite); NaN outside. */
function valueOf(curve, time) {
  const { t, y, v } = curve;
  if (!t.length || time < t[0] || time > t.at(-1)) return NaN;
  let low = 0, high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  const step = t[high] - t[low], s = (time - t[low]) / step, rest = 1 - s;
  return y[low] + s * s * (3 - 2 * s) * (y[high] - y[low]) + s * rest * step * (rest * v[low] - s * v[high]);
}

/** A value with its error, rounded as people write it. */
function withError(value, error, unit) {
  if (!(error > 0) || !Number.isFinite(error)) return `${minus(Number(value.toPrecision(4)))} ${unit}`;
  const digits = Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(error))));
  return `${minus(value.toFixed(digits))} ± ${error.toFixed(digits)} ${unit}`;
}

/** A number as text with a true minus sign. */
function minus(value) {
  return String(value).replace("-", "−");
}
