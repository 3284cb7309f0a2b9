// The controls around the view: display, sliders of joints, the divider, timeline and keys.

class Panels {
  constructor(page) {
    this.page = page;
    const change = () => page.change();
    for (const id of ["surface", "wireframe", "skeleton", "grid"])
      element(id).addEventListener("change", change);
    element("reset").addEventListener("click", () => { page.camera.reset(); change(); });
    for (const [index, { name }] of page.header.figures.entries())
      element("figure").append(new Option(name, index));
    element("figure").addEventListener("change", () => this.choose());
    const listen = (id, action) => element(id).addEventListener("change", (event) => {
      action(event.target);
      change();
    });
    listen("visible", ({ checked }) => { this.chosen.isVisible = checked; });
    listen("joint", ({ value }) => this.chosen.showWeights(Number(value)));
    listen("follow", ({ checked }) => page.follow(checked ? this.chosen : null));
    listen("side", ({ value }) => page.setSide(this.chosen, value));
    this.connectJoints();
    this.connectDivider();
    this.connectTimeline();
    element("side").parentElement.hidden = page.figures.length < 2;
    this.choose();
    document.addEventListener("keydown", (event) => this.press(event));
  }

  get chosen() { return this.page.figures[Number(element("figure").value)]; }

  // Shows the joints and the visibility of the chosen figure.
  choose() {
    const { chosen } = this, list = element("joint"), bent = element("bent");
    const title = (joint) => chosen.data.joints.names[joint] || `#${joint}`;
    list.length = 1;
    if (chosen.isAttached)
      chosen.data.joints.names.forEach((_, joint) => list.append(new Option(title(joint), joint)));
    list.value = chosen.joint;
    element("visible").checked = chosen.isVisible;
    element("side").value = chosen.side;
    element("follow").checked = this.page.followed === chosen;
    const { edits } = chosen.tracks;
    element("joints").hidden = !edits;
    bent.length = 0;
    for (const joint of new Set(edits?.dofs.joints)) bent.append(new Option(title(joint), joint));
    this.showDofs();
  }

  // Chooses a figure, and shows the weights of a joint, or its materials for -1.
  select(figure, joint = -1) {
    if (!this.page.figures[figure]) return;
    element("figure").value = figure;
    const count = this.chosen.data.joints?.names.length || 0;
    this.chosen.showWeights(Number.isInteger(joint) && joint < count ? joint : -1);
    this.choose();
  }

  connectJoints() {
    element("bent").addEventListener("change", () => this.showDofs());
    element("joints").addEventListener("toggle", () => this.update());
    element("unbend").addEventListener("click", () => {
      this.chosen.tracks.edits.reset();
      this.page.repose();
    });
  }

  // Makes a slider for each DOF of the chosen joint, in degrees.
  showDofs() {
    const { edits } = this.chosen.tracks, place = element("dofs");
    place.replaceChildren();
    this.sliders = [];
    if (!edits) return;
    for (const dof of edits.rowsOf(Number(element("bent").value))) {
      const label = document.createElement("label"), slider = document.createElement("input");
      const shown = document.createElement("output"), [low, high] = edits.dofs.limits[dof];
      Object.assign(slider, { type: "range", min: low / RADIANS, max: high / RADIANS, step: "any" });
      slider.addEventListener("input", () => {
        edits.set(dof, Number(slider.value) * RADIANS);
        this.page.repose();
      });
      label.append("xyz"[edits.dofs.axes[dof]], " ", slider, shown);
      place.append(label);
      this.sliders.push({ dof, slider, shown });
    }
    this.update();
  }

  // Shows the time, and the angles of the chosen joint.
  update() {
    const { time, end } = this.page, { edits } = this.chosen.tracks;
    element("time").value = time;
    element("shown").textContent = `${time.toFixed(2)} / ${end.toFixed(2)} s`;
    if (!edits?.worlds || !element("joints").open) return;
    for (const { dof, slider, shown } of this.sliders) {
      const angle = edits.shown(dof) / RADIANS;
      slider.value = angle;
      shown.textContent = `${angle.toFixed(1)}\u00B0`;
    }
  }

  connectDivider() {
    const divider = element("divider"), move = (part) => {
      this.page.divider = Math.min(Math.max(part, 0), 1);
      this.showDivider();
      this.page.change();
    };
    divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
    divider.addEventListener("pointermove", (event) => {
      const { left, width } = this.page.canvas.getBoundingClientRect();
      if (divider.hasPointerCapture(event.pointerId)) move((event.clientX - left) / width);
    });
    divider.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      move(this.page.divider + step);
    });
  }

  // Shows the divider, and the names of the figures that are only on one side.
  showDivider() {
    const { divider, figures, isDivided } = this.page;
    element("divider").hidden = !isDivided;
    element("divider").style.left = `${100 * divider}%`;
    element("divider").setAttribute("aria-valuenow", Math.round(100 * divider));
    for (const [side, part] of [["left", divider], ["right", 1 - divider]]) {
      element(side).textContent = figures.filter((each) => each.side === side)
        .map((each) => each.data.name).join(", ");
      element(side).style.maxWidth = `calc(${100 * part}vw - 16px)`;
    }
  }

  connectTimeline() {
    const { page } = this;
    element("timeline").hidden = page.end === 0;
    element("time").max = page.end;
    element("time").addEventListener("input", (event) => page.seek(Number(event.target.value)));
    element("play").addEventListener("click", () => page.play(!page.isPlaying));
  }

  // Space plays; arrows step; letters switch the display; Home and End go to the ends.
  press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target instanceof HTMLSelectElement) return;
    const { page } = this, isInput = event.target instanceof HTMLInputElement;
    const isButton = event.target instanceof HTMLButtonElement || isInput || event.target.tagName === "SUMMARY";
    const step = 1 / Math.max(...page.header.figures.map((each) => each.motion.rate));
    const toggle = (id) => { element(id).click(); };
    const actions = {
      w: () => toggle("wireframe"), s: () => toggle("skeleton"), g: () => toggle("grid"),
      c: () => toggle("follow"), f: () => { page.camera.reset(); page.change(); },
    };
    // Arrows move the slider of a joint.
    if (!isInput || event.target.id === "time") Object.assign(actions, {
      ArrowLeft: () => page.seek(page.time - step), ArrowRight: () => page.seek(page.time + step),
      Home: () => page.seek(0), End: () => page.seek(page.end),
    });
    if (!isButton) actions[" "] = () => page.play(!page.isPlaying);
    if (!(event.key in actions)) return;
    event.preventDefault();
    actions[event.key]();
  }

  // Settings in the address, such as walk.html#bare&play&time=1.5, for pages that show this one.
  readAddress() {
    const asked = new URLSearchParams(window.location.hash.slice(1)), { page } = this;
    document.body.classList.toggle("bare", asked.has("bare"));
    for (const id of ["wireframe", "skeleton", "follow"])
      if (asked.has(id) && !element(id).checked) element(id).click();
    const time = Number(asked.get("time"));
    if (asked.has("time") && Number.isFinite(time)) page.seek(time);
    if (asked.has("play")) page.play(true);
  }
}
