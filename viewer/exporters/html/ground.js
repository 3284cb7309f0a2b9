// What surrounds the figures: the background, the ground grid, and the key light's shadow.

const SHADOW_UNIT = 14, SHADOW_SIDE = 2048;

class Stage {
  constructor(gl, programs, header) {
    Object.assign(this, { gl, programs, header });
    this.corners = bufferOf(gl, Float32Array.of(-1, -1, 1, -1, -1, 1, 1, 1));
    this.none = gl.createVertexArray();
  }

  drawBackground() {
    const gl = this.gl, program = this.programs.get("background");
    gl.disable(gl.DEPTH_TEST);
    setUniforms(gl, program, this.header.background);
    gl.bindVertexArray(this.none);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.enable(gl.DEPTH_TEST);
  }

  drawGrid(camera) {
    const gl = this.gl, program = this.programs.get("ground"), { ground } = this.header;
    this.array ??= vertexArray(gl, program, { in_corner: [this.corners, 2] });
    setUniforms(gl, program, { ...ground.uniforms, u_projection: camera.projection,
      u_model_view: product4(camera.view, ground.placement) });
    gl.bindVertexArray(this.array);
    // The translucent grid must not hide what is drawn later.
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.depthMask(true);
    gl.bindVertexArray(null);
  }

  // Makes the shadow map: depths as seen from the key light.
  makeMap() {
    const gl = this.gl;
    this.map = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + SHADOW_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW_SIDE, SHADOW_SIDE);
    const set = (name, value) => gl.texParameteri(gl.TEXTURE_2D, name, value);
    set(gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    set(gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL);
    // A linear comparison is left to the implementation (OpenGL ES 3.0, 3.8.9), and Firefox warns of
    // it. The 12 taps of shadow.glsl smooth the edges anyway.
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) set(name, gl.NEAREST);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) set(name, gl.CLAMP_TO_EDGE);
    this.mapTarget = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.mapTarget);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.map, 0);
  }

  // Draws the shadow map of some figures; returns the uniforms of shadow.glsl and lights.glsl.
  drawMap(figures, camera) {
    const gl = this.gl, { radius, strength } = this.header.shadow;
    if (!this.map) this.makeMap();
    // The key light keeps its direction in camera space.
    const key = this.header.lights.u_light_directions.slice(0, 3), v = camera.view;
    const towards = [0, 1, 2].map((i) => v[4 * i] * key[0] + v[4 * i + 1] * key[1] + v[4 * i + 2] * key[2]);
    const least = towards.map(Math.abs).indexOf(Math.min(...towards.map(Math.abs)));
    const right = normalized(cross([0, 1, 2].map((i) => (i === least ? 1 : 0)), towards));
    const axes = [right, cross(towards, right), towards];
    const spheres = figures.filter((each) => each.isDrawn && each.data.mesh).map((each) => each.bounds);
    const sides = axes.map((axis) => [
      Math.min(...spheres.map(([at, size]) => dot(axis, at) - size)),
      Math.max(...spheres.map(([at, size]) => dot(axis, at) + size))]);
    if (!spheres.length) sides.fill([-1, 1]);
    const middle = sides.map(([low, high]) => 0.5 * (low + high));
    const halves = sides.map(([low, high]) => 0.5 * (high - low));
    const half = 1.01 * Math.max(halves[0], halves[1]), deep = halves[2];
    const light = {
      view: [0, 1, 2].flatMap((i) => [axes[0][i], axes[1][i], axes[2][i], 0])
        .concat(middle.map((x) => -x), 1),
      projection: [1 / half, 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, -1 / deep, 0, 0, 0, 0, 1],
    };
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.mapTarget);
    gl.viewport(0, 0, SHADOW_SIDE, SHADOW_SIDE);
    gl.activeTexture(gl.TEXTURE0 + SHADOW_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, null);  // what is drawn to must not be read
    gl.clear(gl.DEPTH_BUFFER_BIT);
    for (const each of figures) each.drawDepth(light);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.activeTexture(gl.TEXTURE0 + SHADOW_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    const unit = [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0.5, 0.5, 0.5, 1];
    const scene = product4(unit, product4(light.projection, light.view));
    this.light = { axes, middle, halves, half, deep };
    return {
      u_shadow_map: SHADOW_UNIT,
      u_shadow_matrix: product4(scene, rigidInverse(v)),
      u_shadow_filter: [radius / SHADOW_SIDE, 0],
      u_shadow_offset: ((radius + 1) * 2 * half) / SHADOW_SIDE,
      u_shadow_strength: strength,
    };
  }

  // Draws the shadow on the ground, unless the camera is below it; see shadow_passes.py.
  drawShadow(camera, shadow) {
    const gl = this.gl, { ground, up } = this.header;
    const { axes, middle, halves, half, deep } = this.light;
    const { opacity, grazing, strength, radius } = this.header.shadow;
    const above = up === "z" ? [0, 0, 1] : [0, 1, 0];
    const height = dot(above, ground.placement.slice(12, 15));
    const slope = dot(above, axes[2]);
    const fade = Math.min(Math.max((slope - grazing[0]) / (grazing[1] - grazing[0]), 0), 1);
    if (fade === 0 || dot(above, camera.eye) <= height) return;
    // The part of the map that the figures and the filter darken, from the middle to its sides.
    const reach = [0, 1].map((k) => Math.min(halves[k] / half + (2 * (radius + 1)) / SHADOW_SIDE, 1));
    // From a corner of this part at depth 0, along the light, to the ground.
    const away = axes[2].map((x) => -2 * deep * x), depths = [], places = [];
    for (const [u, w] of [[-1, -1], [1, -1], [-1, 1]]) {
      const corner = [0, 1, 2].map((i) => axes[0][i] * (middle[0] + u * reach[0] * half) +
        axes[1][i] * (middle[1] + w * reach[1] * half) + axes[2][i] * (middle[2] + deep));
      const depth = (height - dot(above, corner)) / dot(above, away);
      depths.push(depth);
      places.push(corner.map((x, i) => x + depth * away[i]));
    }
    const [first, second] = [1, 2].map((n) => places[n].map((x, i) => x - places[0][i]));
    const placement = [...first, 0, ...second, 0, 0, 0, 0, 0, ...places[0], 1];
    const program = this.programs.get("patch");
    this.square ??= bufferOf(gl, Float32Array.of(0, 0, 1, 0, 0, 1, 1, 1));
    this.patchArray ??= vertexArray(gl, program, { in_corner: [this.square, 2] });
    setUniforms(gl, program, { ...shadow, u_projection: camera.projection,
      u_model_view: product4(camera.view, placement),
      u_part: [0.5 - 0.5 * reach[0], 0.5 - 0.5 * reach[1], ...reach],
      u_depth: [depths[0], depths[1] - depths[0], depths[2] - depths[0]],
      u_opacity: opacity * fade * strength });
    gl.bindVertexArray(this.patchArray);
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.depthMask(true);
    gl.bindVertexArray(null);
  }
}

// The inverse of a matrix that only rotates and moves.
function rigidInverse(m) {
  const rows = [0, 1, 2].map((i) => [m[4 * i], m[4 * i + 1], m[4 * i + 2]]);
  const back = rows.map((row) => -dot(row, [m[12], m[13], m[14]]));
  return [0, 1, 2].flatMap((i) => [rows[0][i], rows[1][i], rows[2][i], 0]).concat(back, 1);
}
