// The arm of an edited table, drawn simply: rods along its axes and common normals, a drum at each joint that turns, a
// block at each that slides.

const ROD = 0.014,
  DRUM = 0.036; // radii, shares of the arm's size
const COLORS = ["#e6e2da", "#b4bac4"]; // of links in turn: dhkit/model/shapes.py

// Objects of each link 0 ... n in its DH frame, and of the tool in its own.
export function solids(kinematics, size, THREE) {
  const { rows, convention, tool } = kinematics,
    links = [[]],
    standard = convention === "standard";
  const rod = ROD * size,
    drum = DRUM * size;
  rows.forEach(() => links.push([]));
  rows.forEach((row, i) => {
    const {
      a,
      d,
      sliding,
      twisted: [c, s],
    } = row;
    // Link i + 1 in its own frame: a standard one ends at its origin, a modified one begins there.
    const own = new THREE.Matrix4(),
      color = COLORS[i % COLORS.length];
    if (standard) own.set(1, 0, 0, -a, 0, c, s, 0, 0, -s, c, 0, 0, 0, 0, 1);
    const [low, high] = sliding ? [row.lower ?? -size / 2, row.upper ?? size / 2] : [0, 0];
    links[i + 1].push(
      ...between(
        { frame: own, from: Math.min(0, -d - high), to: Math.max(0, -d - low), color },
        rod,
        THREE,
      ),
    );
    const normal = standard
      ? { link: i + 1, frame: own, color }
      : {
          link: i,
          frame: new THREE.Matrix4(),
          color: COLORS[(i + COLORS.length - 1) % COLORS.length],
        };
    if (Math.abs(a) > 1e-9) links[normal.link].push(lying(normal, rod, a, THREE));
    // What the joint moves on belongs to the link before it.
    const axis = new THREE.Matrix4();
    if (!standard) axis.set(1, 0, 0, a, 0, c, -s, 0, 0, s, c, 0, 0, 0, 0, 1);
    links[i].push(
      sliding ? block(axis, drum, color, THREE) : cylinder(axis, drum, -drum, drum, color, THREE),
    );
  });
  const reach = Math.hypot(tool[3], tool[7], tool[11]),
    last = links[rows.length];
  if (reach > 1e-9)
    last.push(
      towards([tool[3], tool[7], tool[11]], 0.7 * rod, COLORS[rows.length % COLORS.length], THREE),
    );
  return [...links, fingers(rod, THREE)];
}

function between({ frame, from, to, color }, radius, THREE) {
  return Math.abs(to - from) > 1e-9 ? [cylinder(frame, radius, from, to, color, THREE)] : [];
}

// A cylinder along z of a frame.
function cylinder(frame, radius, from, to, color, THREE) {
  const mesh = new THREE.Mesh(
    new THREE.CylinderGeometry(radius, radius, Math.abs(to - from), 32),
    material(color, THREE),
  );
  const stand = new THREE.Matrix4().makeRotationX(Math.PI / 2).setPosition(0, 0, (from + to) / 2);
  return placed(mesh, new THREE.Matrix4().multiplyMatrices(frame, stand));
}

// A cylinder along x of a frame, from its origin.
function lying({ frame, color }, radius, length, THREE) {
  const mesh = new THREE.Mesh(
    new THREE.CylinderGeometry(radius, radius, Math.abs(length), 32),
    material(color, THREE),
  );
  const turn = new THREE.Matrix4().makeRotationZ(Math.PI / 2).setPosition(length / 2, 0, 0);
  return placed(mesh, new THREE.Matrix4().multiplyMatrices(frame, turn));
}

// What shows the tool's frame: two fingers along its z, open along its x.
function fingers(width, THREE) {
  return [-1, 1].map((side) => {
    const mesh = new THREE.Mesh(
      new THREE.BoxGeometry(0.5 * width, width, 3 * width),
      material("#5b6472", THREE),
    );
    mesh.position.set(1.2 * side * width, 0, 1.5 * width);
    return mesh;
  });
}

function towards(point, radius, color, THREE) {
  const end = new THREE.Vector3(...point),
    mesh = new THREE.Mesh(
      new THREE.CylinderGeometry(radius, radius, end.length(), 32),
      material(color, THREE),
    );
  mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), end.clone().normalize());
  mesh.position.copy(end).multiplyScalar(0.5);
  return mesh;
}

function block(frame, half, color, THREE) {
  return placed(
    new THREE.Mesh(new THREE.BoxGeometry(1.7 * half, 1.7 * half, 2 * half), material(color, THREE)),
    frame,
  );
}

function placed(mesh, matrix) {
  matrix.decompose(mesh.position, mesh.quaternion, mesh.scale);
  return mesh;
}

function material(color, THREE) {
  return new THREE.MeshPhongMaterial({ color, shininess: 40, specular: 0x222222 });
}
