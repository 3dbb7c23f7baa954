// A recording that is dropped onto the page: read, drawn over the swing, and fitted by the page's own programs.

const MOST_LINES = 200000, FITTED = 500; // lines that are read; readings that are fitted
const ROUNDS = 40, SETTLED = 1e-7; // of the fit; relative change of the sum of squares at which it ends

/** Times [s] from 0 on and angles [degrees] in a text of columns; throws an error with a sentence where there are none. */
function readText(text) {
  const lines = text.slice(0, 20_000_000).split(/\r?\n/).slice(0, MOST_LINES);
  const sign = [";", "\t"].find((one) => lines.filter((line) => line.includes(one)).length > 0.5 * lines.length)
    ?? (lines.filter((line) => line.includes(",")).length > 0.5 * lines.length ? "," : null);
  const decimal = sign !== "," && !/\d\.\d/.test(text.slice(0, 20000)) && /\d,\d/.test(text.slice(0, 20000));
  const cells = (line) => (sign === null ? line.trim().split(/\s+/) : line.split(sign)).map((cell) => cell.trim().replace(/^"|"$/g, ""));
  const value = (cell) => numberIn(decimal ? cell.replace(",", ".") : cell);
  const rows = [], heads = [];
  for (const line of lines) {
    const numbers = cells(line).map(value);
    if (numbers.length > 1 && Number.isFinite(numbers[0]) && numbers.slice(1).some(Number.isFinite)) rows.push(numbers);
    else if (!rows.length && cells(line).length > 1) heads.push(cells(line));
  }
  if (rows.length < 20) throw new Error(t("it has fewer than 20 lines of numbers: a column of times and one of angles are needed"));
  const names = (heads.at(-1) ?? []).map((name) => name.toLowerCase()), width = Math.max(...rows.map((row) => row.length));
  const time = Math.max(names.findIndex((name) => /^(time|zeit|t\b)/.test(name)), 0);
  const named = names.findIndex((name) => /angle|winkel|theta|auslenkung/.test(name));
  const angle = named >= 0 ? named : [...Array(width).keys()].find((i) => i !== time && rows.every((row) => Number.isFinite(row[i])));
  if (angle === undefined) throw new Error(t("no column beside the times has a number in every line"));
  const good = rows.filter((row) => Number.isFinite(row[time]) && Number.isFinite(row[angle]));
  if (good.some((row, i) => i > 0 && row[time] <= good[i - 1][time])) throw new Error(t("its times do not increase"));
  const head = (heads.map((row) => row[angle] ?? "").join(" ")).toLowerCase(), most = Math.max(...good.map((row) => Math.abs(row[angle])));
  const radians = /rad/.test(head) || (!/°|deg|grad/.test(head) && most < 1.6);
  const said = /rad|°|deg|grad/.test(head) ? "" : radians ? t("The file does not say its unit: radians are assumed.")
    : t("The file does not say its unit: degrees are assumed.");
  const first = good[0][time];
  return { said, readings: [good.map((row) => row[time] - first), good.map((row) => row[angle] * (radians ? DEGREES : 1))] };
}

/** The times at which a curve crosses its middle upwards, between readings by straight lines. */
function crossings(times, values, middle) {
  const found = [];
  for (let i = 1; i < values.length; i += 1) {
    const [one, other] = [values[i - 1] - middle, values[i] - middle];
    if (one < 0 && other >= 0) found.push(times[i - 1] + ((times[i] - times[i - 1]) * -one) / (other - one));
  }
  return found;
}

/** The angles [rad] of a pendulum at increasing times, from the accurate program; between its steps by the cubic through both states. */
function motionAt(values, angle, velocity, dt, times) {
  const machine = new Machine(lab.scene, PAGE.scenes[lab.scene].accurate, values, dt, angle, velocity);
  const found = new Float64Array(times.length);
  let [before, now, i] = [machine.last, machine.last, 0];
  while (i < times.length) {
    if (times[i] <= now.time || machine.stopped) {
      const step = now.time - before.time, s = step > 0 ? (times[i] - before.time) / step : 0, r = 1 - s;
      found[i] = before.angle + s * s * (3 - 2 * s) * (now.angle - before.angle) + s * r * step * (r * before.velocity - s * now.velocity);
      i += 1;
      continue;
    }
    before = now;
    machine.take(1, 1, 0);
    now = machine.info();
  }
  return found;
}

/** Solve a small symmetric system of equations; returns the solution and the inverse of the matrix. */
function solved(matrix, right) {
  const n = right.length, rows = matrix.map((row, i) => [...row, right[i], ...Array.from({ length: n }, (_, j) => (i === j ? 1 : 0))]);
  for (let i = 0; i < n; i += 1) {
    const best = rows.slice(i).reduce((at, row, k) => (Math.abs(row[i]) > Math.abs(rows[at][i]) ? i + k : at), i);
    [rows[i], rows[best]] = [rows[best], rows[i]];
    const pivot = rows[i][i];
    rows[i] = rows[i].map((value) => value / pivot);
    rows.forEach((row, k) => { if (k !== i) rows[k] = row.map((value, j) => value - row[i] * rows[i][j]); });
  }
  return { solution: rows.map((row) => row[n]), inverse: rows.map((row) => row.slice(n + 1)) };
}

/** Fit the present scene to a recording by least squares (Levenberg and Marquardt): start, zero of the sensor, length and damping.
 * Returns [{ name, value, error, unit }], the new values of the settings, the start, the zero [degrees] and the scatter [degrees]. */
function fitRecording([times, degrees], place, usual) {
  const every = Math.ceil(times.length / FITTED), read = times.filter((_, i) => i % every === 0);
  const wanted = degrees.filter((_, i) => i % every === 0).map((value) => value / DEGREES);
  const middle = wanted.reduce((sum, value) => sum + value, 0) / wanted.length;
  const ups = crossings(times, degrees.map((value) => value / DEGREES), middle);
  if (ups.length < 4) throw new Error(t("it has fewer than three whole swings"));
  const period = (ups.at(-1) - ups[0]) / (ups.length - 1);
  const free = place.settings.map((setting, i) => ({ setting, i })).filter(({ setting }) => setting.name === "body.length"
    || setting.kind === "dissipative");
  const values = [...usual], at = free.find(({ setting }) => setting.name === "body.length");
  const size = (from, to) => Math.max(...wanted.slice(from, to).map((value) => Math.abs(value - middle)));
  const part = Math.max(Math.floor((1.2 * period * wanted.length) / read.at(-1)), 3);
  if (at) { // so that small swings take the recorded period, which a larger amplitude lengthens
    const { scale, inertia } = parametersOf(lab.scene, values), amplitude = 0.5 * (size(0, part) + size(-part));
    values[at.i] *= ((period / (1 + amplitude ** 2 / 16)) / (2 * Math.PI / Math.sqrt(scale / inertia))) ** 2;
  }
  const lost = Math.max((2 * Math.log(size(0, part) / size(-part))) / read.at(-1), 1e-3);
  const damping = free.filter((one) => one !== at);
  for (const { setting, i } of damping) values[i] = /gamma/.test(setting.name) ? lost : Math.max(values[i], 1e-3);
  const numbers = [wanted[0] - middle, (wanted[1] - wanted[0]) / (read[1] - read[0]), middle, ...free.map(({ i }) => values[i])];
  const steps = numbers.map((value, i) => (i < 3 ? 1e-5 : 1e-4 * Math.max(Math.abs(value), 1e-3)));
  const dt = Math.min(place.run.dt, period / 60);
  const residuals = (given) => {
    const own = [...values];
    free.forEach(({ setting, i }, k) => { own[i] = Math.max(given[3 + k], setting.least === null ? -Infinity : setting.least + (setting.exclusive ? 1e-9 : 0)); });
    const angles = motionAt(own, given[0], given[1], dt, read);
    return wanted.map((value, i) => angles[i] + given[2] - value);
  };
  const sum = (list) => list.reduce((total, value) => total + value * value, 0);
  let present = residuals(numbers), total = sum(present), tame = 1e-3, inverse = [];
  for (let round = 0; round < ROUNDS; round += 1) {
    const slopes = numbers.map((_, k) => {
      const moved = residuals(numbers.map((value, j) => (j === k ? value + steps[k] : value)));
      return moved.map((value, i) => (value - present[i]) / steps[k]);
    });
    const plain = slopes.map((one) => slopes.map((other) => one.reduce((all, value, i) => all + value * other[i], 0)));
    const right = slopes.map((one) => -one.reduce((all, value, i) => all + value * present[i], 0));
    ({ inverse } = solved(plain, right));
    let better = false;
    for (let tries = 0; tries < 8 && !better; tries += 1, tame *= 10) {
      const { solution } = solved(plain.map((row, i) => row.map((value, j) => (i === j ? value * (1 + tame) : value))), right);
      const next = numbers.map((value, i) => value + solution[i]), tried = residuals(next);
      if (sum(tried) <= total) {
        const settled = total - sum(tried) < SETTLED * total;
        [present, total, better] = [tried, sum(tried), true];
        next.forEach((value, i) => { numbers[i] = value; });
        if (settled) round = ROUNDS;
      }
    }
    if (!better) break;
    tame = Math.max(tame / 1000, 1e-9);
  }
  const variance = total / Math.max(read.length - numbers.length, 1);
  free.forEach(({ i }, k) => { values[i] = Math.max(numbers[3 + k], place.settings[i].least ?? -Infinity); });
  const error = (k) => Math.sqrt(Math.max(variance * inverse[k][k], 0));
  return { values, angle: numbers[0], velocity: numbers[1], zero: numbers[2] * DEGREES, scatter: Math.sqrt(variance) * DEGREES, period,
    found: free.map(({ setting, i }, k) => ({ effect: setting.effect, label: setting.label, value: values[i], error: error(3 + k), unit: setting.unit === "1" ? "" : ` ${setting.unit}` })) };
}
