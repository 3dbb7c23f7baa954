// Ruler and protractor on the apparatus: where they lie, what they read, and how they are drawn to the picture's scale.
//
// `tools` has where the ruler's zero lies to the right of the pivot (`across`) and below it (`down`) and its length (`long`)
// [m], how far the ruler is turned from pointing right, clockwise (`turned`), and the angle of the protractor's hand (`hand`)
// [degrees].

const RULER = 28; // its width [CSS pixels]
const HAND = 0.8; // length of the protractor's hand, over that of the longest pendulum
const SIZES = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100]; // between two ticks [m]

/** The direction in which the ruler points, to the right and down. */
function along(tools) {
  return [Math.cos(tools.turned / DEGREES), Math.sin(tools.turned / DEGREES)];
}

/** The reading of a point, to the right of the pivot and below it, on the ruler [m]. */
function alongRuler(tools, [x, y]) {
  const [cos, sin] = along(tools);
  return (x - tools.across) * cos + (y - tools.down) * sin;
}

/** Where the ruler ends, to the right of the pivot and below it [m]. */
function endOfRuler(tools) {
  const [cos, sin] = along(tools);
  return [tools.across + tools.long * cos, tools.down + tools.long * sin];
}

/** The distance of a point from the middle line of the ruler [m]. */
function awayFromRuler(tools, x, y) {
  const [cos, sin] = along(tools), at = Math.min(Math.max(alongRuler(tools, [x, y]), 0), tools.long);
  return Math.hypot(x - tools.across - at * cos, y - tools.down - at * sin);
}

/** Draw the ruler in a picture of so many pixels per metre: ticks of millimetres or as small as there is room, numbers in
 * centimetres, and a ring at its end, by which it is turned. */
function drawRuler({ context: c, x, y, width, height }, tools, scale, colour) {
  const far = tools.long * scale, half = RULER / 2;
  const fine = SIZES.find((size) => size * scale > 3.5), whole = SIZES.find((size) => size >= 5 * fine);
  const numbered = SIZES.find((size) => size * scale > 26 && size >= whole);
  c.save();
  c.translate(x + tools.across * scale, y + tools.down * scale);
  c.rotate(tools.turned / DEGREES);
  c.globalAlpha = 0.85;
  c.fillStyle = colour("dial");
  c.fillRect(0, -half, far, RULER);
  c.globalAlpha = 1;
  c.strokeStyle = colour("rule");
  c.lineWidth = 1;
  c.strokeRect(0, -half, far, RULER);
  c.strokeStyle = colour("ink");
  c.beginPath();
  for (let i = 0; i * fine <= tools.long; i += 1) {
    const tall = i % Math.round(whole / fine) === 0 ? 7 : 4;
    for (const side of [1, -1]) {
      c.moveTo(i * fine * scale, side * half);
      c.lineTo(i * fine * scale, side * (half - tall));
    }
  }
  c.stroke();
  c.beginPath();
  c.arc(far - 7, 0, 5, 0, 2 * Math.PI);
  c.stroke();
  c.restore();
  c.fillStyle = colour("ink");
  c.font = LETTERS;
  c.textAlign = "center";
  c.textBaseline = "middle";
  const [cos, sin] = along(tools);
  for (let i = 1; i * numbered * scale < far - 18; i += 1) {
    const [u, v] = [x + (tools.across + i * numbered * cos) * scale, y + (tools.down + i * numbered * sin) * scale];
    if (u > 14 && u < width - 14 && v > 8 && v < height - 8) c.fillText(local(String(Number((100 * i * numbered).toPrecision(6)))), u, v);
  }
}

/** Draw the protractor about the pivot, a half circle or, for swings beyond 90 degrees, a whole one, and its hand. */
function drawProtractor({ context: c, x, y, length, width, height }, tools, reach, colour) {
  const radius = 0.5 * length, most = reach > Math.PI / 2 || Math.abs(tools.hand) > 90 ? 180 : 90;
  const fine = [1, 5, 10].find((step) => radius * step > 3 * DEGREES), numbered = [10, 30, 90].find((step) => radius * step > 30 * DEGREES);
  const place = (far, degrees) => [x + far * Math.sin(degrees / DEGREES), y + far * Math.cos(degrees / DEGREES)];
  c.globalAlpha = 0.3;
  c.fillStyle = colour("dial");
  c.strokeStyle = colour("rule");
  c.lineWidth = 1;
  c.beginPath();
  c.arc(x, y, radius, 0.5 * Math.PI - most / DEGREES, 0.5 * Math.PI + most / DEGREES);
  c.closePath();
  c.fill();
  c.globalAlpha = 1;
  c.stroke();
  c.beginPath();
  for (let degrees = -most + (most === 180 ? fine : 0); degrees <= most; degrees += fine) {
    c.moveTo(...place(radius, degrees));
    c.lineTo(...place(radius - (degrees % 10 === 0 ? 8 : 4), degrees));
  }
  c.stroke();
  c.fillStyle = colour("ink");
  c.font = LETTERS;
  c.textAlign = "center";
  c.textBaseline = "middle";
  if (radius > 50) {
    for (let degrees = -Math.floor(most / numbered) * numbered; degrees <= most; degrees += numbered) {
      if (degrees !== -180) c.fillText(String(Math.abs(degrees)), ...place(radius - 18, degrees));
    }
  }
  const [u, v] = place(HAND * length, tools.hand);
  c.strokeStyle = colour("ink");
  c.lineWidth = 1.5;
  c.setLineDash([6, 3]);
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(u, v);
  c.stroke();
  c.setLineDash([]);
  c.beginPath();
  c.arc(u, v, 5, 0, 2 * Math.PI);
  c.fillStyle = colour("paper");
  c.fill();
  c.stroke();
  c.fillStyle = colour("ink");
  const text = local(`${tools.hand.toFixed(1)}°`.replace("-", "−")), room = c.measureText(text).width / 2 + 4;
  const beside = u + (tools.hand < 0 ? -1 : 1) * (room + 8);
  if (width > 110) c.fillText(text, Math.min(Math.max(beside, room), width - room), Math.min(Math.max(v, 10), height - 10));
}
