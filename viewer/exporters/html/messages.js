// Messages of a page that shows this one in a frame: it sets time, camera, selection and poses, and
// is told when they change. Only numbers are read.

class Messages {
  constructor(page) {
    this.page = page;
    if (window.parent === window) return;
    window.addEventListener("message", ({ source, data }) => {
      if (source === window.parent && data && typeof data.viewer === "object") this.receive(data.viewer);
    });
  }

  receive({ time, camera, selection, poses }) {
    const { page } = this;
    if (Number.isFinite(time) && time !== page.time) page.seek(time);
    if (camera) page.camera.place(camera, page.canvas.clientWidth / page.canvas.clientHeight);
    if (Array.isArray(selection)) page.panels.select(...selection);
    for (const [index, values] of Object.entries(poses || {}))
      page.figures[index]?.tracks.hold(values);
    page.repose();
  }

  // Tells the outer page what has changed.
  send() {
    const { page } = this, { azimuth, inclination, distance, target } = page.camera;
    if (window.parent === window) return;
    const figure = page.figures.indexOf(page.panels.chosen);
    const state = {
      time: page.time,
      camera: { azimuth, inclination, distance, target: [...target] },
      selection: [figure, page.panels.chosen.joint],
      angles: page.figures.map(({ tracks }) => tracks.edits ? tracks.edits.byRow() : []),
    };
    const text = JSON.stringify(state);
    if (text === this.sent) return;
    this.sent = text;
    window.parent.postMessage({ viewer: state }, "*");
  }
}
