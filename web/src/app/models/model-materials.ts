// Adapts the materials of models to the city: daylight, and the same light for all.
import * as THREE from 'three';

// Removes lights and cameras from a model, and returns the bounding box of the rest.
export function prepareModel(object: THREE.Object3D): THREE.Box3 {
  const others: THREE.Object3D[] = [];
  const replacements = new Map<THREE.Material, THREE.Material>();
  const replace = (material: THREE.Material) => {
    const known = replacements.get(material) ?? prepareMaterial(material);
    replacements.set(material, known);
    return known;
  };
  object.traverse((one) => {
    if ((one as THREE.Light).isLight || (one as THREE.Camera).isCamera) others.push(one);
    if (one.name === '') one.name = one.uuid; // animations refer to objects by name, and copies have another uuid
    const mesh = one as THREE.SkinnedMesh;
    if (mesh.material) mesh.material = Array.isArray(mesh.material) ? mesh.material.map(replace) : replace(mesh.material);
    if (mesh.skeleton) mesh.frustumCulled = false; // its bounding sphere is that of the rest pose
  });
  for (const one of others) {
    // Children of a removed object keep their place.
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
    // The texture was not provided.
    if (value instanceof THREE.Texture && (!value.image || (value.image as { data?: unknown }).data === null)) fields[key] = null;
  }
  const { isMeshPhongMaterial, isMeshLambertMaterial } = fields;
  if (isMeshPhongMaterial || isMeshLambertMaterial) return toStandardMaterial(material as THREE.MeshPhongMaterial);
  // Glass: the transmission of three.js would show only opaque objects behind it, and the city is transparent.
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

// Converts older material types to physically based ones that look matt.
function toStandardMaterial(material: THREE.MeshPhongMaterial): THREE.MeshStandardMaterial {
  const standard = new THREE.MeshStandardMaterial();
  THREE.Material.prototype.copy.call(standard, material);
  for (const key of kAlike) Object.assign(standard, { [key]: material[key] });
  Object.assign(standard, { roughness: 0.8, metalness: 0 });
  return standard;
}
