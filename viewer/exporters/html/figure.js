// One figure: its buffers, skinned by skin.vert once per pose, and its drawing.

const SKIN_SAMPLERS = { u_palette: 0, u_pairs: 1, u_rigid: 2, u_places: 3 };
const EDGE_COLOR = [0.028, 0.039, 0.055, 0.55];      // premultiplied
const BONE_COLOR = [0.81, 0.5, 0.09, 0.9], MARKED_COLOR = [0.9, 0.18, 0.1, 0.95];

class Figure {
  // ``before``: the figure of a lost context, whose state it keeps.
  constructor(gl, programs, data, arrays, ramp, samplers, before = {}) {
    Object.assign(this, { gl, programs, data, arrays, ramp, samplers });
    this.tracks = before.tracks ?? new Tracks(data, arrays);
    this.isVisible = before.isVisible ?? true;
    this.joint = -1;
    this.side = before.side ?? "both";    // of the divider
    this.shift = before.shift ?? [0, 0, 0];
    this.isReflected = false;
    this.center = [0, 0, 0];
    this.isAttached = Boolean(data.skin);
    if (data.mesh) this.loadMesh(data.mesh);
    if (data.mesh && data.skin) this.loadSkin(data.skin);
    this.boneBuffer = gl.createBuffer();
    this.boneArray = null;
    if (before.joint >= 0) this.showWeights(before.joint);
  }

  // The matrix from the figure's space to the scene's.
  get placement() { return product4(placed(this.shift), this.data.placement); }

  // The mean of the joints, or the centre of a figure without joints, in scene space; see recorder.py.
  get place() {
    const places = this.data.joints ? this.tracks.joints() : this.center, n = places.length / 3;
    const [x, y, z] = [0, 1, 2].map((i) => {
      let sum = 0;
      for (let at = i; at < places.length; at += 3) sum += places[at];
      return sum / n;
    });
    const m = product4(this.placement, this.model);
    return [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
  }

  loadMesh(mesh) {
    const gl = this.gl, get = (name) => this.arrays[mesh[name]].values;
    this.rest = get("positions");
    this.center = mesh.center;
    this.sources = Int32Array.from(get("sources"));
    this.nVertices = this.sources.length;
    this.restNormals = get("normals");
    const normals = this.split(this.restNormals, 3), positions = this.split(this.rest, 3);
    this.positions = bufferOf(gl, positions, gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW);
    this.normals = bufferOf(gl, normals, gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW);
    this.triangles = Uint32Array.from(get("triangles"));
    this.indices = bufferOf(gl, this.triangles, gl.ELEMENT_ARRAY_BUFFER);
    this.posed = bufferOf(gl, this.rows(positions, normals), gl.ARRAY_BUFFER, gl.DYNAMIC_COPY);
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
    this.surfaces = mesh.surfaces.map((surface) => ({ ...surface, uniforms: { ...surface.uniforms },
      textures: surface.textures.map(({ unit, ...how }) => {
        const key = JSON.stringify(how);
        if (!made.has(key)) made.set(key, pictureTexture(gl, this.arrays[how.image], how));
        return { unit, texture: made.get(key) };
      }) }));
    this.plain = { uniforms: mesh.plain, textures: [], isBlended: false, isDoubleSided: true };
    this.ranges = mesh.runs.map(([index, first, count]) =>
      ({ surface: index < 0 ? this.plain : this.surfaces[index], first, count }));
    this.blended = this.ranges.filter(({ surface }) => surface.isBlended);
    this.macros = mesh.hasMaterials ? "-MATERIALS" : "";
    this.depth = this.programs.get(`depth${this.macros}`);
    this.depthArray = vertexArray(gl, this.depth, this.attributes, this.indices);
    this.arraysOf = new Map();
  }

  // The vertex array of a program; blended surfaces have their own, sorted triangles.
  arrayOf(program, indices = this.indices) {
    if (!this.arraysOf.has(program)) this.arraysOf.set(program, new Map());
    const known = this.arraysOf.get(program);
    if (!known.has(indices))
      known.set(indices, vertexArray(this.gl, program, this.attributes, indices));
    return known.get(indices);
  }

  // Position and unit normal of each split vertex, as skin.vert writes them.
  rows(positions, normals) {
    const found = new Float32Array(6 * this.nVertices);
    for (let v = 0; v < this.nVertices; ++v) {
      found.set(positions.subarray(3 * v, 3 * v + 3), 6 * v);
      found.set(normalized(normals.subarray(3 * v, 3 * v + 3)), 6 * v + 3);
    }
    return found;
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
    this.deformRest();
    for (const surface of this.surfaces)
      for (const [name, item] of Object.entries(surface.changes || {})) {
        const values = [...tracks.between(this.arrays[item])];
        (name in surface.uniforms ? surface.uniforms : surface.outline.uniforms)[name] = values;
      }
    if (this.isAttached) this.skin(tracks.palette(this.data.mesh.center));
    this.sortedFor = null;  // the direction for which blended triangles are sorted
    this.nPoses = (this.nPoses || 0) + 1;
  }

  // Displaces the rest vertices, and computes or displaces the rest normals, as shape.py does.
  deformRest() {
    const gl = this.gl, tracks = this.tracks, { fields, normalFields } = tracks.arrays;
    const { held } = tracks;
    if (!fields && !normalFields && !held && !this.wasHeld) return;
    this.wasHeld = Boolean(held);
    const write = (buffer, values) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, values);
    };
    let rest = held?.rest?.values ?? this.rest, normals = held?.restNormals?.values ?? this.restNormals;
    if (!held) {
      const weights = fields ? tracks.at("weights") : [], n = this.data.motion.nShapes ?? 0;
      rest = addOffsets(rest, weights, fields, 0, n);
      if (tracks.isRecomputed) normals = surfaceNormals(rest, this.triangles, this.sources);
      else if (normalFields)
        normals = addOffsets(normals, tracks.at("normalWeights"), normalFields, 0);
      rest = addOffsets(rest, weights, fields, n);
    }
    [rest, normals] = [this.split(rest, 3), this.split(normals, 3)];
    if (!this.isAttached) return write(this.posed, this.rows(rest, normals));
    write(this.positions, rest);
    write(this.normals, normals);
  }

  skin(palette) {
    const gl = this.gl, { center, restCenter } = palette;
    this.center = center;
    this.isReflected = palette.orientation < 0;
    this.tracks.matrixTexels(palette, this.palette.data);
    this.tracks.rigidTexels(palette, this.rigid.data);
    this.places.data.set(center, 0);
    this.places.data.set(restCenter.map((c, axis) => c - center[axis]), 4);
    [this.palette, this.rigid, this.places].forEach((texture) => texture.write());
    this.palette.use(SKIN_SAMPLERS.u_palette);
    this.pairs.use(SKIN_SAMPLERS.u_pairs);
    this.rigid.use(SKIN_SAMPLERS.u_rigid);
    this.places.use(SKIN_SAMPLERS.u_places);
    setUniforms(gl, this.skinning, { ...SKIN_SAMPLERS, u_attached: true, u_first: 0,
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

  // Positions and unit normals of split vertices, in rows of six, as the shader computed them. They
  // are read from a copy once the graphics card has finished: nothing waits for it.
  async readPosed() {
    const gl = this.gl, rows = new Float32Array(6 * this.nVertices), copy = gl.createBuffer();
    gl.bindBuffer(gl.COPY_READ_BUFFER, this.posed);
    gl.bindBuffer(gl.COPY_WRITE_BUFFER, copy);
    gl.bufferData(gl.COPY_WRITE_BUFFER, rows.byteLength, gl.STREAM_READ);
    gl.copyBufferSubData(gl.COPY_READ_BUFFER, gl.COPY_WRITE_BUFFER, 0, 0, rows.byteLength);
    gl.bindBuffer(gl.COPY_READ_BUFFER, null);
    const done = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    do await new Promise((next) => setTimeout(next, 4));
    while (gl.clientWaitSync(done, gl.SYNC_FLUSH_COMMANDS_BIT, 0) === gl.TIMEOUT_EXPIRED);
    gl.deleteSync(done);
    gl.bindBuffer(gl.COPY_WRITE_BUFFER, copy);
    gl.getBufferSubData(gl.COPY_WRITE_BUFFER, 0, rows);
    gl.deleteBuffer(copy);
    return rows;
  }

  // Positions and normals (V, 3) of the figure's vertices in its own space.
  async posedVertices() {
    // The figure may be posed again while its rows are read.
    const { model, center } = this;
    const rows = await this.readPosed(), positions = [], normals = [];
    this.sources.forEach((v, row) => {
      positions[v] = [0, 1, 2].map((i) => model[0] * (rows[6 * row + i] + center[i]) + model[12 + i]);
      normals[v] = [...rows.subarray(6 * row + 3, 6 * row + 6)];
    });
    return { positions, normals };
  }

  // Uniforms of all programs that draw the figure.
  placing(camera) {
    const model = product4(this.placement, product4(this.model, placed(this.center)));
    const modelView = product4(camera.view, model);
    return { u_model_view: modelView, u_projection: camera.projection,
      u_normal_matrix: normalMatrix(modelView), u_orthographic: false };
  }

  // Scene units per unit of the figure.
  get scale() {
    return Math.cbrt(Math.abs(determinant(product4(this.placement, this.model))));
  }

  // Whether placement, or most of the skinning, reflects the figure: its triangles are then
  // clockwise seen from their front.
  get isMirrored() {
    return (determinant(this.placement) < 0) !== this.isReflected;
  }

  // A sphere about the posed figure in scene space: its centre, and its radius.
  get bounds() {
    const [x, y, z] = this.center, model = product4(this.placement, this.model);
    const at = [0, 1, 2].map((i) => model[i] * x + model[4 + i] * y + model[8 + i] * z + model[12 + i]);
    return [at, 0.8 * this.data.size * Math.hypot(model[0], model[1], model[2])];
  }

  // Draws the depths of the surface for the shadow map; blended texels cover a part of it.
  drawDepth(light) {
    if (!this.isDrawn || !this.data.mesh) return;
    const gl = this.gl;
    gl.bindVertexArray(this.depthArray);
    for (const { surface, first, count } of this.ranges) {
      setUniforms(gl, this.depth, { ...this.placing(light), ...this.samplers,
        u_color: this.data.color, u_has_tint: "in_tint" in this.attributes, u_threshold: 0,
        ...surface.uniforms });
      this.bindTextures(surface);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
    gl.bindVertexArray(null);
  }

  bindTextures(surface) {
    for (const { unit, texture } of surface.textures) {
      this.gl.activeTexture(this.gl.TEXTURE0 + unit);
      this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
    }
  }

  get isDrawn() { return this.isVisible && this.tracks.isPresent; }

  // Draws the opaque or the blended surfaces, and the outlines of toon surfaces.
  drawSurface(camera, lights, isBlended) {
    if (!this.isDrawn || !this.data.mesh) return;
    const gl = this.gl, shows = this.joint >= 0, dim = this.data.opacity;
    const common = { ...this.placing(camera), ...lights, ...this.samplers,
      u_color: this.data.color, u_opacity: dim, u_flat: false,
      u_has_uv: "in_uv" in this.attributes, u_has_colors: shows,
      u_has_tint: "in_tint" in this.attributes && !shows };
    const chosen = this.ranges.filter(({ surface }) => (surface.isBlended || dim < 1) === isBlended);
    if (!chosen.length) return;
    gl.frontFace(this.isMirrored ? gl.CW : gl.CCW);
    // Blended surfaces write no depth, so their outlines are drawn below them.
    if (isBlended && !shows) this.drawOutlines(chosen, common);
    const shading = shows ? "phong" : this.data.mesh.shading;
    const program = this.programs.get(`mesh-${shading}${this.macros}`);
    const sorted = isBlended && dim === 1 ? this.sorted(camera) : { indices: this.indices, ranges: chosen };
    gl.bindVertexArray(this.arrayOf(program, sorted.indices));
    for (const { surface, first, count } of sorted.ranges) {
      setUniforms(gl, program, { ...common, ...surface.uniforms,
        ...(shows ? { u_textured: false, u_has_base_factor: false, u_normal_scale: 0 } : {}) });
      this.bindTextures(surface);
      (surface.isDoubleSided ? gl.disable : gl.enable).call(gl, gl.CULL_FACE);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
    gl.disable(gl.CULL_FACE);
    if (!isBlended && !shows) this.drawOutlines(chosen, common);
    gl.frontFace(gl.CCW);
    gl.bindVertexArray(null);
  }

  // Draws the back faces of surfaces that are moved along their normals.
  drawOutlines(ranges, common) {
    const outlined = ranges.filter(({ surface }) => surface.outline);
    if (!outlined.length) return;
    const gl = this.gl, program = this.programs.get("hull");
    gl.bindVertexArray(this.arrayOf(program));
    gl.enable(gl.CULL_FACE);
    gl.cullFace(gl.FRONT);
    for (const { surface, first, count } of outlined) {
      const { uniforms, width } = surface.outline;
      setUniforms(gl, program, { ...common, ...surface.uniforms, ...uniforms,
        u_hull_width: uniforms.u_hull_on_screen ? width : width * this.scale });
      this.bindTextures(surface);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
    gl.cullFace(gl.BACK);
    gl.disable(gl.CULL_FACE);
  }

  // Whether ``readRows`` is needed before the figure is drawn.
  get isUnsorted() { return this.isDrawn && this.blended?.length > 0 && this.sortedFor === null; }

  // Reads the positions by which blended triangles are sorted.
  async readRows() {
    const pose = this.nPoses;
    this.posedRows = await this.readPosed();
    if (this.nPoses === pose) this.sortedFor = "";
  }

  // Blended triangles from the farthest to the nearest, and their surfaces; see material_runs.py.
  sorted(camera) {
    const gl = this.gl, { u_model_view: m } = this.placing(camera);
    const along = [m[2], m[6], m[10]], key = along.join();
    if (this.sortedFor === key) return this.order;
    if (this.sortedFor !== null) this.sortedFor = key;
    // Nothing is read yet if the figure has just become visible; the next frame reads it.
    const rows = this.posedRows || new Float32Array(6 * this.nVertices), depth = (v) =>
      along[0] * rows[6 * v] + along[1] * rows[6 * v + 1] + along[2] * rows[6 * v + 2];
    const total = this.blended.reduce((sum, { count }) => sum + count, 0);
    const indices = new Uint32Array(total), ranges = [];
    let at = 0;
    for (const { surface, first, count } of this.blended) {
      const depths = new Float64Array(count / 3);
      for (let t = 0; t < depths.length; ++t)
        for (let i = 0; i < 3; ++i) depths[t] += depth(this.triangles[first + 3 * t + i]);
      const order = Uint32Array.from(depths, (_, t) => t).sort((a, b) => depths[a] - depths[b]);
      ranges.push({ surface, first: at, count, mean: depths.reduce((a, b) => a + b, 0) / depths.length });
      for (const t of order)
        for (let i = 0; i < 3; ++i) indices[at++] = this.triangles[first + 3 * t + i];
    }
    ranges.sort((a, b) => a.mean - b.mean);
    this.sortedIndices ??= gl.createBuffer();
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.sortedIndices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.DYNAMIC_DRAW);
    this.order = { indices: this.sortedIndices, ranges };
    return this.order;
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
