// Poses between frames: interpolated tracks, and the matrices that skin.vert reads. Matrices are
// 64-bit floats, column by column; they are rounded when they are written for the shaders.

class Tracks {
  constructor(figure, arrays) {
    this.motion = figure.motion;
    this.skin = figure.skin;
    this.arrays = {};
    for (const name of
      ["model", "rotations", "places", "stretches", "joints", "weights", "fields", "present",
        "normalWeights", "normalFields", "recomputed"])
      if (name in this.motion) this.arrays[name] = arrays[this.motion[name]];
    if (figure.joints?.dofs) this.edits = new JointEdits(figure.joints, arrays);
  }

  // Seconds from the start of the page's timeline to the last frame.
  get end() { return this.motion.start + (this.motion.n - 1) / this.motion.rate; }

  // Keeps a pose that was set from outside, arrays by name, until the time changes.
  hold(values) {
    this.held = {};
    for (const [name, array] of Object.entries(values))
      this.held[name] = { rows: 1, columns: array.length, values: Float64Array.from(array) };
    this.edits?.reset();
  }

  // A track by its name, of the held pose or the motion.
  track(name) { return this.held?.[name] ?? (this.held && name === "stretches" ? undefined : this.arrays[name]); }

  get binds() { return this.held?.binds?.values ?? this.skin.binds; }

  // Moves to a time in seconds.
  seek(time) {
    const asked = (time - this.motion.start) * this.motion.rate;
    const frame = Math.min(Math.max(asked, 0), this.motion.n - 1);
    // Times of frames are rounded: half a millionth of a frame is the frame.
    const near = Math.round(frame);
    const exact = Math.abs(frame - near) < 1e-6 ? near : frame;
    this.frame = Math.min(Math.floor(exact), Math.max(this.motion.n - 2, 0));
    this.part = exact - this.frame;
    this.isPresent = (!this.arrays.present || this.arrays.present.values[near] > 0.5) &&
      (this.motion.holds || Math.abs(asked - frame) < 0.5);
  }

  // Whether the rest normals are those of the changed surface, in a frame beside the current time.
  get isRecomputed() {
    const values = this.arrays.recomputed?.values, after = this.part === 0 ? 0 : 1;
    return Boolean(values && (values[this.frame] > 0.5 || values[this.frame + after] > 0.5));
  }

  // Values of a track at the current time.
  at(name) { return this.between(this.track(name)); }

  between({ rows, columns, values }) {
    const found = new Float64Array(columns);
    const first = Math.min(this.frame, rows - 1) * columns, part = rows > 1 ? this.part : 0;
    for (let c = 0; c < columns; ++c) {
      const low = values[first + c];
      found[c] = part === 0 ? low : low + part * (values[first + columns + c] - low);
    }
    return found;
  }

  // Places of the skeleton's joints, figure space.
  joints() {
    const places = this.track("places"), found = this.between(this.track("joints") || places);
    if (this.edits?.changed.size) {
      this.edits.read(this.unitTurns());
      moveAll(this.edits.motions(this.between(places)), found);
    }
    return found;
  }

  // The rotations of the joints as unit quaternions.
  unitTurns() {
    const turns = this.at("rotations");
    for (let at = 0; at < turns.length; at += 4) turns.set(normalized(turns.subarray(at, at + 4)), at);
    return turns;
  }

  // Matrices of the joints about the centres of rest pose and pose; see posed_vertices.py.
  palette(restCenter) {
    const places = this.at("places"), turns = this.unitTurns();
    this.edits?.read(turns);
    if (this.edits?.changed.size) {
      const motions = this.edits.motions(places);
      moveAll(motions, places);
      motions.forEach(({ turn }, j) =>
        turns.set(turned(turn, turns.subarray(4 * j, 4 * j + 4)), 4 * j));
    }
    const stretches = this.track("stretches") && this.at("stretches");
    const { fractions } = this.skin, { binds } = this, n = fractions.length;
    const linear = new Float64Array(9 * n), moved = new Float64Array(3 * n);
    const rotations = new Float64Array(9 * n), center = [0, 0, 0];
    let total = 0, orientation = 0;
    for (let j = 0; j < n; ++j) {
      const q = turns.subarray(4 * j, 4 * j + 4);
      const R = rotationOf(q), A = stretches ? product3(R, symmetric(stretches, 6 * j)) : R;
      rotations.set(R, 9 * j);
      linear.set(A, 9 * j);
      // Where the joint moves the centre of the rest pose: p + A (c - b).
      const arm = [0, 1, 2].map((axis) => restCenter[axis] - binds[3 * j + axis]);
      for (let row = 0; row < 3; ++row) {
        moved[3 * j + row] = places[3 * j + row] +
          A[row] * arm[0] + A[row + 3] * arm[1] + A[row + 6] * arm[2];
        center[row] += fractions[j] * moved[3 * j + row];
      }
      total += fractions[j];
      const [a, b, c] = [0, 3, 6].map((column) => Array.from(A.slice(column, column + 3)));
      orientation += fractions[j] * Math.sign(dot(a, cross(b, c)));
    }
    return { n, linear, moved, rotations, turns, places, stretches, restCenter, orientation,
      center: total > 0 ? center : [...restCenter] };
  }

  // Three texels per joint: the rows of its matrix.
  matrixTexels(palette, texels) {
    for (let j = 0; j < palette.n; ++j)
      for (let row = 0; row < 3; ++row) {
        const at = 4 * (3 * j + row);
        for (let column = 0; column < 3; ++column)
          texels[at + column] = palette.linear[9 * j + 3 * column + row];
        texels[at + 3] = palette.moved[3 * j + row] - palette.center[row];
      }
  }

  // Five texels per joint: the dual quaternion of its rigid motion, after the rows of its stretch
  // about the bind position; see dqs.py.
  rigidTexels(palette, texels) {
    for (let j = 0; j < palette.n; ++j) {
      const at = 20 * j, bind = [], place = [];
      for (let axis = 0; axis < 3; ++axis) {
        bind.push(this.binds[3 * j + axis] - palette.restCenter[axis]);
        place.push(palette.places[3 * j + axis] - palette.center[axis]);
      }
      const R = palette.rotations.subarray(9 * j, 9 * j + 9);
      const [x, y, z] = [0, 1, 2].map((row) =>
        0.5 * (place[row] - R[row] * bind[0] - R[row + 3] * bind[1] - R[row + 6] * bind[2]));
      const [qx, qy, qz, qw] = palette.turns.subarray(4 * j, 4 * j + 4);
      texels.set([qx, qy, qz, qw,
        x * qw + y * qz - z * qy, y * qw + z * qx - x * qz, z * qw + x * qy - y * qx,
        -(x * qx + y * qy + z * qz)], at);
      const S = palette.stretches ? symmetric(palette.stretches, 6 * j) : [1, 0, 0, 0, 1, 0, 0, 0, 1];
      for (let row = 0; row < 3; ++row) {
        const s = [S[row], S[row + 3], S[row + 6]];
        texels.set([...s, bind[row] - s[0] * bind[0] - s[1] * bind[1] - s[2] * bind[2]],
          at + 8 + 4 * row);
      }
    }
  }
}

// Adds some of the weighted fields of offsets to rows of three numbers.
function addOffsets(rows, weights, fields, first, last = weights.length) {
  if (last <= first) return rows;
  const found = Float64Array.from(rows), count = weights.length, { values } = fields;
  for (let v = 0; v < rows.length / 3; ++v)
    for (let k = first; k < last; ++k) {
      const at = 3 * (v * count + k), weight = weights[k];
      found[3 * v] += weight * values[at];
      found[3 * v + 1] += weight * values[at + 1];
      found[3 * v + 2] += weight * values[at + 2];
    }
  return found;
}

// Normals of vertices, triangles weighted by area: vertex_normals of mesh.py. Vertices that are
// split along texture seams share the normal of their source.
function surfaceNormals(positions, triangles, sources) {
  const found = new Float64Array(positions.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [sources[triangles[t]], sources[triangles[t + 1]], sources[triangles[t + 2]]];
    const bx = positions[3 * b] - positions[3 * a], cx = positions[3 * c] - positions[3 * a];
    const by = positions[3 * b + 1] - positions[3 * a + 1], cy = positions[3 * c + 1] - positions[3 * a + 1];
    const bz = positions[3 * b + 2] - positions[3 * a + 2], cz = positions[3 * c + 2] - positions[3 * a + 2];
    const [x, y, z] = [by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx];
    for (const v of [a, b, c]) { found[3 * v] += x; found[3 * v + 1] += y; found[3 * v + 2] += z; }
  }
  for (let v = 0; v < found.length; v += 3) {
    const length = Math.hypot(found[v], found[v + 1], found[v + 2]);
    if (length === 0) found[v + 1] = 1;
    else for (let i = 0; i < 3; ++i) found[v + i] /= length;
  }
  return found;
}

function normalized(v) {
  const size = Math.hypot(...v) || 1;
  return Array.from(v, (x) => x / size);
}

// The matrix of a unit quaternion (x, y, z, w).
function rotationOf([x, y, z, w]) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w),
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)];
}

// A symmetric matrix from its upper triangle.
function symmetric(values, at) {
  const [a, b, c, d, e, f] = values.subarray(at, at + 6);
  return [a, b, c, b, d, e, c, e, f];
}

function product3(a, b) {
  const found = new Array(9).fill(0);
  for (let column = 0; column < 3; ++column)
    for (let row = 0; row < 3; ++row)
      for (let i = 0; i < 3; ++i) found[3 * column + row] += a[3 * i + row] * b[3 * column + i];
  return found;
}

function product4(a, b) {
  const found = new Array(16).fill(0);
  for (let column = 0; column < 4; ++column)
    for (let row = 0; row < 4; ++row)
      for (let i = 0; i < 4; ++i) found[4 * column + row] += a[4 * i + row] * b[4 * column + i];
  return found;
}

// The matrix that scales by a factor, then moves.
function placed([x, y, z], scale = 1) {
  return [scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, x, y, z, 1];
}

// The matrix of normals, up to a positive factor: cofactors with the sign of the determinant.
function normalMatrix(m) {
  const [a, b, c] = [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]];
  const columns = [cross(b, c), cross(c, a), cross(a, b)];
  const sign = dot(a, columns[0]) < 0 ? -1 : 1;
  const size = Math.max(...columns.flat().map(Math.abs)) || 1;
  return columns.flat().map((x) => (sign * x) / size);
}

// The determinant of the linear part of a 4 x 4 matrix.
function determinant(m) {
  return dot(m.slice(0, 3), cross(m.slice(4, 7), m.slice(8, 11)));
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
