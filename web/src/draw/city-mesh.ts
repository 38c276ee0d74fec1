// The picture of a scene as a part of three's own: a triangle that fills the screen, blended over what is opaque, and
// written into the depth buffer, so that what is drawn later is hidden by the scene and hides it.
import * as THREE from 'three';
import type { Compositor } from './compositor';
import { screenTriangle } from './compositor';

const kVertexShader = `
void main() {
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const kFragmentShader = `
uniform sampler2D colourAndOpacity, distanceAndOpacity;
uniform vec2 pictureSize;
uniform mat3 origin, ray;
uniform mat4 clipFromScene;
uniform sampler2D opaqueDepth;
void main() {
  vec2 place = gl_FragCoord.xy / pictureSize;
  vec4 colour = texture2D(colourAndOpacity, place);
  vec4 far = texture2D(distanceAndOpacity, place);
  float opaque = 1.0;
#ifdef OPAQUE
  opaque = texture2D(opaqueDepth, place).r;
#endif
  gl_FragDepth = opaque;
  if (far.a > 0.5) {
    vec2 ndc = 2.0 * place - 1.0;
    vec3 x = origin * vec3(ndc, 1.0) + far.r / far.a * normalize(ray * vec3(ndc, 1.0));
    vec4 clip = clipFromScene * vec4(x, 1.0);
    gl_FragDepth = min(opaque, clamp(0.5 + 0.5 * clip.z / clip.w, 0.0, 1.0));
  }
  // Premultiplied, in the colours of the photos: three converts what a canvas does not take as it is.
  gl_FragColor = vec4(colour.a > 0.0 ? sRGBTransferEOTF(vec4(colour.rgb / colour.a, 1.0)).rgb : vec3(0.0), 1.0);
  #include <colorspace_fragment>
  gl_FragColor = vec4(gl_FragColor.rgb * colour.a, colour.a);
}`;

export function cityMesh({ view, target }: Compositor): THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> {
  const material = new THREE.ShaderMaterial({
    vertexShader: kVertexShader,
    fragmentShader: kFragmentShader,
    uniforms: {
      colourAndOpacity: { value: target.textures[0] },
      distanceAndOpacity: { value: target.textures[1] },
      pictureSize: { value: new THREE.Vector2(1, 1) },
      clipFromScene: { value: new THREE.Matrix4() },
      origin: view.origin,
      ray: view.ray,
      opaqueDepth: view.opaqueDepth,
    },
    transparent: true, // after what is opaque
    depthFunc: THREE.AlwaysDepth,
    blending: THREE.CustomBlending,
    blendSrc: THREE.OneFactor,
    blendDst: THREE.OneMinusSrcAlphaFactor,
    premultipliedAlpha: true,
    toneMapped: false,
    fog: false,
  });
  const mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>(screenTriangle(), material);
  mesh.name = 'scene';
  mesh.frustumCulled = false;
  mesh.renderOrder = -1e9; // the first of what is transparent
  mesh.raycast = () => {};
  mesh.onBeforeRender = (renderer) => {
    renderer.getCurrentViewport(viewport);
    material.uniforms.pictureSize.value.set(viewport.z, viewport.w);
  };
  return mesh;
}

const viewport = new THREE.Vector4();
