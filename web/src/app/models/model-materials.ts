// What models are made of, as it is to look in a city: by day, and all in the same light.
import * as THREE from 'three';

// Takes out what does not belong there; the box of the rest.
export function prepareModel(object: THREE.Object3D): THREE.Box3 {
  const others: THREE.Object3D[] = [];
  const made = new Map<THREE.Material, THREE.Material>();
  const replace = (material: THREE.Material) => {
    const known = made.get(material) ?? prepareMaterial(material);
    made.set(material, known);
    return known;
  };
  object.traverse((one) => {
    if ((one as THREE.Light).isLight || (one as THREE.Camera).isCamera) others.push(one);
    if (one.name === '') one.name = one.uuid; // animations know it by that, and copies have another
    const mesh = one as THREE.SkinnedMesh;
    if (mesh.material) mesh.material = Array.isArray(mesh.material) ? mesh.material.map(replace) : replace(mesh.material);
    if (mesh.skeleton) mesh.frustumCulled = false; // its sphere is of the pose at rest
  });
  for (const one of others) {
    // What hangs on it stays where it is.
    const holder = new THREE.Group();
    holder.name = one.name;
    holder.position.copy(one.position);
    holder.quaternion.copy(one.quaternion);
    holder.scale.copy(one.scale);
    one.parent?.add(holder);
    holder.add(...one.children);
    one.removeFromParent();
  }
  object.updateMatrixWorld(true);
  return new THREE.Box3().setFromObject(object);
}

function prepareMaterial(material: THREE.Material): THREE.Material {
  const fields = material as unknown as Record<string, unknown>;
  for (const [key, value] of Object.entries(fields)) {
    if (value instanceof THREE.Texture && (!value.image || (value.image as { data?: unknown }).data === null)) fields[key] = null; // it did not come
  }
  const { isMeshPhongMaterial, isMeshLambertMaterial } = fields;
  if (isMeshPhongMaterial || isMeshLambertMaterial) return standardOf(material as THREE.MeshPhongMaterial);
  // Glass: three would show through it what is opaque alone, and the city is not.
  const { transmission } = material as THREE.MeshPhysicalMaterial;
  if (transmission > 0) {
    const opacity = material.opacity * (1 - 0.7 * Math.min(transmission, 1));
    Object.assign(material, { transmission: 0, transparent: true, depthWrite: false, opacity });
  }
  return material;
}

const kAlike = [
  'color', 'map', 'emissive', 'emissiveMap', 'emissiveIntensity', 'alphaMap', 'aoMap', 'aoMapIntensity', 'bumpMap', 'bumpScale',
  'normalMap', 'normalMapType', 'normalScale', 'displacementMap', 'displacementScale', 'displacementBias', 'flatShading', 'wireframe',
] as const;

// Older kinds as they look where light is measured: dull.
function standardOf(material: THREE.MeshPhongMaterial): THREE.MeshStandardMaterial {
  const standard = new THREE.MeshStandardMaterial();
  THREE.Material.prototype.copy.call(standard, material);
  for (const key of kAlike) Object.assign(standard, { [key]: material[key] });
  Object.assign(standard, { roughness: 0.8, metalness: 0 });
  return standard;
}
