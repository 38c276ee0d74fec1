import * as THREE from 'three';

// The vertex shader of passes that draw it (RawShaderMaterial, GLSL 3).
export const kScreenVertexShader = `
in vec3 position;
void main() {
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

// Returns a triangle that fills the screen.
export function screenTriangle(): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
  return geometry;
}
