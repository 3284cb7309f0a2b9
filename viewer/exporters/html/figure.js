// One figure: its buffers, skinned by skin.vert once per pose, and its drawing.

const SAMPLERS = { u_palette: 0, u_pairs: 1, u_rigid: 2, u_places: 3 };
const EDGE_COLOR = [0.028, 0.039, 0.055, 0.55];      // premultiplied
const BONE_COLOR = [0.81, 0.5, 0.09, 0.9], MARKED_COLOR = [0.9, 0.18, 0.1, 0.95];

class Figure {
  constructor(gl, programs, data, arrays, ramp) {
    Object.assign(this, { gl, programs, data, arrays, ramp });
    this.tracks = new Tracks(data, arrays);
    this.isVisible = true;
    this.joint = -1;
    this.center = [0, 0, 0];
    this.isAttached = Boolean(data.skin);
    if (data.mesh) this.loadMesh(data.mesh);
    if (data.mesh && data.skin) this.loadSkin(data.skin);
    this.boneBuffer = gl.createBuffer();
    this.boneArray = null;
  }

  loadMesh(mesh) {
    const gl = this.gl, get = (name) => this.arrays[mesh[name]].values;
    this.rest = get("positions");
    this.center = mesh.center;
    this.sources = Int32Array.from(get("sources"));
    this.nVertices = this.sources.length;
    const normals = this.split(get("normals"), 3), positions = this.split(this.rest, 3);
    this.positions = bufferOf(gl, positions, gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW);
    this.normals = bufferOf(gl, normals);
    this.triangles = Uint32Array.from(get("triangles"));
    this.indices = bufferOf(gl, this.triangles, gl.ELEMENT_ARRAY_BUFFER);
    // Position and unit normal of each split vertex, as skin.vert writes them.
    const posed = new Float32Array(6 * this.nVertices);
    for (let v = 0; v < this.nVertices; ++v) {
      posed.set(positions.subarray(3 * v, 3 * v + 3), 6 * v);
      posed.set(normalized(normals.subarray(3 * v, 3 * v + 3)), 6 * v + 3);
    }
    this.posed = bufferOf(gl, posed, gl.ARRAY_BUFFER, gl.DYNAMIC_COPY);
    this.colors = bufferOf(gl, new Float32Array(3 * this.nVertices), gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW);
    this.attributes = {
      in_position: [this.posed, 3, 24, 0],
      in_normal: [this.posed, 3, 24, 12],
      in_color: [this.colors, 3],
    };
    const floats = (values) => bufferOf(gl, Float32Array.from(values));
    if ("uvs" in mesh) this.attributes.in_uv = [floats(get("uvs")), 2];
    if (mesh.otherUvs && mesh.otherUvs.length) {
      const both = new Float32Array(4 * this.nVertices);
      mesh.otherUvs.forEach((item, slot) => {
        const values = this.arrays[item].values;
        for (let v = 0; v < this.nVertices; ++v)
          both.set([values[2 * v], values[2 * v + 1]], 4 * v + 2 * slot);
      });
      this.attributes.in_other_uvs = [bufferOf(gl, both), 4];
    }
    if ("tints" in mesh) this.attributes.in_tint = [floats(this.split(get("tints"), 4)), 4];
    // Materials may sample the same image in different ways.
    const made = new Map();
    this.surfaces = mesh.surfaces.map((surface) => ({ ...surface,
      textures: surface.textures.map(({ unit, ...how }) => {
        const key = JSON.stringify(how);
        if (!made.has(key)) made.set(key, pictureTexture(gl, this.arrays[how.image], how));
        return { unit, texture: made.get(key) };
      }) }));
    const macros = mesh.hasMaterials ? "-MATERIALS" : "";
    this.surface = this.programs.get(`mesh${macros}`);
    this.surfaceArray = vertexArray(gl, this.surface, this.attributes, this.indices);
    this.depth = this.programs.get(`depth${macros}`);
    this.depthArray = vertexArray(gl, this.depth, this.attributes, this.indices);
  }

  // Copies rows of vertices to the split vertices along texture seams.
  split(values, width) {
    const found = new Float32Array(width * this.sources.length);
    for (let v = 0; v < this.sources.length; ++v)
      for (let i = 0; i < width; ++i) found[width * v + i] = values[width * this.sources[v] + i];
    return found;
  }

  loadSkin(skin) {
    const gl = this.gl, get = (name) => this.arrays[skin[name]].values;
    const counts = get("counts"), moved = get("moved"), excess = get("excess");
    const starts = new Uint32Array(counts.length + 1);
    counts.forEach((count, v) => { starts[v + 1] = starts[v] + count; });
    // First pair, number of pairs, and the bits of a float.
    const bindings = new Uint32Array(3 * this.nVertices), bits = new Float32Array(bindings.buffer);
    this.sources.forEach((v, row) => {
      bindings[3 * row] = starts[v];
      bindings[3 * row + 1] = moved[v] ? counts[v] : 0;
      bits[3 * row + 2] = excess[v];
    });
    this.starts = starts;
    this.pairJoints = get("joints");
    this.pairWeights = get("weights");
    const n = skin.fractions.length;
    this.pairs = new NumberTexture(gl, this.pairJoints.length, 1024, 2);
    this.pairJoints.forEach((joint, i) => {
      this.pairs.data[2 * i] = joint;
      this.pairs.data[2 * i + 1] = this.pairWeights[i];
    });
    this.pairs.write();
    this.palette = new NumberTexture(gl, 3 * n, 768, 4);
    this.rigid = new NumberTexture(gl, 5 * n, 640, 4);
    this.places = new NumberTexture(gl, 3, 768, 4);
    const name = ["skin", skin.method, ...(skin.isAffine ? ["AFFINE_PALETTE"] : [])].join("-");
    this.skinning = this.programs.get(name, ["v_position", "v_normal"]);
    const fractions = skin.dqsFractions === undefined ? new Float32Array(this.nVertices)
      : this.split(get("dqsFractions"), 1);
    this.skinArray = vertexArray(gl, this.skinning, {
      in_position: [this.positions, 3],
      in_normal: [this.normals, 3],
      in_bindings: [bufferOf(gl, bindings), 3],
      in_dqs_fraction: [bufferOf(gl, fractions), 1],
    });
    this.feedback = gl.createTransformFeedback();
  }

  // Poses the figure at a time in seconds.
  pose(time) {
    const gl = this.gl, tracks = this.tracks;
    tracks.seek(time);
    const [x, y, z, scale] = tracks.at("model");
    this.model = placed([x, y, z], scale);
    if (!this.data.mesh) return;
    if (tracks.arrays.fields) {
      const rest = addOffsets(this.rest, tracks.at("weights"), tracks.arrays.fields.values);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.positions);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, this.split(rest, 3));
    }
    if (this.isAttached) this.skin(tracks.palette(this.data.mesh.center));
  }

  skin(palette) {
    const gl = this.gl, { center, restCenter } = palette;
    this.center = center;
    this.tracks.matrixTexels(palette, this.palette.data);
    this.tracks.rigidTexels(palette, this.rigid.data);
    this.places.data.set(center, 0);
    this.places.data.set(restCenter.map((c, axis) => c - center[axis]), 4);
    [this.palette, this.rigid, this.places].forEach((texture) => texture.write());
    this.palette.use(SAMPLERS.u_palette);
    this.pairs.use(SAMPLERS.u_pairs);
    this.rigid.use(SAMPLERS.u_rigid);
    this.places.use(SAMPLERS.u_places);
    setUniforms(gl, this.skinning, { ...SAMPLERS, u_attached: true, u_first: 0,
      u_n_joints: palette.n, u_blend_factor: this.data.skin.blendFactor });
    gl.bindVertexArray(this.skinArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);  // captured buffers must not be bound elsewhere
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, this.posed);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.nVertices);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
  }

  // Positions (V, 3) of the figure's vertices in its own space, as the shader computed them.
  posedPositions() {
    const gl = this.gl, rows = new Float32Array(6 * this.nVertices), found = [];
    gl.bindBuffer(gl.ARRAY_BUFFER, this.posed);
    gl.getBufferSubData(gl.ARRAY_BUFFER, 0, rows);
    const [scale, offset] = [this.model[0], this.model.slice(12, 15)];
    this.sources.forEach((v, row) => {
      found[v] = [0, 1, 2].map((i) => scale * (rows[6 * row + i] + this.center[i]) + offset[i]);
    });
    return found;
  }

  // Uniforms of all programs that draw the figure.
  placing(camera) {
    const model = product4(this.data.placement, product4(this.model, placed(this.center)));
    const modelView = product4(camera.view, model);
    return { u_model_view: modelView, u_projection: camera.projection,
      u_normal_matrix: normalMatrix(modelView), u_orthographic: false };
  }

  // A sphere about the posed figure in scene space: its centre, and its radius.
  get bounds() {
    const [x, y, z] = this.center, model = product4(this.data.placement, this.model);
    const at = [0, 1, 2].map((i) => model[i] * x + model[4 + i] * y + model[8 + i] * z + model[12 + i]);
    return [at, 0.8 * this.data.size * Math.hypot(model[0], model[1], model[2])];
  }

  // Draws the depths of the surface for the shadow map; blended texels cover a part of it.
  drawDepth(light) {
    if (!this.isDrawn || !this.data.mesh) return;
    const gl = this.gl;
    gl.bindVertexArray(this.depthArray);
    for (const [index, first, count] of this.data.mesh.runs) {
      const surface = index < 0 ? null : this.surfaces[index];
      setUniforms(gl, this.depth, { ...this.placing(light), u_color: this.data.color,
        u_has_tint: "in_tint" in this.attributes, u_texture: 5, u_threshold: 0,
        ...(surface ? surface.uniforms : { u_textured: false, u_alpha_mode: 0 }) });
      this.bindTextures(surface);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
    gl.bindVertexArray(null);
  }

  bindTextures(surface) {
    for (const { unit, texture } of surface ? surface.textures : []) {
      this.gl.activeTexture(this.gl.TEXTURE0 + unit);
      this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
    }
  }

  get isDrawn() { return this.isVisible && this.tracks.isPresent; }

  // Draws the opaque or the blended surfaces.
  drawSurface(camera, lights, isBlended) {
    if (!this.isDrawn || !this.data.mesh) return;
    const gl = this.gl, shows = this.joint >= 0;
    const dim = this.data.opacity;
    const common = { ...this.placing(camera), ...lights, u_color: this.data.color,
      u_opacity: dim, u_flat: false, u_has_uv: "in_uv" in this.attributes,
      u_has_colors: shows, u_has_tint: "in_tint" in this.attributes && !shows,
      u_texture: 5, u_normal_map: 10 };
    gl.bindVertexArray(this.surfaceArray);
    for (const [index, first, count] of this.data.mesh.runs) {
      const surface = index < 0 ? null : this.surfaces[index];
      if (((surface && surface.isBlended) || dim < 1) !== isBlended) continue;
      setUniforms(gl, this.surface, { ...common,
        ...(surface ? surface.uniforms : { u_textured: false, u_has_base_factor: false,
          u_alpha_mode: 0, u_normal_scale: 0, u_toon: false }),
        ...(shows ? { u_textured: false, u_has_base_factor: false, u_normal_scale: 0 } : {}) });
      this.bindTextures(surface);
      (surface && !surface.isDoubleSided ? gl.enable : gl.disable).call(gl, gl.CULL_FACE);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
    gl.disable(gl.CULL_FACE);
    gl.bindVertexArray(null);
  }

  // Draws every edge once, over the surface.
  drawEdges(camera) {
    if (!this.isDrawn || !this.data.mesh) return;
    const gl = this.gl, program = this.programs.get("lines");
    this.edges ??= this.makeEdges(program);
    setUniforms(gl, program, { ...this.placing(camera), u_line_color: EDGE_COLOR });
    gl.bindVertexArray(this.edges.array);
    gl.drawElements(gl.LINES, this.edges.count, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }

  makeEdges(program) {
    const gl = this.gl, seen = new Set(), ends = [], n = this.nVertices;
    for (let i = 0; i < this.triangles.length; i += 3)
      for (let side = 0; side < 3; ++side) {
        const a = this.triangles[i + side], b = this.triangles[i + ((side + 1) % 3)];
        const key = Math.min(a, b) * n + Math.max(a, b);
        if (!seen.has(key)) { seen.add(key); ends.push(a, b); }
      }
    const indices = bufferOf(gl, Uint32Array.from(ends), gl.ELEMENT_ARRAY_BUFFER);
    return { count: ends.length, array: vertexArray(gl, program, this.attributes, indices) };
  }

  // Draws the bones as octahedra from each joint to its children, in front of everything.
  drawSkeleton(camera) {
    if (!this.isDrawn || !this.data.joints) return;
    const gl = this.gl, program = this.programs.get("lines");
    const places = this.tracks.joints(), { parents } = this.data.joints;
    const at = (joint) => [0, 1, 2].map((i) => places[3 * joint + i] - this.center[i]);
    const corners = [], marked = [];
    parents.forEach((parent, joint) => {
      if (parent < 0) return;
      (parent === this.joint ? marked : corners).push(...octahedron(at(parent), at(joint)));
    });
    const all = Float32Array.from([...corners, ...marked]);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.boneBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, all, gl.DYNAMIC_DRAW);
    this.boneArray ??= vertexArray(gl, program, { in_position: [this.boneBuffer, 3] });
    gl.bindVertexArray(this.boneArray);
    const count = corners.length / 3;
    setUniforms(gl, program, { ...this.placing(camera), u_line_color: BONE_COLOR });
    gl.drawArrays(gl.LINES, 0, count);
    setUniforms(gl, program, { u_line_color: MARKED_COLOR });
    gl.drawArrays(gl.LINES, count, all.length / 3 - count);
    gl.bindVertexArray(null);
  }

  // Shows the weights of a joint as colours; -1 shows the materials again.
  showWeights(joint) {
    this.joint = this.isAttached ? joint : -1;
    if (this.joint < 0) return;
    const weights = new Float32Array(this.starts.length - 1);
    for (let v = 0; v < weights.length; ++v)
      for (let i = this.starts[v]; i < this.starts[v + 1]; ++i)
        if (this.pairJoints[i] === joint) weights[v] += this.pairWeights[i];
    const last = this.ramp.length / 3 - 1, colors = new Float32Array(3 * this.nVertices);
    this.sources.forEach((v, row) => {
      const step = Math.round(last * Math.min(Math.max(weights[v], 0), 1));
      colors.set(this.ramp.subarray(3 * step, 3 * step + 3), 3 * row);
    });
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.colors);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, colors);
  }
}

// The twelve edges of a bone, as pairs of corners.
function octahedron(from, to) {
  const along = to.map((x, i) => x - from[i]), length = Math.hypot(...along);
  if (length === 0) return [];
  const smallest = along.map(Math.abs).indexOf(Math.min(...along.map(Math.abs)));
  const aside = normalized(cross(along, [0, 1, 2].map((i) => (i === smallest ? 1 : 0))));
  const other = normalized(cross(along, aside)), wide = 0.08 * length;
  const middle = from.map((x, i) => x + 0.15 * along[i]);
  const ring = [[1, 0], [0, 1], [-1, 0], [0, -1]].map(([a, b]) =>
    middle.map((x, i) => x + wide * (a * aside[i] + b * other[i])));
  return ring.flatMap((corner, i) =>
    [...from, ...corner, ...corner, ...to, ...corner, ...ring[(i + 1) % 4]]);
}
