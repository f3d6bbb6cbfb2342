// Outlines of links, as wide on screen wherever they are, and the gap between two of them: the arm keeps its colors.

import { bareCopy } from "./overlays.js";

const WIDTH = 3; // px
const STENCIL_ORDER = 0.5; // after the arm and before the outlines
const ROD = 0.004,
  END = 0.009; // radii of the gap's rod and ends, share of the arm's size

export class Outlines {
  constructor(scene, THREE) {
    this.THREE = THREE;
    this.group = new THREE.Group();
    this.links = []; // of each outlined link: {node, copy, stencil}
    this.size = { value: new THREE.Vector2(1, 1) }; // px
    this.materials = new Map();
    this.stencil = new THREE.MeshBasicMaterial({
      colorWrite: false,
      depthWrite: false,
      depthTest: false,
      side: THREE.DoubleSide,
      stencilWrite: true,
      stencilRef: 1,
      stencilZPass: THREE.ReplaceStencilOp,
    });
    this.gap = this.rod();
    scene.add(this.group, this.gap);
  }

  resize(width, height) {
    this.size.value.set(width, height);
  }

  // colors: of each node, the name of a CSS variable, or null for none.
  set(colors, nodes) {
    this.group.clear();
    this.links = colors.flatMap((name, node) =>
      name ? [this.outline(nodes[node], node, name)] : [],
    );
    for (const { copy, stencil } of this.links) this.group.add(stencil, copy);
    this.place(nodes);
  }

  // The link itself, which only marks where it is on screen, and its outline, which is drawn where it is not.
  outline(object, node, name) {
    const copy = bareCopy(object, this.material(name), this.THREE);
    const stencil = bareCopy(object, this.stencil, this.THREE);
    stencil.traverse((part) => (part.renderOrder = STENCIL_ORDER));
    return { node, copy, stencil };
  }

  place(nodes) {
    for (const { node, copy, stencil } of this.links) {
      for (const object of [copy, stencil]) {
        object.position.copy(nodes[node].position);
        object.quaternion.copy(nodes[node].quaternion);
      }
    }
  }

  // points: the two ends, or null; size: the arm's.
  setGap(points, size) {
    this.gap.visible = Boolean(points);
    if (!points) return;
    const { THREE } = this,
      [from, to] = points.map((point) => new THREE.Vector3().fromArray(point));
    const along = to.clone().sub(from),
      length = along.length(),
      [rod, ...ends] = this.gap.children;
    rod.visible = length > 0;
    if (length > 0)
      rod.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
    rod.position.addVectors(from, to).multiplyScalar(0.5);
    rod.scale.set(ROD * size, length, ROD * size);
    ends.forEach((end, k) => {
      end.position.copy(k ? to : from);
      end.scale.setScalar(END * size);
    });
  }

  color() {
    const style = getComputedStyle(document.documentElement);
    for (const [name, material] of this.materials)
      material.color.set(style.getPropertyValue(name).trim());
    this.gapMaterial.color.set(style.getPropertyValue("--wrong").trim());
  }

  // The back sides of a surface that is moved outwards: what is left of it around the surface is the outline.
  material(name) {
    if (this.materials.has(name)) return this.materials.get(name);
    const material = new this.THREE.MeshBasicMaterial({
      side: this.THREE.BackSide,
      stencilWrite: true,
      stencilRef: 1,
      stencilFunc: this.THREE.NotEqualStencilFunc,
    });
    material.onBeforeCompile = (shader) => {
      shader.uniforms.size = this.size;
      shader.vertexShader = `uniform vec2 size;\n${shader.vertexShader}`.replace(
        "#include <project_vertex>",
        `#include <project_vertex>
        vec2 outwards = (projectionMatrix * vec4(normalMatrix * normal, 0.0)).xy;
        gl_Position.xy += outwards / max(length(outwards), 1e-6) * gl_Position.w * ${(2 * WIDTH).toFixed(1)} / size;`,
      );
    };
    this.materials.set(name, material);
    this.color();
    return material;
  }

  rod() {
    const { THREE } = this,
      group = new THREE.Group(),
      look = { depthTest: false, transparent: true };
    const material = new THREE.MeshBasicMaterial(look);
    this.gapMaterial = material;
    for (const geometry of [
      new THREE.CylinderGeometry(1, 1, 1, 8),
      new THREE.SphereGeometry(1, 12, 8),
      new THREE.SphereGeometry(1, 12, 8),
    ]) {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.renderOrder = 8;
      group.add(mesh);
    }
    group.visible = false;
    return group;
  }
}
