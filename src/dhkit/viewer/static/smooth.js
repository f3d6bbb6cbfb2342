// Normals of a mesh of loose triangles (STL): smooth over shallow edges, sharp over others.

const CREASE = Math.cos((32 * Math.PI) / 180);
const MOST = 600000; // corners; beyond, smoothing would hold the page up for seconds

export function smoothNormals(geometry, THREE) {
  const position = geometry.attributes.position;
  if (geometry.index || position.count > MOST) return;
  const faces = faceNormals(position, THREE);
  const around = cornersByPlace(geometry, position);
  const normals = new Float32Array(3 * position.count),
    sum = new THREE.Vector3();
  for (const corners of around.values()) {
    for (const corner of corners) {
      const own = faces[Math.floor(corner / 3)];
      sum.set(0, 0, 0);
      for (const other of corners) {
        const { normal, area } = faces[Math.floor(other / 3)];
        if (own.normal.dot(normal) > CREASE) sum.addScaledVector(normal, area);
      }
      (sum.lengthSq() > 0 ? sum.normalize() : sum.copy(own.normal)).toArray(normals, 3 * corner);
    }
  }
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
}

function faceNormals(position, THREE) {
  const at = (i) => new THREE.Vector3().fromBufferAttribute(position, i);
  const faces = [];
  for (let i = 0; i < position.count; i += 3) {
    const a = at(i),
      normal = at(i + 1)
        .sub(a)
        .cross(at(i + 2).sub(a));
    const area = normal.length();
    faces.push({ normal: normal.normalize(), area });
  }
  return faces;
}

// Corners that lie at the same place, to a hundred-thousandth of the mesh's size.
function cornersByPlace(geometry, position) {
  geometry.computeBoundingSphere();
  const cell = 1e-5 * geometry.boundingSphere.radius || 1;
  const around = new Map();
  for (let i = 0; i < position.count; i++) {
    const key = [position.getX(i), position.getY(i), position.getZ(i)]
      .map((x) => Math.round(x / cell))
      .join();
    if (around.has(key)) around.get(key).push(i);
    else around.set(key, [i]);
  }
  return around;
}
