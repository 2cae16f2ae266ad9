// The model in WebGL: one program for the surface and the scans' points, one for open borders.

const SURFACE_VERTEX = `#version 300 es
uniform mat4 uView; uniform mat4 uProjection; uniform float uPointSize; uniform highp int uMode;
uniform vec3 uStops[6]; uniform vec3 uSupport[6]; uniform vec3 uUnknown; uniform vec3 uBase; uniform highp sampler2D uScans;
in vec3 aPosition; in vec3 aNormal; in vec4 aColor; in vec2 aValue; in float aScan;
out vec3 vNormal; out vec3 vPlace; out vec3 vColor;
vec3 ramp(float share) {
  float place = clamp(share, 0.0, 1.0) * 5.0; int low = int(min(floor(place), 4.0));
  return mix(uStops[low], uStops[low + 1], place - float(low));
}
void main() {
  vec4 place = uView * vec4(aPosition * 2.0 - 1.0, 1.0);
  vPlace = place.xyz; vNormal = mat3(uView) * aNormal;
  vColor = uMode == 0 ? (aColor.a > 0.0 ? aColor.rgb : uBase)
    : uMode == 2 ? (aValue.x > 254.5 ? uUnknown : ramp(aValue.x / 254.0))
    : uSupport[int(clamp(aValue.y, 1.0, 6.0)) - 1];
  gl_Position = uProjection * place;
  if (uMode == 1) {
    vec4 scan = texelFetch(uScans, ivec2(int(aScan + 0.5), 0), 0);
    vColor = scan.rgb;
    gl_PointSize = max(1.5, uPointSize / gl_Position.w);
    if (scan.a < 0.5) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  }
}`;
const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
uniform highp int uMode; in vec3 vNormal; in vec3 vPlace; in vec3 vColor; out vec4 color;
void main() {
  if (uMode == 1) { vec2 off = gl_PointCoord - 0.5; if (dot(off, off) > 0.25) discard; }
  vec3 toEye = normalize(-vPlace), normal = normalize(vNormal);
  float facing = dot(normal, toEye);
  vec3 base = facing < 0.0 && uMode != 1 ? mix(vColor, vec3(0.36, 0.47, 0.72), uMode == 0 ? 0.75 : 0.35) : vColor;
  normal = facing < 0.0 ? -normal : normal;
  float key = max(dot(normal, normalize(vec3(-0.45, 0.6, 0.75))), 0.0);
  float light = 0.24 + 0.46 * key + 0.36 * abs(facing);
  float shine = uMode == 0 ? 0.12 * pow(max(dot(normal, normalize(vec3(-0.3, 0.5, 0.9))), 0.0), 24.0) : 0.0;
  color = vec4(min(base * light + shine, 1.0), 1.0);
}`;
const LINE_VERTEX = `#version 300 es
uniform mat4 uView; uniform mat4 uProjection; in vec3 aPosition;
void main() { gl_Position = uProjection * uView * vec4(aPosition * 2.0 - 1.0, 1.0); gl_Position.z -= 0.0008 * gl_Position.w; }`;
const LINE_FRAGMENT = `#version 300 es
precision mediump float; uniform vec3 uColor; out vec4 color; void main() { color = vec4(uColor, 1.0); }`;

const MODES = ["model", "scans", "residual", "support"];
const FIELD = 0.3;          // half the vertical field of view, in radians
const ROOM = 0.98;          // around the model's sphere
const STEP = 0.12;          // radians a key turns

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

function typedArrays(index, buffer) {
  const kinds = { uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int32: Int32Array };
  return Object.fromEntries(Object.entries(index).map(
    ([name, at]) => [name, new kinds[at.type](buffer, at.offset, at.length)]));
}

function running(differences) {
  const sums = new Uint32Array(differences.length);
  for (let k = 0, sum = 0; k < differences.length; k++) sums[k] = sum += differences[k];
  return sums;
}

// 4x4 matrices, column-major.
function product(a, b) {
  const c = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) c[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return c;
}

function turnedAbout(axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return axis === "x" ? new Float32Array([1, 0, 0, 0, 0, c, s, 0, 0, -s, c, 0, 0, 0, 0, 1])
    : new Float32Array([c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, 0, 0, 0, 1]);
}

function compiled(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  // The same places in both programs, so that they can share vertex arrays.
  ["aPosition", "aNormal", "aColor", "aValue", "aScan"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

function vertexArray(gl, attributes, indices) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  attributes.forEach((attribute, place) => {
    if (!attribute) return;
    const [data, size, type, normalised, stride] = attribute;
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, type, normalised, stride, 0);
  });
  if (indices) {
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
  }
  gl.bindVertexArray(null);
  return array;
}

class Viewer {
  constructor(canvas, scene, arrays) {
    this.canvas = canvas;
    this.scene = scene;
    const gl = this.gl = canvas.getContext("webgl2", { alpha: true, antialias: true, premultipliedAlpha: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.mode = 0;
    this.surface = compiled(gl, SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.line = compiled(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.upload(arrays);
    this.uploadScans();
    this.reset();
    this.listen();
    new ResizeObserver(() => this.request()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => location.reload());
  }

  upload(arrays) {
    const gl = this.gl;
    const faces = running(arrays.faces), borders = running(arrays.borders);
    const position = [arrays.position, 3, gl.UNSIGNED_SHORT, true, 6];
    this.counts = { faces: faces.length, borders: borders.length, points: (arrays.pointScan ?? []).length };
    this.mesh = vertexArray(gl, [position, [arrays.normal, 3, gl.BYTE, true, 4],
      arrays.color && [arrays.color, 4, gl.UNSIGNED_BYTE, true, 4],
      arrays.value && [arrays.value, 2, gl.UNSIGNED_BYTE, false, 4]], faces);
    this.borders = vertexArray(gl, [position], borders);
    this.points = this.counts.points && vertexArray(gl, [[arrays.pointPosition, 3, gl.UNSIGNED_SHORT, true, 6],
      [arrays.pointNormal, 3, gl.BYTE, true, 4], null, null, [arrays.pointScan, 1, gl.UNSIGNED_SHORT, false, 2]]);
  }

  uploadScans() {
    const gl = this.gl;
    this.shown = new Uint8Array(4 * Math.max(1, this.scene.scanColors.length));
    this.scene.scanColors.forEach((color, k) => this.shown.set([...color, 255], 4 * k));
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    this.sendScans();
  }

  sendScans() {
    const gl = this.gl;
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, this.shown.length / 4, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, this.shown);
    this.request();
  }

  showScan(number, isShown) { this.shown[4 * number + 3] = isShown ? 255 : 0; this.sendScans(); }

  setMode(name) { this.mode = MODES.indexOf(name); this.canvas.dataset.mode = name; this.request(); }

  reset() {
    const [r, u, f] = this.scene.basis;
    this.rotation = new Float32Array([r[0], u[0], f[0], 0, r[1], u[1], f[1], 0, r[2], u[2], f[2], 0, 0, 0, 0, 1]);
    this.zoom = 1;
    this.shift = [0, 0];
    this.request();
  }

  turn(right, down) {
    this.rotation = product(turnedAbout("y", right), product(turnedAbout("x", down), this.rotation));
    this.request();
  }

  scale(factor) { this.zoom = Math.min(12, Math.max(0.4, this.zoom * factor)); this.request(); }

  move(right, up) {
    this.shift = [this.shift[0] + right / this.zoom, this.shift[1] + up / this.zoom];
    this.request();
  }

  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.draw(); });
  }

  distance() {
    const aspect = this.canvas.clientWidth / this.canvas.clientHeight;
    return ROOM * this.scene.radius / Math.sin(Math.atan(Math.tan(FIELD) * Math.min(1, aspect)));
  }

  draw() {
    const gl = this.gl, canvas = this.canvas, dense = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * dense)), height = Math.max(1, Math.round(canvas.clientHeight * dense));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const away = this.distance(), focus = this.zoom / Math.tan(FIELD);
    const near = away - 1.1 * this.scene.radius, far = away + 1.1 * this.scene.radius;
    const view = new Float32Array(this.rotation);
    view.set([...this.shift, -away], 12);
    const projection = new Float32Array([focus * height / width, 0, 0, 0, 0, focus, 0, 0,
      0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    this.drawSurface(view, projection, this.scene.pointSize * focus * height / 2);
    if (this.mode === 3) this.drawBorders(view, projection);
    canvas.dataset.drawn = String(Number(canvas.dataset.drawn ?? 0) + 1);
  }

  matrices(program, view, projection) {
    const gl = this.gl;
    gl.useProgram(program);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "uView"), false, view);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "uProjection"), false, projection);
    return (name) => gl.getUniformLocation(program, name);
  }

  drawSurface(view, projection, pointSize) {
    const gl = this.gl, place = this.matrices(this.surface, view, projection);
    const colors = (list) => new Float32Array(list.flat().map((byte) => byte / 255));
    gl.uniform1i(place("uMode"), this.mode);
    gl.uniform1f(place("uPointSize"), pointSize);
    gl.uniform3fv(place("uStops"), colors(this.scene.residualStops));
    gl.uniform3fv(place("uSupport"), colors(this.scene.supportStops));
    gl.uniform3fv(place("uUnknown"), colors([this.scene.unknown]));
    gl.uniform3f(place("uBase"), 0.84, 0.83, 0.8);
    gl.vertexAttrib4f(2, 0, 0, 0, 0);
    if (this.mode === 1) {
      gl.bindVertexArray(this.points);
      gl.drawArrays(gl.POINTS, 0, this.counts.points);
    } else {
      gl.bindVertexArray(this.mesh);
      gl.drawElements(gl.TRIANGLES, this.counts.faces, gl.UNSIGNED_INT, 0);
    }
  }

  drawBorders(view, projection) {
    const gl = this.gl;
    const place = this.matrices(this.line, view, projection);
    gl.uniform3f(place("uColor"), ...this.scene.border.map((byte) => byte / 255));
    gl.bindVertexArray(this.borders);
    gl.drawElements(gl.LINES, this.counts.borders, gl.UNSIGNED_INT, 0);
  }

  listen() {
    const canvas = this.canvas, fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
      const unit = 2 / canvas.clientHeight * this.distance() * Math.tan(FIELD);
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const gap = (at) => Math.hypot(at.clientX - other.clientX, at.clientY - other.clientY) || 1;
        this.scale(gap(event) / gap(before));
        this.move(dx * unit / 2, -dy * unit / 2);
      } else if (event.buttons & 2 || event.shiftKey) this.move(dx * unit, -dy * unit);
      else this.turn(dx * 0.008, dy * 0.008);
      fingers.set(event.pointerId, event);
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.scale(Math.exp(-0.0012 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const actions = {
      ArrowLeft: () => this.turn(-STEP, 0), ArrowRight: () => this.turn(STEP, 0),
      ArrowUp: () => this.turn(0, -STEP), ArrowDown: () => this.turn(0, STEP),
      "+": () => this.scale(1.15), "=": () => this.scale(1.15), "-": () => this.scale(1 / 1.15), 0: () => this.reset(),
    };
    if (!(event.key in actions) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    actions[event.key]();
  }
}

async function startViewer() {
  const canvas = document.getElementById("view"), message = document.getElementById("view-message");
  message.textContent = "unpacking the model …";
  try {
    const scene = JSON.parse(document.getElementById("scene").textContent);
    const buffers = document.getElementById("buffers");
    const arrays = typedArrays(scene.arrays, await inflated(buffers.textContent.trim()));
    buffers.remove();
    const viewer = new Viewer(canvas, scene, arrays);
    connect(viewer);
    message.textContent = "";
  } catch (error) {
    message.textContent = `The model cannot be shown here (${error.message}); the pictures above show it.`;
  }
}

function connect(viewer) {
  const show = (mode) => {
    viewer.setMode(mode);
    for (const part of document.querySelectorAll(".legend > [data-mode]")) part.hidden = part.dataset.mode !== mode;
  };
  for (const input of document.querySelectorAll("input[name=mode]")) {
    if (input.checked) show(input.value);
    input.addEventListener("change", () => show(input.value));
  }
  document.getElementById("reset").addEventListener("click", () => viewer.reset());
  for (const chip of document.querySelectorAll("button[data-scan]"))
    chip.addEventListener("click", () => {
      const isShown = chip.getAttribute("aria-pressed") !== "true";
      chip.setAttribute("aria-pressed", String(isShown));
      viewer.showScan(Number(chip.dataset.scan), isShown);
    });
}
