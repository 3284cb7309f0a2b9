// The orbit camera of the desktop (rendering/camera.py), and its mouse, touch and wheel.

const RADIANS = Math.PI / 180;

class Camera {
  constructor(header) {
    this.header = header;
    this.reset();
  }

  reset() {
    const { azimuth, inclination, fov } = this.header.camera;
    Object.assign(this, { azimuth, inclination, fov });
    this.target = [...this.header.camera.target];
    this.factor = 1;
  }

  // The distance at which everything is visible; known for some ratios of width and height.
  fitted(aspect) {
    const { distances } = this.header.camera, last = distances.length - 1;
    const place = 0.5 * last * (Math.log2(aspect) + 1);  // 0 at 1 : 2, and the last at 2 : 1
    if (place <= 0) return (distances[0] * 0.5) / aspect;
    const low = Math.min(Math.floor(place), last - 1), part = Math.min(place - low, 1);
    return distances[low] + part * (distances[low + 1] - distances[low]);
  }

  // Moves to angles, a distance and a target, of which some may be given.
  place({ azimuth, inclination, distance, target }, aspect) {
    if (Number.isFinite(azimuth)) this.azimuth = azimuth;
    if (Number.isFinite(inclination)) this.inclination = inclination;
    if (distance > 0) this.factor = distance / this.fitted(aspect);
    if (Array.isArray(target) && target.length === 3 && target.every(Number.isFinite)) this.target = [...target];
  }

  // Right, up and backward in scene space.
  get axes() {
    const a = this.azimuth * RADIANS, i = this.inclination * RADIANS;
    const [sa, ca, si, ci] = [Math.sin(a), Math.cos(a), Math.sin(i), Math.cos(i)];
    const axes = [[ca, 0, -sa], [-si * sa, ci, -si * ca], [ci * sa, si, ci * ca]];
    return this.header.up === "z" ? axes.map(([x, y, z]) => [x, -z, y]) : axes;
  }

  // Computes the matrices for a width and height.
  update(width, height) {
    const aspect = width / height, axes = this.axes;
    this.distance = this.factor * this.fitted(aspect);
    const distance = this.distance;
    const eye = this.target.map((x, i) => x + distance * axes[2][i]);
    this.eye = eye;
    this.view = [0, 1, 2].flatMap((i) => [axes[0][i], axes[1][i], axes[2][i], 0]).concat(
      axes.map((axis) => -dot(axis, eye)), 1);
    const [low, high] = this.header.box, side = low.map((x, i) => high[i] - x);
    const middle = low.map((x, i) => 0.5 * (x + high[i]) - this.target[i]);
    const reach = Math.hypot(...side) + Math.hypot(...middle) || distance;
    const near = Math.max(distance - reach, 5e-3 * distance), far = distance + 20 * reach;
    const f = 1 / Math.tan(0.5 * this.fov * RADIANS), depth = near - far;
    this.projection = [f / aspect, 0, 0, 0, 0, f, 0, 0,
      0, 0, (far + near) / depth, -1, 0, 0, (2 * far * near) / depth, 0];
    this.scale = 2 * distance * Math.tan(0.5 * this.fov * RADIANS);
    // The up axis in camera space.
    const row = this.header.up === "z" ? 2 : 1;
    this.up = [this.view[4 * row], this.view[4 * row + 1], this.view[4 * row + 2]];
  }

  // The rotation from camera space to the studio's, which follows the camera: +y up, +z towards it.
  get toStudio() {
    const axes = this.axes, above = this.header.up === "z" ? [0, 0, 1] : [0, 1, 0];
    const rise = dot(axes[2], above);
    let level = axes[2].map((x, i) => x - rise * above[i]);
    // Seen from straight above or below, the top of the image is away from the camera.
    if (Math.hypot(...level) <= 1e-6) level = axes[1].map((x) => -Math.sign(rise) * x);
    const back = normalized(level), front = [cross(above, back), above, back];
    return axes.flatMap((axis) => front.map((row) => dot(row, axis)));
  }

  orbit(azimuth, inclination) {
    this.azimuth = ((((this.azimuth + azimuth + 180) % 360) + 360) % 360) - 180;
    this.inclination = Math.min(Math.max(this.inclination + inclination, -90), 90);
  }

  // Moves the target in the image's plane, in units of the image's height.
  pan(across, upward) {
    const [right, up] = this.axes;
    this.target = this.target.map((x, i) => x + this.scale * (across * right[i] + upward * up[i]));
  }

  zoom(factor) {
    this.factor = Math.min(Math.max(this.factor * factor, 1e-3), 1e3);
  }

  // One pointer orbits, with Shift or another button it pans; two pan and zoom.
  listen(canvas, changed) {
    const pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.focus();
    });
    for (const name of ["pointerup", "pointercancel"])
      canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!pointers.has(event.pointerId)) return;
      const height = canvas.clientHeight, before = [...pointers.values()];
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      const after = [...pointers.values()];
      const [dx, dy] = [0, 1].map((i) => mean(after, i) - mean(before, i));
      if (pointers.size > 1) {
        this.pan(-dx / height, dy / height);
        this.zoom(spread(before) / (spread(after) || 1) || 1);
      } else if (event.shiftKey || event.buttons > 1) this.pan(-dx / height, dy / height);
      else this.orbit(-0.4 * dx, 0.4 * dy);
      changed();
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      // A page with this one in a frame keeps scrolling until the view has been clicked.
      if (window.self !== window.top && document.activeElement !== canvas) return;
      event.preventDefault();
      this.zoom(Math.exp(Math.min(Math.max(event.deltaY, -100), 100) * 0.002));
      changed();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { this.reset(); changed(); });
  }
}

function mean(points, axis) {
  return points.reduce((sum, point) => sum + point[axis], 0) / points.length;
}

function spread(points) {
  return Math.hypot(points[1][0] - points[0][0], points[1][1] - points[0][1]);
}
