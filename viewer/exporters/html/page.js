// The page: reads its data, draws when something changes, and connects the controls.
// ``window.viewer`` lets other scripts of the page move it.

const element = (id) => document.getElementById(id);

class Page {
  constructor(header, arrays) {
    Object.assign(this, { header, arrays, time: 0, isPlaying: false });
    this.canvas = element("view");
    this.camera = new Camera(header);
    this.start();
    this.camera.listen(this.canvas, () => this.change());
    new ResizeObserver(() => this.change()).observe(this.canvas);
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => { this.start(); this.change(); });
    this.connect();
    this.change();
  }

  // Makes everything on the graphics card.
  start() {
    const gl = this.canvas.getContext("webgl2", { alpha: false, antialias: true });
    if (!gl) throw new Error("this browser or graphics card has no WebGL 2");
    this.gl = gl;
    const programs = new Programs(gl, this.header.programs);
    this.stage = new Stage(gl, programs, this.header);
    const ramp = Float32Array.from(this.arrays[this.header.ramp].values);
    const { figures, samplers, studio } = this.header;
    this.figures = figures.map((data) => new Figure(gl, programs, data, this.arrays, ramp, samplers));
    if (studio) useStudio(gl, studio, this.arrays, samplers);
    this.end = Math.max(0, ...this.figures.map((figure) => figure.tracks.end));
    this.posedAt = null;
  }

  // Draws soon.
  change() {
    if (this.isAwaited) return;
    this.isAwaited = true;
    requestAnimationFrame((now) => { this.isAwaited = false; this.frame(now); });
  }

  frame(now) {
    if (this.isPlaying) {
      const passed = this.last === null ? 0 : (now - this.last) / 1000;
      this.last = now;
      this.advance(passed * Number(element("speed").value));
    }
    this.draw();
    if (this.isPlaying) this.change();
  }

  advance(seconds) {
    this.time += seconds;
    if (this.time <= this.end) return;
    if (element("loop").checked && this.end > 0) this.time %= this.end;
    else { this.time = this.end; this.play(false); }
  }

  play(starts) {
    if (this.end === 0) return;
    if (starts && this.time >= this.end) this.time = 0;
    this.isPlaying = starts;
    this.last = null;
    element("play").textContent = starts ? "\u275A\u275A" : "\u25B6";
    this.change();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.end);
    this.change();
  }

  pose() {
    if (this.posedAt === this.time) return;
    for (const figure of this.figures) figure.pose(this.time);
    this.posedAt = this.time;
    element("time").value = this.time;
    element("shown").textContent = `${this.time.toFixed(2)} / ${this.end.toFixed(2)} s`;
  }

  draw() {
    const gl = this.gl, canvas = this.canvas, ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (gl.isContextLost()) return;
    const size = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    this.camera.update(...size);
    this.pose();
    const shows = (id) => element(id).checked;
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.depthFunc(gl.LEQUAL);
    const casters = shows("surface") ? this.figures : [];
    const shadow = this.stage.drawMap(casters, this.camera);
    gl.viewport(0, 0, ...size);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.stage.drawBackground();
    const lights = { ...this.header.lights, ...shadow, u_up: this.camera.up,
      u_to_studio: this.camera.toStudio };
    if (shows("surface")) for (const each of this.figures) each.drawSurface(this.camera, lights, false);
    if (shows("wireframe")) for (const each of this.figures) each.drawEdges(this.camera);
    if (casters.length) this.stage.drawShadow(this.camera, shadow);
    if (shows("grid")) this.stage.drawGrid(this.camera);
    gl.depthMask(false);
    if (shows("surface")) for (const each of this.figures) each.drawSurface(this.camera, lights, true);
    gl.disable(gl.DEPTH_TEST);
    for (const each of this.figures)
      if (shows("skeleton") || !each.data.mesh) each.drawSkeleton(this.camera);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    canvas.classList.add("ready");
    element("poster")?.remove();
  }

  connect() {
    const change = () => this.change();
    for (const id of ["surface", "wireframe", "skeleton", "grid"])
      element(id).addEventListener("change", change);
    element("reset").addEventListener("click", () => { this.camera.reset(); change(); });
    for (const [index, { name }] of this.header.figures.entries())
      element("figure").append(new Option(name, index));
    element("figure").addEventListener("change", () => this.choose());
    element("visible").addEventListener("change", (event) => {
      this.chosen.isVisible = event.target.checked;
      change();
    });
    element("joint").addEventListener("change", (event) => {
      this.chosen.showWeights(Number(event.target.value));
      change();
    });
    this.choose();
    element("timeline").hidden = this.end === 0;
    element("time").max = this.end;
    element("time").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    element("play").addEventListener("click", () => this.play(!this.isPlaying));
    document.addEventListener("keydown", (event) => this.press(event));
  }

  get chosen() { return this.figures[Number(element("figure").value)]; }

  // Shows the joints and the visibility of the chosen figure.
  choose() {
    const { chosen } = this, list = element("joint");
    list.length = 1;
    if (chosen.isAttached)
      chosen.data.joints.names.forEach((name, joint) => list.append(new Option(name || `#${joint}`, joint)));
    list.value = chosen.joint;
    element("visible").checked = chosen.isVisible;
  }

  // Space plays; arrows step; letters switch the display; Home and End go to the ends.
  press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target instanceof HTMLSelectElement) return;
    const isButton = event.target instanceof HTMLButtonElement || event.target instanceof HTMLInputElement;
    const step = 1 / Math.max(...this.header.figures.map((each) => each.motion.rate));
    const toggle = (id) => { element(id).click(); };
    const actions = {
      ArrowLeft: () => this.seek(this.time - step), ArrowRight: () => this.seek(this.time + step),
      Home: () => this.seek(0), End: () => this.seek(this.end),
      w: () => toggle("wireframe"), s: () => toggle("skeleton"), g: () => toggle("grid"),
      f: () => { this.camera.reset(); this.change(); },
    };
    if (!isButton) actions[" "] = () => this.play(!this.isPlaying);
    if (!(event.key in actions)) return;
    event.preventDefault();
    actions[event.key]();
  }

  // Positions and unit normals of a figure's vertices at the current time, in its own space.
  vertices(index) {
    this.pose();
    return this.figures[index].posedVertices();
  }
}

async function begin() {
  const header = JSON.parse(element("header").textContent);
  const arrays = await unpackAll(header.items, element("data").textContent);
  element("data").remove();
  return new Page(header, arrays);
}

const ready = begin();
ready.catch((problem) => { element("message").textContent = `Not shown in 3D: ${problem.message}`; });
window.viewer = {
  ready,
  seek: (time) => ready.then((page) => page.seek(time)),
  play: (starts = true) => ready.then((page) => page.play(starts)),
  positions: (index = 0) => ready.then((page) => page.vertices(index).positions),
  normals: (index = 0) => ready.then((page) => page.vertices(index).normals),
};
