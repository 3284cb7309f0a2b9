// Rotations of joints that the sliders have changed, on top of the poses of the motion.
//
// A world rotation is W_j = P_j Q_j E_j, with the parent's P_j, the rest rotation Q_j and the product
// E_j of the joint's DOFs, the first row first. Changing E_j to F_j moves the joint and all below it
// by the rotation P_j Q_j F_j E_j^-1 (P_j Q_j)^-1 about the joint.

class JointEdits {
  constructor({ parents, binds, rests, dofs }, arrays) {
    Object.assign(this, { parents, dofs });
    const rows = (item) => parents.map((_, j) => Array.from(arrays[item].values.subarray(4 * j, 4 * j + 4)));
    this.binds = rows(binds);    // rotations of the joints when the skin was attached
    this.rests = rows(rests);
    this.changed = new Map();    // angles by DOF, radians
  }

  set(dof, angle) { this.changed.set(dof, angle); }

  reset() { this.changed.clear(); }

  // The changed angles, by the row of the figure's table of DOFs.
  byRow() { return [...this.changed].map(([dof, angle]) => [this.dofs.rows[dof], angle]); }

  // Sets the world rotations of a pose from those of the skinning matrices, four numbers a joint.
  read(turns) {
    this.worlds = this.binds.map((bind, j) => turned(turns.subarray(4 * j, 4 * j + 4), bind));
  }

  // The rotation P Q before the DOFs of a joint.
  before(joint) {
    const parent = this.parents[joint];
    return parent < 0 ? this.rests[joint] : turned(this.worlds[parent], this.rests[joint]);
  }

  rowsOf(joint) {
    return this.dofs.joints.flatMap((each, dof) => (each === joint ? [dof] : []));
  }

  // The angles of a joint's DOFs in the pose that was read, without changes.
  angles(joint) {
    const axes = this.rowsOf(joint).map((dof) => this.dofs.axes[dof]);
    return eulerAngles(turned(inverted(this.before(joint)), this.worlds[joint]), axes);
  }

  // The angle that the slider of a DOF shows.
  shown(dof) {
    const joint = this.dofs.joints[dof];
    return this.changed.has(dof) ? this.changed.get(dof) : this.angles(joint)[this.rowsOf(joint).indexOf(dof)];
  }

  // The rigid motion of each joint, as { turn, place }: x moves to turn x + place.
  motions(places) {
    const edited = new Set([...this.changed.keys()].map((dof) => this.dofs.joints[dof])), found = [];
    this.parents.forEach((parent, joint) => {
      const above = parent < 0 ? { turn: [0, 0, 0, 1], place: [0, 0, 0] } : found[parent];
      found.push(above);
      if (!edited.has(joint)) return;
      const rows = this.rowsOf(joint), axes = rows.map((dof) => this.dofs.axes[dof]);
      const old = this.angles(joint);
      const angles = rows.map((dof, i) => (this.changed.has(dof) ? this.changed.get(dof) : old[i]));
      const before = this.before(joint);
      const change = turned(product(axes, angles), inverted(product(axes, old)));
      const own = turned(turned(before, change), inverted(before));
      const at = places.subarray(3 * joint, 3 * joint + 3), moved = rotated(own, at);
      const away = rotated(above.turn, [0, 1, 2].map((i) => at[i] - moved[i]));
      found[joint] = { turn: turned(above.turn, own), place: away.map((x, i) => x + above.place[i]) };
    });
    return found;
  }
}

// Moves rows of three numbers, one a joint, in place.
function moveAll(motions, places) {
  motions.forEach(({ turn, place }, j) => {
    const moved = rotated(turn, places.subarray(3 * j, 3 * j + 3));
    places.set(moved.map((x, i) => x + place[i]), 3 * j);
  });
}

// The product of two rotations as quaternions (x, y, z, w): first b, then a.
function turned([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [aw * bx + ax * bw + ay * bz - az * by, aw * by + ay * bw + az * bx - ax * bz,
    aw * bz + az * bw + ax * by - ay * bx, aw * bw - ax * bx - ay * by - az * bz];
}

function inverted([x, y, z, w]) { return [-x, -y, -z, w]; }

function rotated(q, [x, y, z]) {
  return turned(turned(q, [x, y, z, 0]), inverted(q)).slice(0, 3);
}

// The rotations by angles about axes 0 to 2, the first one first.
function product(axes, angles) {
  return axes.reduce((found, axis, i) => {
    const q = [0, 0, 0, Math.cos(0.5 * angles[i])];
    q[axis] = Math.sin(0.5 * angles[i]);
    return turned(q, found);
  }, [0, 0, 0, 1]);
}

// The angles about different axes whose product is a rotation; the first one is applied first. With
// axes i, j, k, R = R_k(c) R_j(b) R_i(a) has the entries R_ki = -s sin b, R_kj = s cos b sin a, R_kk =
// cos b cos a, R_ji = s cos b sin c, R_ii = cos b cos c, with s = 1 for cyclic axes and else -1.
function eulerAngles(q, axes) {
  if (axes.length === 1) return [2 * Math.atan2(q[axes[0]], q[3])].map(wrapped);
  const [i, j] = axes, k = axes.length > 2 ? axes[2] : 3 - i - j, s = (j - i + 3) % 3 === 1 ? 1 : -1;
  const m = rotationOf(q), at = (row, column) => m[3 * column + row];
  const b = Math.asin(Math.min(Math.max(-s * at(k, i), -1), 1));
  // With b = 90 degrees only a sum of the others is known: c is 0.
  const isLocked = Math.abs(at(k, i)) > 1 - 1e-12;
  const a = isLocked ? Math.atan2(-s * at(j, k), at(j, j)) : Math.atan2(s * at(k, j), at(k, k));
  const c = isLocked ? 0 : Math.atan2(s * at(j, i), at(i, i));
  return [a, b, c].slice(0, axes.length);
}

function wrapped(angle) { return Math.atan2(Math.sin(angle), Math.cos(angle)); }
