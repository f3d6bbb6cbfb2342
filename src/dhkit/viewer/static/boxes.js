// Points and boxes of the scene.

const { THREE } = MeshCat;

// meshcat lays the world (z up) on its back inside a scene with y up, where its camera is.
export function inView(v) {
  return new THREE.Vector3(v.x, v.z, -v.y);
}

export function corners(box) {
  const { min, max } = box;
  const points = [];
  for (const x of [min.x, max.x])
    for (const y of [min.y, max.y])
      for (const z of [min.z, max.z]) points.push(new THREE.Vector3(x, y, z));
  return points;
}

// The box around a node's parts, triads left out, in the node's own axes.
export function localBox(node) {
  const box = new THREE.Box3();
  node.updateMatrixWorld(true);
  const inverse = node.matrixWorld.clone().invert();
  for (const part of node.children.filter((child) => child.name !== "frame")) {
    part.traverse((object) => {
      if (!object.geometry) return;
      if (!object.geometry.boundingBox) object.geometry.computeBoundingBox();
      const own = object.geometry.boundingBox.clone();
      box.union(
        own.applyMatrix4(new THREE.Matrix4().multiplyMatrices(inverse, object.matrixWorld)),
      );
    });
  }
  return box;
}
