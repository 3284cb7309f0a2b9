// The page: reads its data, draws when something changes, and connects the controls.
// ``window.viewer`` lets other scripts of the page move it.

const element = (id) => document.getElementById(id);

class Page {
  constructor(header, arrays) {
    Object.assign(this, { header, arrays, time: 0, isPlaying: false, divider: 0.5, followed: null });
    this.canvas = element("view");
    this.camera = new Camera(header);
    this.start();
    this.camera.listen(this.canvas, () => this.change());
    new ResizeObserver(() => this.change()).observe(this.canvas);
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      element("message").textContent = "The graphics card was reset; the view returns when it is ready.";
    });
    this.canvas.addEventListener("webglcontextrestored", () => {
      element("message").textContent = "";
      this.start();
      this.change();
    });
    this.panels = new Panels(this);
    if (header.wipes) this.figures.forEach((each, i) => this.setSide(each, i ? "right" : "left"));
    this.panels.choose();
    this.panels.readAddress();
    element("panels").hidden = false;
    this.messages = new Messages(this);
    this.change();
  }

  // Makes everything on the graphics card; figures that were shown before keep their state.
  start() {
    const gl = this.canvas.getContext("webgl2", { alpha: false, antialias: true });
    if (!gl) throw new Error("this browser or graphics card has no WebGL 2");
    this.gl = gl;
    const programs = new Programs(gl, this.header.programs), before = this.figures || [];
    this.stage = new Stage(gl, programs, this.header);
    const ramp = Float32Array.from(this.arrays[this.header.ramp].values);
    const { figures, samplers, studio } = this.header;
    this.figures = figures.map((data, i) =>
      new Figure(gl, programs, data, this.arrays, ramp, samplers, before[i]));
    if (studio) useStudio(gl, studio, this.arrays, samplers);
    this.end = Math.max(0, ...this.figures.map((figure) => figure.tracks.end));
    if (this.followed) this.followed = this.figures[before.indexOf(this.followed)];
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
    this.pose();
    const unsorted = this.figures.filter((each) => each.isUnsorted);
    if (unsorted.length)
      this.drawn = Promise.all(unsorted.map((each) => each.readRows())).then(() => this.draw());
    else this.draw();
  }

  advance(seconds) {
    this.time += seconds;
    if (this.time <= this.end) return;
    if (element("loop").checked && this.end > 0) this.time %= this.end;
    else { this.time = this.end; this.play(false); }
  }

  play(starts) {
    if (this.end === 0) return;
    if (starts) this.release();
    if (starts && this.time >= this.end) this.time = 0;
    this.isPlaying = starts;
    this.last = null;
    element("play").textContent = starts ? "\u275A\u275A" : "\u25B6";
    this.change();
  }

  release() {
    for (const { tracks } of this.figures) tracks.held = null;
    this.repose();
  }

  // Moves to a time; poses that were set from outside end.
  seek(time) {
    this.release();
    this.time = Math.min(Math.max(time, 0), this.end);
  }

  // Poses again, for changed joints.
  repose() {
    this.posedAt = null;
    this.change();
  }

  pose() {
    if (this.posedAt === this.time) return;
    for (const figure of this.figures) figure.pose(this.time);
    this.posedAt = this.time;
    this.panels.update();
    if (!this.followed) return;
    const place = this.followed.place;
    this.camera.target = this.camera.target.map((x, i) => x + place[i] - this.followedAt[i]);
    this.followedAt = place;
  }

  // Keeps the camera at a figure; null for a camera that stays.
  follow(figure) {
    this.pose();  // the address of the page may ask for it before anything is drawn
    this.followed = figure;
    if (figure) this.followedAt = figure.place;
    this.change();
  }

  // Shows a figure on one side of the divider, or on both.
  setSide(figure, side) {
    figure.side = side;
    const first = (which) => this.figures.find((each) => each.side === which);
    const [left, right] = [first("left"), first("right")];
    // Figures on the right stand where the first one on the left stands.
    const shift = left && right
      ? [12, 13, 14].map((i) => left.data.placement[i] - right.data.placement[i]) : [0, 0, 0];
    for (const each of this.figures) each.shift = each.side === "right" ? shift : [0, 0, 0];
    this.panels.showDivider();
    this.change();
  }

  get isDivided() { return this.figures.some((each) => each.side !== "both"); }

  draw() {
    const gl = this.gl, canvas = this.canvas, ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (gl.isContextLost()) return;
    const size = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    this.camera.update(...size);
    const edge = Math.round(this.divider * size[0]);
    const parts = this.isDivided ? [["left", 0, edge], ["right", edge, size[0]]] : [["both", 0, size[0]]];
    for (const [side, from, to] of parts) {
      if (to === from) continue;
      const shown = this.figures.filter((each) => each.side === side || each.side === "both");
      this.drawPart(shown, size, from, to);
    }
    canvas.classList.add("ready");
    element("poster")?.remove();
    this.messages.send();
    if (this.isPlaying) this.change();
  }

  // Draws some figures in the columns of the image from one to another.
  drawPart(figures, size, from, to) {
    const gl = this.gl, shows = (id) => element(id).checked;
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.depthFunc(gl.LEQUAL);
    const casters = shows("surface") ? figures : [];
    const shadow = this.stage.drawMap(casters, this.camera);
    gl.viewport(0, 0, ...size);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(from, 0, to - from, size[1]);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.stage.drawBackground();
    const lights = { ...this.header.lights, ...shadow, u_up: this.camera.up,
      u_to_studio: this.camera.toStudio };
    if (shows("surface")) for (const each of figures) each.drawSurface(this.camera, lights, false);
    if (shows("wireframe")) for (const each of figures) each.drawEdges(this.camera);
    if (casters.length) this.stage.drawShadow(this.camera, shadow);
    if (shows("grid")) this.stage.drawGrid(this.camera);
    gl.depthMask(false);
    if (shows("surface")) for (const each of figures) each.drawSurface(this.camera, lights, true);
    gl.disable(gl.DEPTH_TEST);
    for (const each of figures)
      if (shows("skeleton") || !each.data.mesh) each.drawSkeleton(this.camera);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
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
  positions: async (index = 0) => (await (await ready).vertices(index)).positions,
  normals: async (index = 0) => (await (await ready).vertices(index)).normals,
};
