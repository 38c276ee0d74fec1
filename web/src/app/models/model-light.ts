// Lights models as on a bright day, so that a white roof is white in an image without tone mapping. There are no
// shadows.
import * as THREE from 'three';

const kSky = new THREE.Color(0xdfe9f5);
const kGround = new THREE.Color(0x8d877c);

export function addLight(world: THREE.Scene, renderer: THREE.WebGLRenderer): void {
  const sun = new THREE.DirectionalLight(0xfff4e4, 1.35);
  sun.position.set(0.5, 1, 0.35);
  world.add(new THREE.HemisphereLight(kSky, kGround, 0.4), sun);
  let target: THREE.WebGLRenderTarget | undefined;
  const reflect = () => {
    target?.dispose();
    target = surroundings(renderer);
    world.environment = target.texture;
    world.environmentIntensity = 0.6;
  };
  reflect();
  renderer.domElement.addEventListener('webglcontextrestored', reflect);
}

// Renders the environment that metal reflects: the same sky and ground.
function surroundings(renderer: THREE.WebGLRenderer): THREE.WebGLRenderTarget {
  const sphere = new THREE.SphereGeometry(10, 16, 32);
  const heights = sphere.getAttribute('position');
  const colours = new THREE.BufferAttribute(new Float32Array(3 * heights.count), 3);
  for (let i = 0; i < heights.count; ++i) {
    const upwards = THREE.MathUtils.smoothstep(heights.getY(i), -1.5, 1.5);
    const { r, g, b } = kGround.clone().lerp(kSky, upwards);
    colours.setXYZ(i, r, g, b);
  }
  sphere.setAttribute('color', colours);
  const material = new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.BackSide });
  const maker = new THREE.PMREMGenerator(renderer);
  const target = maker.fromScene(new THREE.Scene().add(new THREE.Mesh(sphere, material)), 0.02);
  maker.dispose();
  sphere.dispose();
  material.dispose();
  return target;
}
