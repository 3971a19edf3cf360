// The rest of the page: table, details, sections, and the wires between them and the view. All texts come in as text.

const hidden = /[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}]/gu; // what a name of others may use to turn or hide text
const escaped = (letter) => `\\u{${letter.codePointAt(0).toString(16)}}`;
const facts = JSON.parse(document.getElementById("data").textContent, (_, value) =>
  typeof value === "string" ? value.replace(hidden, escaped) : value);
const { result, view, maps } = facts;
const cylinders = result.cylinders;
const byId = (id) => document.getElementById(id);

/** Make an element; `properties` are set as they are, children may be texts. */
function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

// --- numbers in words

const number = (value, digits = 4) => (value === undefined ? "–" : String(Number(value.toPrecision(digits))));
const vector = (values, digits = 8) => values.map((value) => number(value, digits)).join(", ");
/** Write coordinates; those of maps have more digits, down to the noise. */
function coordinates(values, digits = 8) {
  const decimals = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(result.scene.noise || 1))));
  const whole = (value) => (Math.abs(value) < 1 ? 0 : Math.floor(Math.log10(Math.abs(value))) + 1);
  return values.map((value) => number(value, Math.max(digits, Math.abs(value) < 1000 ? 0 : whole(value) + decimals))).join(", ");
}
const fraction = (value) => (value === undefined ? "–" : value.toFixed(3).replace(/^-(0\.0*)$/, "$1"));
const degrees = (value) => (value === undefined ? "–" : `${number(value, 2)}°`);

/** Write a value with as many decimals as its standard deviation makes sense of. */
function uncertain(value, deviation) {
  if (deviation === undefined || !(deviation > 0)) return number(value, 5);
  const decimals = Math.min(12, Math.max(0, 1 - Math.floor(Math.log10(deviation))));
  return `${value.toFixed(decimals)} ± ${deviation.toFixed(decimals)}`;
}

function nominal({ catalogue: match }) {
  if (!match || match.decision === "none") return "–";
  return (match.name ?? number(match.nominal_radius)) + (match.decision === "ambiguous" ? "?" : "");
}

// --- the table

const COLUMNS = [
  { name: "id", value: (one) => one.id, text: (one) => String(one.id) },
  { name: "radius", value: (one) => one.radius, text: (one) => uncertain(one.radius, one.uncertainty?.radius) },
  { name: "height", value: (one) => one.height, text: (one) => number(one.height) },
  { name: "coverage", value: (one) => one.coverage_deg, text: (one) => `${one.coverage_deg.toFixed(0)}°` },
  { name: "inliers", value: (one) => one.inliers, text: (one) => String(one.inliers) },
  { name: "rmse", value: (one) => one.rmse, text: (one) => number(one.rmse, 3) },
  { name: "confidence", value: (one) => one.confidence, text: (one) => fraction(one.confidence) },
  { name: "axis sd", value: (one) => one.uncertainty?.axis_angle_deg, text: (one) => degrees(one.uncertainty?.axis_angle_deg) },
  { name: "direction", value: (one) => one.axis_direction[2], text: (one) => one.axis_direction.map(fraction).join(" ") },
];
if (cylinders.some((one) => one.catalogue)) COLUMNS.push({ name: "nominal", value: nominal, text: nominal });

const colorOf = (id) => `rgb(${unpack(view.palette, Uint8Array).subarray(3 * id, 3 * id + 3).join(" ")})`;
const order = { column: -1, down: false };
const rows = cylinders.map(makeRow);
let viewer = null;
let selected = -1;

function makeRow(one) {
  const box = make("input", { type: "checkbox", checked: true, ariaLabel: `show cylinder ${one.id}` });
  box.addEventListener("change", () => show([one.id], box.checked));
  const swatch = make("span", { className: "swatch" });
  swatch.style.backgroundColor = colorOf(one.id);
  const button = make("button", { className: "choose", ariaLabel: `cylinder ${one.id}` }, swatch, String(one.id));
  const cells = COLUMNS.slice(1).map((column) => make("td", {}, column.text(one)));
  const row = make("tr", {}, make("td", {}, box), make("td", {}, button), ...cells);
  row.addEventListener("click", (event) => {
    if (event.target !== box) select(one.id, true);
  });
  return row;
}

function makeHeads() {
  const all = make("input", { type: "checkbox", checked: true, ariaLabel: "show all cylinders" });
  all.addEventListener("change", () => show(cylinders.map((one) => one.id), all.checked));
  const heads = COLUMNS.map((column, place) =>
    make("th", { scope: "col" }, make("button", { onclick: () => sortBy(place) }, column.name)));
  byId("heads").append(make("th", {}, all), ...heads);
}

function sortBy(place) {
  order.down = order.column === place ? !order.down : false;
  order.column = place;
  const { value } = COLUMNS[place];
  const sign = order.down ? -1 : 1;
  const compare = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === undefined || y === undefined) return (x === undefined) - (y === undefined); // what is unknown comes last
    return sign * (x > y) - sign * (x < y) || a.id - b.id;
  };
  byId("rows").replaceChildren(...[...cylinders].sort(compare).map((one) => rows[one.id]));
  [...byId("heads").children].slice(1).forEach((head, i) => {
    head.ariaSort = i !== place ? "none" : order.down ? "descending" : "ascending";
  });
}

function show(ids, visible) {
  for (const id of ids) {
    rows[id].querySelector("input").checked = visible;
    if (visible) viewer?.hidden.delete(id);
    else viewer?.hidden.add(id);
  }
  viewer?.paint();
}

/** Select a cylinder, -1 for none, in the table, in the view and in the details. */
function select(id, fly = false) {
  selected = id;
  rows.forEach((row, i) => {
    row.ariaCurrent = i === id ? "true" : null;
  });
  if (!fly && id >= 0) revealRow(rows[id]);
  if (viewer) {
    viewer.selected = id;
    if (fly) viewer.fly(id);
    viewer.ask();
  }
  showDetails();
}

/** Scroll the table, and not the page, to a row. */
function revealRow(row) {
  const frame = byId("table");
  const [top, bottom] = [row.offsetTop - frame.querySelector("thead").offsetHeight, row.offsetTop + row.offsetHeight];
  if (top < frame.scrollTop) frame.scrollTop = top;
  else if (bottom > frame.scrollTop + frame.clientHeight) frame.scrollTop = bottom - frame.clientHeight;
}

// --- the details of a cylinder

function definitions(pairs) {
  const shown = pairs.filter(([, text]) => text !== undefined);
  return make("dl", {}, ...shown.flatMap(([term, text]) => [make("dt", {}, term), make("dd", {}, text)]));
}

function showDetails() {
  const one = cylinders[selected];
  const place = byId("details");
  if (!one) {
    const text = cylinders.length ? "Choose a cylinder." : "No cylinder was found.";
    place.replaceChildren(make("p", { className: "quiet" }, text));
    return;
  }
  const sd = one.uncertainty;
  const match = one.catalogue;
  const swatch = make("span", { className: "swatch" });
  swatch.style.backgroundColor = colorOf(one.id);
  const values = definitions([
    ["radius", uncertain(one.radius, sd?.radius)],
    ["height", number(one.height, 5)],
    ["start", coordinates(one.start)],
    ["end", coordinates(one.end)],
    ["direction", vector(one.axis_direction, 6)],
    ["axis sd", sd && `${number(sd.axis_angle_deg, 3)}°, ${number(sd.axis_offset, 3)} aside`],
    ["points", `${one.inliers}, rmse ${number(one.rmse, 3)}`],
    ["support", one.payoff === undefined ? String(one.support) : `${one.support}, payoff ${fraction(one.payoff)}`],
    ["confidence", fraction(one.confidence)],
    ["form", one.form === undefined ? undefined : number(one.form, 3)],
    ["side", one.side],
    ["nominal", match && `${nominal(one)}, ${match.decision}, ratio ${number(match.likelihood_ratio, 3)}; free radius ` +
      uncertain(match.free_radius, match.free_radius_sd)],
  ]);
  const evidence = definitions(Object.entries(one.evidence ?? {}).map(([name, value]) => [name, number(value, 4)]));
  const figures = maps.length ? [make("div", { className: "figures" }, mapFigure(one), ringFigure(one))] : [];
  place.replaceChildren(
    make("h2", {}, swatch, `Cylinder ${one.id}`),
    ...figures,
    values,
    ...(one.evidence ? [make("h3", {}, "Evidence"), evidence] : []),
  );
  if (maps.length) drawRing(place.querySelector(".ring"), one);
}

/** Draw the unrolled residuals: round the cylinder from left to right, along its axis from bottom to top. */
function mapFigure(one) {
  const { columns, rows: count, reach, limit, zero, means } = maps[one.id];
  const cells = unpack(means, Int8Array);
  const canvas = make("canvas", { className: "map", width: columns, height: count, role: "img" });
  canvas.ariaLabel = `residuals of cylinder ${one.id} by angle and height`;
  const context = canvas.getContext("2d");
  const image = context.createImageData(columns, count);
  cells.forEach((cell, i) => {
    const place = 4 * ((count - 1 - Math.floor(i / columns)) * columns + (i % columns));
    if (cell !== -128) image.data.set([...diverging(cell / 127 * reach / limit), 255], place);
  });
  context.putImageData(image, 0, 0);
  const told = make("output", {}, `0° is towards ${zero}, the start below`);
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = [event.offsetX / canvas.clientWidth, event.offsetY / canvas.clientHeight];
    const [column, row] = [Math.floor(x * columns), count - 1 - Math.floor(y * count)];
    const cell = cells[row * columns + column];
    const value = cell === undefined || cell === -128 ? "no points" : number(cell / 127 * reach, 2);
    told.textContent = `${(360 * x - 180).toFixed(0)}°, height ${number((1 - y) * one.height, 3)}: ${value}`;
  });
  const scale = make("div", { className: "scale" }, number(-limit, 2), make("span", { className: "ramp" }), `+${number(limit, 2)}`);
  const ends = make("div", { className: "ends" }, ...["−180°", "0°", "180°"].map((text) => make("span", {}, text)));
  return make("figure", {}, make("figcaption", {}, "Mean residual, + is outside"), canvas, ends, scale, told);
}

function ringFigure(one) {
  const canvas = make("canvas", { className: "ring", role: "img" });
  canvas.ariaLabel = `${one.coverage_deg.toFixed(0)} of 360 degrees are covered`;
  return make("figure", {}, make("figcaption", {}, `Covered: ${one.coverage_deg.toFixed(0)}°`), canvas);
}

/** Draw which angles about the axis have points, angle 0 at the top. */
function drawRing(canvas, one) {
  const { columns, rows: count, zero, means } = maps[one.id];
  const cells = unpack(means, Int8Array);
  const size = 132;
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  Object.assign(canvas, { width: size * ratio, height: size * ratio });
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.lineWidth = 14;
  const ink = getComputedStyle(canvas).color;
  for (let column = 0; column < columns; column++) {
    const filledCells = Array.from({ length: count }, (_, row) => cells[row * columns + column]).filter((x) => x !== -128);
    const [from, to] = [column, column + 1].map((edge) => (edge / columns) * 2 * Math.PI + Math.PI / 2);
    context.beginPath();
    context.arc(size / 2, size / 2, size / 2 - 26, from, to + 0.01);
    context.strokeStyle = filledCells.length ? colorOf(one.id) : ink;
    context.globalAlpha = filledCells.length ? 0.35 + 0.65 * (filledCells.length / count) : 0.12;
    context.stroke();
  }
  Object.assign(context, { globalAlpha: 1, fillStyle: ink, font: "12px sans-serif", textAlign: "center" });
  context.fillText(zero, size / 2, 13);
}

// --- the sections

function tableOf(heads, lines) {
  const head = make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text)));
  const body = lines.map((line) => make("tr", {}, ...line.map((text) => make("td", {}, text))));
  return make("div", { className: "wide" }, make("table", {}, make("thead", {}, head), make("tbody", {}, ...body)));
}

function section(title, content, open = false) {
  byId("sections").append(make("details", { open }, make("summary", {}, title), content));
}

function makeSections() {
  const { input, stages, warnings } = result;
  if (warnings.length) section(`Warnings (${warnings.length})`, make("ul", {}, ...warnings.map((text) => make("li", {}, text))), true);
  section("Input", definitions([
    ["file", input.file],
    ["format", input.format],
    ["points", String(input.points)],
    ["properties", facts.fields.join(", ")],
    ["min", coordinates(input.bounds.min, 10)],
    ["max", coordinates(input.bounds.max, 10)],
    ["spacing, noise", `${number(result.scene.spacing)}, ${number(result.scene.noise)}`],
    ["sha256", input.sha256],
    ["method", result.method],
    ["cylx", result.cylx_version],
  ]));
  for (const table of facts.tables ?? []) section(table.title, tableOf(table.heads, table.lines), true);
  const reasons = (stage) => Object.entries(stage.rejected).map(([reason, count]) => `${reason} ${count}`).join(", ");
  section("Stages", tableOf(["stage", "considered", "kept", "rejected"],
    stages.map((stage) => [stage.name, String(stage.considered), String(stage.kept), reasons(stage)])));
  const blends = result.blends ?? [];
  if (blends.length) section(`Blends (${blends.length})`, tableOf(
    ["id", "radius", "height", "points", "coverage", "confidence", "side", "middle"],
    blends.map((one) => [String(one.id), uncertain(one.radius, one.uncertainty?.radius), number(one.height),
      String(one.inliers), `${one.coverage_deg.toFixed(0)}°`, fraction(one.confidence), one.side ?? "–",
      coordinates(one.axis_point, 5)])));
  if (result.runs) makeRuns();
  const some = facts.rejected.length < facts.rejected_count ? `the first ${facts.rejected.length} of ` : "";
  section(`Not accepted (${some}${facts.rejected_count})`, tableOf(
    ["reason", "radius", "height", "points", "coverage", "confidence", "middle"],
    facts.rejected.map((one) => [one.reason, number(one.radius), number(one.height), String(one.inliers),
      `${one.coverage_deg.toFixed(0)}°`, fraction(one.confidence), coordinates(one.axis_point, 5)])));
  section("Configuration", make("pre", {}, facts.config));
}

/** Show the runs, each of which can be shown alone, and the list of parts. */
function makeRuns() {
  const kinds = (run) => {
    const counts = new Map();
    for (const id of run.fittings) counts.set(result.fittings[id].kind, (counts.get(result.fittings[id].kind) ?? 0) + 1);
    return [...counts].map(([kind, count]) => `${count} ${kind}`).join(", ");
  };
  const sizes = (run) => run.sizes.map((size) => size.nominal ?? number(2 * size.radius)).join(", ");
  const ends = (run) => run.open_ends.map((one) => `${one.cylinder} ${one.reason.replaceAll("_", " ")}`).join(", ");
  const lines = result.runs.map((run) => [String(run.id), number(run.length), sizes(run), run.cylinders.join(" "), kinds(run), ends(run)]);
  const table = tableOf(["run", "length", "size", "cylinders", "fittings", "open ends"], lines);
  table.querySelectorAll("tbody tr").forEach((row, place) => {
    const cell = row.cells[0];
    const button = make("button", { className: "choose", ariaLabel: `show run ${place} alone` }, cell.textContent);
    button.addEventListener("click", () => showRun(result.runs[place]));
    cell.replaceChildren(button);
  });
  section(`Runs (${result.runs.length})`, table, true);
  section("Parts", tableOf(facts.parts.heads, facts.parts.lines));
}

/** Show the cylinders of one run and no others, and fly to the first. */
function showRun(run) {
  show(cylinders.map((one) => one.id), false);
  show(run.cylinders, true);
  select(run.cylinders[0], true);
}

// --- the view

function wire() {
  viewer.onPick = (id) => select(id);
  const controls = { points: "points", others: "others", cylinders: "tubes" };
  for (const [key, id] of Object.entries(controls))
    byId(id).addEventListener("change", (event) => {
      viewer.shown[key] = event.target.checked;
      viewer.paint();
    });
  byId("coloring").addEventListener("change", (event) => recolor(event.target.value));
  byId("noises").addEventListener("change", (event) => {
    viewer.shown.noises = Number(event.target.value);
    recolor(viewer.shown.coloring);
  });
  byId("dot").addEventListener("input", (event) => {
    viewer.shown.dot = 2 ** Number(event.target.value);
    viewer.ask();
  });
  byId("whole").addEventListener("click", () => {
    show(cylinders.map((one) => one.id), true);
    viewer.fly();
  });
}

function recolor(coloring) {
  viewer.shown.coloring = coloring;
  for (const id of ["legend", "reach"]) byId(id).hidden = coloring !== "residual";
  const limit = number(viewer.shown.noises * view.noise, 2);
  byId("low").textContent = `−${limit} inside`;
  byId("high").textContent = `+${limit} outside`;
  viewer.paint();
}

function openView() {
  try {
    viewer = new Viewer(byId("view"), view);
  } catch (failure) {
    byId("view").hidden = true;
    byId("controls").hidden = true;
    byId("no-view").hidden = false;
    document.body.dataset.view = String(failure.message);
    return;
  }
  if (!view.colors) byId("coloring").querySelector("[value=original]").remove();
  if (!view.runs) byId("coloring").querySelector("[value=run]").remove();
  wire();
}

function start() {
  const count = cylinders.length;
  const arcs = view.blends.length;
  const found = `${count} cylinder${count === 1 ? "" : "s"}` + (arcs ? ` and ${arcs} blend${arcs === 1 ? "" : "s"}` : "");
  document.title = `${result.input.file}: ${found}`;
  byId("name").textContent = result.input.file;
  const points = view.count < view.total ? `${view.count} of ${view.total} points shown` : `${view.total} points`;
  byId("counts").textContent = `${found}, ${points}`;
  if (facts.embedded) document.body.classList.add("embedded");
  makeHeads();
  sortBy(0);
  openView();
  if (!facts.embedded) makeSections();
  select(count ? 0 : -1);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", showDetails);
  if (location.hash === "#selftest") document.body.dataset.selftest = JSON.stringify(selftest());
}

// --- what the tests of cylx ask a browser, with #selftest behind the address

/** Use the page as somebody would, and tell what came of it. */
function selftest() {
  const told = { ready: performance.now(), rows: byId("rows").children.length, title: document.title, webgl: viewer !== null };
  sortBy(1);
  sortBy(1);
  told.radii = [...byId("rows").children].map((row) => cylinders[rows.indexOf(row)].radius);
  if (rows.length) {
    rows.at(-1).cells[2].click();
    told.selected = selected;
    told.heading = byId("details").querySelector("h2").textContent;
    told.map = byId("details").querySelector(".map")?.width;
  }
  if (viewer) Object.assign(told, tryView());
  sortBy(0);
  return told;
}

function tryView() {
  const told = { visible: viewer.visible };
  viewer.flight = null;
  const ids = cylinders.map((one) => one.id);
  told.picked = ids.map((id) => {
    viewer.camera.target = add(viewer.tubes[id].start, viewer.tubes[id].axis, 0.5);
    show(ids, false);
    show([id], true);
    return viewer.pick(0.5, 0.5);
  });
  show(ids, false);
  told.without = viewer.visible;
  show(ids, true);
  viewer.camera.target = view.home.center;
  recolor("residual");
  recolor("cylinder");
  const times = [1, 2, 3].map(() => {
    const begun = performance.now();
    viewer.draw();
    told.lit = litPixels(viewer.gl);
    return performance.now() - begun;
  });
  told.milliseconds = Math.min(...times);
  viewer.last = 0;
  told.shares = [600, 600, 600, 10, 10].map(shareAfter);
  Object.assign(viewer, { share: 1, moving: null, last: -Infinity });
  return told;
}

/** Give the share of the points that is drawn once a frame has taken so long while the view was dragged. */
function shareAfter(milliseconds) {
  const now = viewer.last + milliseconds;
  Object.assign(viewer, { stirred: true, moving: viewer.last + 1, wanted: viewer.last + 1 });
  viewer.frame(now);
  return viewer.share;
}

/** Count the pixels that are not background, right after drawing. */
function litPixels(gl) {
  const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let lit = 0;
  for (let i = 0; i < pixels.length; i += 4) lit += pixels[i] + pixels[i + 1] + pixels[i + 2] > 90;
  return lit;
}

start();
