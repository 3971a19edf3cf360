// The view in 3-D: points and cylinders in plain WebGL, a camera that goes round them, and what lies under the pointer.
"use strict";

// --- numbers from the page

/** Read base64 as an array of numbers of a kind (little endian, as every machine with a browser is). */
function unpack(text, Kind) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Kind(bytes.buffer);
}

const DIVERGING = [[33, 102, 172], [103, 169, 207], [245, 245, 245], [239, 138, 98], [190, 30, 45]];

/** Give the colour of -1 (blue, inside) to 1 (red, outside); further values are as the ends. */
function diverging(value) {
  const place = (Math.min(1, Math.max(-1, value)) + 1) * 2;
  const left = Math.min(3, Math.floor(place));
  return DIVERGING[left].map((part, i) => part + (place - left) * (DIVERGING[left + 1][i] - part));
}

// --- vectors (arrays of 3) and matrices (arrays of 16, column by column)

const add = (a, b, scale = 1) => a.map((x, i) => x + scale * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / (Math.hypot(...a) || 1));

function product(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return out;
}

function perspective(tangent, aspect, near, far) {
  const depth = near - far;
  return [1 / (tangent * aspect), 0, 0, 0, 0, 1 / tangent, 0, 0, 0, 0, (far + near) / depth, -1,
    0, 0, 2 * far * near / depth, 0];
}

/** Give where the pointer's ray first meets a cylinder without caps, as a multiple of `ray`; Infinity if nowhere. */
function meeting(eye, ray, start, end, radius) {
  const axis = add(end, start, -1);
  const height = Math.hypot(...axis);
  const along = unit(axis);
  const offset = add(eye, start, -1);
  const across = add(ray, along, -dot(ray, along)); // both without their part along the axis
  const aside = add(offset, along, -dot(offset, along));
  const [a, b, c] = [dot(across, across), dot(across, aside), dot(aside, aside) - radius * radius];
  const root = Math.sqrt(b * b - a * c);
  for (const t of [(-b - root) / a, (-b + root) / a]) {
    const level = dot(offset, along) + t * dot(ray, along);
    if (t > 0 && level >= 0 && level <= height) return t;
  }
  return Infinity;
}

// --- shaders

const POINT_VERTEX = `
attribute vec3 place; attribute vec4 color;
uniform mat4 matrix; uniform vec3 size; uniform vec2 depth; uniform float dotSize, pixels, least;
varying vec3 shade;
void main() {
  gl_Position = color.a == 0.0 ? vec4(2.0, 2.0, 2.0, 1.0) : matrix * vec4((place - 0.5) * size, 1.0);
  gl_PointSize = clamp(dotSize * pixels / gl_Position.w, least, 30.0);
  shade = color.rgb * mix(1.0, 0.45, clamp((gl_Position.w - depth.x) / depth.y, 0.0, 1.0));
}`;
const POINT_FRAGMENT = `
precision mediump float;
varying vec3 shade;
void main() {
  if (length(gl_PointCoord - 0.5) > 0.5) discard;
  gl_FragColor = vec4(shade, 1.0);
}`;
const TUBE_VERTEX = `
attribute vec3 corner;
uniform mat4 matrix; uniform vec3 start, axis, across, along, toEye;
varying float light;
void main() {
  vec3 out_ = corner.x * across + corner.y * along;
  gl_Position = matrix * vec4(start + corner.z * axis + out_, 1.0);
  light = 0.6 + 0.4 * abs(dot(normalize(out_), toEye));
}`;
const TUBE_FRAGMENT = `
precision mediump float;
uniform vec4 tint; varying float light;
void main() { gl_FragColor = vec4(tint.rgb * light, tint.a); }`;

const AROUND = 40;
const MUTED = [0.5, 0.5, 0.5]; // of blends, which are not among the cylinders

/** Give the strip of triangles round a tube of radius and height 1, and behind it its two rims. */
function tubeCorners() {
  const corner = (i, level) => [Math.cos(2 * Math.PI * i / AROUND), Math.sin(2 * Math.PI * i / AROUND), level];
  const steps = Array.from({ length: AROUND + 1 }, (_, i) => i);
  const strip = steps.flatMap((i) => [...corner(i, 0), ...corner(i, 1)]);
  const rims = [0, 1].flatMap((level) => steps.slice(1).flatMap((i) => corner(i, level)));
  return new Float32Array([...strip, ...rims]);
}

function compile(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error(gl.getProgramInfoLog(program));
  const names = { program };
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(program, i);
    names[name] = gl.getUniformLocation(program, name);
  }
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES); i++) {
    const { name } = gl.getActiveAttrib(program, i);
    names[name] = gl.getAttribLocation(program, name);
  }
  return names;
}

function filled(gl, data) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  return buffer;
}

// --- the viewer

const BACKGROUND = [0.07, 0.085, 0.11];
const OTHERS = [128, 128, 128];
const HOME_ANGLES = { yaw: -Math.PI / 3, pitch: 0.45 };
const TANGENT = Math.tan(Math.PI / 8); // of half the angle of view
const ROOM = 1.02; // the ball that is looked at first is larger than what is in it
const SLOW = 70; // milliseconds a frame, from which on fewer points are drawn while something moves

class Viewer {
  /** @param canvas where to draw; @param view what: see `cylx/report/page_data.py`. */
  constructor(canvas, view) {
    this.canvas = canvas;
    this.view = view;
    this.gl = canvas.getContext("webgl", { antialias: true });
    if (!this.gl) throw new Error("no WebGL");
    this.count = view.count;
    this.places = new Uint16Array(4 * view.count); // four a point: cards like rows of eight bytes
    const packed = unpack(view.points, Uint16Array);
    for (let i = 0; i < view.count; i++) this.places.set(packed.subarray(3 * i, 3 * i + 3), 4 * i);
    this.labels = unpack(view.labels, view.label_bytes === 1 ? Uint8Array : Uint16Array);
    this.none = view.label_bytes === 1 ? 255 : 65535;
    this.residuals = unpack(view.residuals, Int8Array);
    this.original = view.colors && unpack(view.colors, Uint8Array);
    this.palette = unpack(view.palette, Uint8Array);
    this.tubes = view.cylinders.map((numbers) => this.tube(numbers));
    this.blends = view.blends.map((numbers) => this.tube(numbers));
    this.runs = view.runs;
    this.fittings = view.fittings.map(([cylinder, ...numbers]) => ({ cylinder, tube: this.tube(numbers) }));
    this.shown = { coloring: "cylinder", points: true, others: true, cylinders: true, noises: 4, dot: 1 };
    this.hidden = new Set();
    this.selected = -1;
    this.share = 1;
    this.last = -Infinity;
    this.onPick = () => {};
    this.camera = { ...HOME_ANGLES, target: view.home.center, distance: view.home.radius / TANGENT * ROOM };
    this.build();
    this.listen();
  }

  tube([a, b, c, d, e, f, radius]) {
    const [start, end] = [[a, b, c], [d, e, f]];
    const axis = add(end, start, -1);
    const direction = unit(axis);
    const least = direction.map(Math.abs).indexOf(Math.min(...direction.map(Math.abs)));
    const across = unit(cross(direction, [0, 1, 2].map((i) => (i === least ? 1 : 0))));
    const scaled = (vector) => vector.map((x) => x * radius);
    return { start, end, axis, radius, across: scaled(across), along: scaled(cross(direction, across)) };
  }

  /** Bring everything to the graphics card; also after it was lost. */
  build() {
    const gl = this.gl;
    this.points = compile(gl, POINT_VERTEX, POINT_FRAGMENT);
    this.tubeProgram = compile(gl, TUBE_VERTEX, TUBE_FRAGMENT);
    this.placeBuffer = filled(gl, this.places);
    this.tubeBuffer = filled(gl, tubeCorners());
    this.colorBuffer = gl.createBuffer();
    this.paint();
  }

  /** Give every point its colour; those that are not shown have no opacity. */
  paint() {
    const { coloring, points, others, noises } = this.shown;
    const colors = new Uint8Array(4 * this.count);
    const scale = this.view.noises / (127 * noises);
    const place = coloring === "run" ? this.runs : null; // points of one run have one colour
    const table = Array.from({ length: 256 }, (_, i) => diverging((i - 128) * scale));
    const hidden = Uint8Array.from({ length: this.tubes.length }, (_, i) => (this.hidden.has(i) ? 1 : 0));
    let visible = 0;
    for (let i = 0; i < this.count; i++) {
      const label = this.labels[i];
      if (label === this.none ? !others : !points || hidden[label]) continue;
      visible += 1;
      let [from, at] = [OTHERS, 0];
      if (coloring === "original" && this.original) [from, at] = [this.original, 3 * i];
      else if (label !== this.none && coloring === "residual") from = table[this.residuals[i] + 128];
      else if (label !== this.none) [from, at] = [this.palette, 3 * (place ? place[label] : label)];
      for (let k = 0; k < 3; k++) colors[4 * i + k] = from[at + k];
      colors[4 * i + 3] = 255;
    }
    this.visible = visible;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.colorBuffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, colors, this.gl.DYNAMIC_DRAW);
    this.ask();
  }

  // --- the camera

  /** Give the camera's axes: to the right, up, and from the target to the eye. */
  axes() {
    const { yaw, pitch } = this.camera;
    const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const right = [-Math.sin(yaw), Math.cos(yaw), 0];
    return { right, up: cross(back, right), back };
  }

  eye() {
    return add(this.camera.target, this.axes().back, this.camera.distance);
  }

  matrix() {
    const { right, up, back } = this.axes();
    const eye = this.eye();
    const look = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const far = this.camera.distance + Math.hypot(...this.view.size, ...this.camera.target) * 1.5;
    const near = Math.max(this.camera.distance / 100, far / 1e5);
    return product(perspective(this.tangent(), this.aspect(), near, far), look);
  }

  aspect() {
    return this.canvas.width / Math.max(1, this.canvas.height);
  }

  /** Give the tangent of half the angle of view from bottom to top; on a narrow canvas the width counts. */
  tangent() {
    return TANGENT / Math.min(1, this.aspect());
  }

  rotate(x, y) {
    this.camera.yaw -= x;
    this.camera.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.camera.pitch + y));
    this.move();
  }

  /** Shift the target by parts of the height of the view. */
  pan(x, y) {
    const { right, up } = this.axes();
    const reach = 2 * this.tangent() * this.camera.distance;
    this.camera.target = add(add(this.camera.target, right, -x * reach), up, y * reach);
    this.move();
  }

  zoom(factor) {
    const { radius } = this.view.home;
    this.camera.distance = Math.min(50 * radius, Math.max(1e-4 * radius, this.camera.distance * factor));
    this.move();
  }

  move() {
    this.flight = null;
    this.stirred = true;
    this.moving = performance.now();
    this.ask();
  }

  /** Go to a cylinder, or home without a number, in a third of a second. */
  fly(number = -1) {
    const tube = this.tubes[number];
    const { center, radius } = this.view.home;
    const to = tube
      ? { target: add(tube.start, tube.axis, 0.5), distance: (Math.hypot(...tube.axis) / 2 + tube.radius) / TANGENT * 1.5 }
      : { target: center, distance: radius / TANGENT * ROOM, ...HOME_ANGLES };
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.flight = { from: { ...this.camera }, to, begun: performance.now(), lasts: still ? 1 : 350 };
    this.ask();
  }

  advance(now) {
    const { from, to, begun, lasts } = this.flight;
    const part = Math.min(1, Math.max(0, (now - begun) / lasts));
    const eased = part * part * (3 - 2 * part);
    for (const key of Object.keys(to))
      this.camera[key] = key === "target"
        ? add(from.target, add(to.target, from.target, -1), eased)
        : from[key] + eased * (to[key] - from[key]);
    this.moving = now;
    if (part === 1) this.flight = null;
  }

  // --- drawing

  /** Draw soon, once. */
  ask() {
    if (this.asked) return;
    this.wanted = performance.now();
    this.asked = requestAnimationFrame((now) => {
      this.asked = null;
      this.frame(now);
    });
  }

  /** Draw; while something moves on a slow machine, only some of the points, and all of them when it rests. */
  frame(now) {
    if (this.flight) this.advance(now);
    const resting = !this.flight && !this.stirred && now - (this.moving ?? 0) > 200; // a frame may take longer than that
    this.stirred = false;
    const took = now - this.last;
    if (!resting && this.wanted - this.last < 200) { // otherwise nothing was to be drawn since
      if (took > SLOW) this.share = Math.max(1 / 16, this.share * Math.min(1 / 2, SLOW / took));
      else if (took < SLOW / 3) this.share = Math.min(1, this.share * 1.2);
    }
    this.last = now;
    this.draw(resting ? 1 : this.share);
    if (this.flight || (!resting && this.share < 1)) this.ask();
  }

  draw(share = 1) {
    const { gl, canvas } = this;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(...BACKGROUND, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const matrix = this.matrix();
    this.drawPoints(matrix, Math.ceil(this.count * share), ratio);
    if (this.shown.cylinders) this.drawTubes(matrix);
  }

  drawPoints(matrix, count, ratio) {
    const { gl, points: names } = this;
    gl.useProgram(names.program);
    gl.disable(gl.BLEND);
    gl.uniformMatrix4fv(names.matrix, false, matrix);
    gl.uniform3fv(names.size, this.view.size);
    const { radius } = this.view.home; // what is far is darker; colours that mean a number are as they are
    const length = this.shown.coloring === "residual" ? Infinity : 2 * radius;
    gl.uniform2f(names.depth, Math.max(0, this.camera.distance - radius), Math.min(length, 1e30));
    gl.uniform1f(names.dotSize, this.view.spacing * 0.7 * this.shown.dot);
    gl.uniform1f(names.pixels, this.canvas.height / (2 * this.tangent()));
    gl.uniform1f(names.least, 1.5 * ratio * Math.sqrt(this.shown.dot));
    gl.bindBuffer(gl.ARRAY_BUFFER, this.placeBuffer);
    gl.enableVertexAttribArray(names.place);
    gl.vertexAttribPointer(names.place, 3, gl.UNSIGNED_SHORT, true, 8, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.colorBuffer);
    gl.enableVertexAttribArray(names.color);
    gl.vertexAttribPointer(names.color, 4, gl.UNSIGNED_BYTE, true, 4, 0);
    gl.drawArrays(gl.POINTS, 0, count);
    gl.disableVertexAttribArray(names.place);
    gl.disableVertexAttribArray(names.color);
  }

  drawTubes(matrix) {
    const { gl, tubeProgram: names } = this;
    gl.useProgram(names.program);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.uniformMatrix4fv(names.matrix, false, matrix);
    gl.uniform3fv(names.toEye, this.axes().back);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.tubeBuffer);
    gl.enableVertexAttribArray(names.corner);
    gl.vertexAttribPointer(names.corner, 3, gl.FLOAT, false, 0, 0);
    const byRun = this.shown.coloring === "run" && this.runs;
    const colorOf = (number) => {
      const place = 3 * (byRun ? this.runs[number] : number);
      return Array.from(this.palette.subarray(place, place + 3), (part) => part / 255);
    };
    this.tubes.forEach((tube, number) => {
      if (!this.hidden.has(number)) this.drawTube(names, tube, colorOf(number), number === this.selected);
    });
    for (const { cylinder, tube } of this.fittings)
      if (!this.hidden.has(cylinder)) this.drawTube(names, tube, byRun ? colorOf(cylinder) : MUTED, false);
    this.blends.forEach((tube) => this.drawTube(names, tube, MUTED, false));
    gl.disableVertexAttribArray(names.corner);
    gl.depthMask(true);
  }

  drawTube(names, tube, color, chosen) {
    const { gl } = this;
    for (const key of ["start", "axis", "across", "along"]) gl.uniform3fv(names[key], tube[key]);
    gl.uniform4f(names.tint, ...color, chosen ? 0.55 : 0.28);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 2 * (AROUND + 1));
    gl.uniform4f(names.tint, ...(chosen ? [1, 1, 1] : color), 1);
    for (const rim of [0, 1]) gl.drawArrays(gl.LINE_LOOP, 2 * (AROUND + 1) + rim * AROUND, AROUND);
  }

  // --- what is under the pointer

  /** Give the cylinder at a place of the canvas (0 to 1 from the left and the top), -1 for none. */
  pick(x, y) {
    if (!this.shown.cylinders) return -1;
    const { right, up, back } = this.axes();
    const tangent = this.tangent();
    const ray = add(add(back.map((part) => -part), right, (2 * x - 1) * tangent * this.aspect()), up, (1 - 2 * y) * tangent);
    let [nearest, found] = [Infinity, -1];
    this.tubes.forEach(({ start, end, radius }, number) => {
      const distance = this.hidden.has(number) ? Infinity : meeting(this.eye(), ray, start, end, radius);
      if (distance < nearest) [nearest, found] = [distance, number];
    });
    return found;
  }

  listen() {
    const { canvas } = this;
    new ResizeObserver(() => this.ask()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.build());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      if (document.body.classList.contains("embedded") && document.activeElement !== canvas) return; // it scrolls the notebook
      event.preventDefault();
      this.zoom(Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY * (event.deltaMode ? 0.05 : 0.0015)))));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.listenToPointers(new Map());
  }

  listenToPointers(down) {
    const { canvas } = this;
    let travelled = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      travelled = down.size ? Infinity : 0; // a second finger is no click
      down.set(event.pointerId, event);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      travelled += Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY);
      this.drag(before, event, [...down.values()].find((other) => other.pointerId !== event.pointerId));
      down.set(event.pointerId, event);
    });
    const release = (event) => {
      if (down.delete(event.pointerId) && event.type === "pointerup" && travelled < 6) {
        const box = canvas.getBoundingClientRect();
        this.onPick(this.pick((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height));
      }
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
  }

  /** Follow a pointer: one turns, with Shift or another button it shifts, two fingers shift and zoom. */
  drag(before, event, other) {
    const height = this.canvas.clientHeight;
    const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (other) {
      const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      this.zoom(Math.max(1, apart(before)) / Math.max(1, apart(event)));
      this.pan(x / height / 2, y / height / 2);
    } else if (event.shiftKey || event.buttons & 6) this.pan(x / height, y / height);
    else this.rotate(x * 0.008, y * 0.008);
  }

  key(event) {
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
    const factor = { "+": 0.85, "=": 0.85, "-": 1.18 }[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (x || y) event.shiftKey ? this.pan(-x * 0.05, -y * 0.05) : this.rotate(-x * 0.1, -y * 0.1);
    else if (factor) this.zoom(factor);
    else if (event.key === "Home" || event.key === "0") this.fly();
    else return;
    event.preventDefault();
  }
}
