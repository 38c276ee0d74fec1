// The mesh that shows a rendered scene in three.js: a full-screen triangle that is blended over the opaque objects and
// writes the depth buffer, so that objects drawn later and the scene hide each other.
import * as THREE from 'three';
import { kDisplayConstants } from './display-modes';
import type { DrawnPicture } from './scene-drawer';
import { screenTriangle } from './screen-triangle';

export const kFirstRenderOrder = -1e9; // first of the transparent objects

// What is linear in a picture is interpolated, as drivers for the CPU read uniforms slowly.
const kVertexShader = `
uniform vec4 part;
uniform vec2 resolution;
uniform mat3 origin, ray;
uniform mat4 clipFromScene;
varying vec2 place;  // in the image
flat varying vec4 placeLimits;
varying vec3 rayDirection;  // not normalised
varying vec4 clipAlongRay;  // depth and w at its origin; their increases along rayDirection
void main() {
  vec3 ndc = vec3(position.xy, 1.0);
  place = (part.xy + (0.5 + 0.5 * ndc.xy) * part.zw) / resolution;
  // Filtering must never read texels of another picture.
  placeLimits = vec4(part.xy + 0.5, part.xy + part.zw - 0.5) / resolution.xyxy;
  rayDirection = ray * ndc;
  clipAlongRay = vec4((clipFromScene * vec4(origin * ndc, 1.0)).zw, (clipFromScene * vec4(rayDirection, 0.0)).zw);
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const kFragmentShader = `
uniform sampler2D colourAndOpacity, distanceAndOpacity;
varying vec2 place;
flat varying vec4 placeLimits;
varying vec3 rayDirection;
varying vec4 clipAlongRay;
uniform sampler2D opaqueDepth;
uniform int display;
// Maps 0 (near) to 1 (far) to a colour ramp with two intermediate colours.
vec3 colourOfDistance(float x) {
  vec3 colour = mix(vec3(1.0, 0.93, 0.7), vec3(0.96, 0.55, 0.25), clamp(3.0 * x, 0.0, 1.0));
  colour = mix(colour, vec3(0.62, 0.16, 0.42), clamp(3.0 * x - 1.0, 0.0, 1.0));
  return mix(colour, vec3(0.08, 0.07, 0.3), clamp(3.0 * x - 2.0, 0.0, 1.0));
}
void main() {
  vec2 at = clamp(place, placeLimits.xy, placeLimits.zw);
  vec4 colour = texture2D(colourAndOpacity, at);
  vec4 far = texture2D(distanceAndOpacity, at);
  float opaque = texture2D(opaqueDepth, at).r;
  gl_FragDepth = opaque;
  if (far.a > 0.99) {  // at least half of what is behind is hidden
    float surface = far.r / far.a;
#ifdef DISTANCES_OF_BYTES
    surface /= max(1.0 - surface, 1e-3);
#endif
    vec2 clip = clipAlongRay.xy + surface / length(rayDirection) * clipAlongRay.zw;
    gl_FragDepth = min(opaque, clamp(0.5 + 0.5 * clip.x / clip.y, 0.0, 1.0));
    // The ramp spans seven octaves, from a tenth of half a block's edge on.
    if (display == kShowDepth) colour.rgb = colour.a * colourOfDistance(clamp(log2(surface / 0.1) / 7.0, 0.0, 1.0));
  }
  // The colours are premultiplied and in the photos' colour space; three.js converts them to that of the output.
  gl_FragColor = vec4(colour.a > 0.0 ? sRGBTransferEOTF(vec4(colour.rgb / colour.a, 1.0)).rgb : vec3(0.0), 1.0);
  #include <colorspace_fragment>
  gl_FragColor = vec4(gl_FragColor.rgb * colour.a, colour.a);
}`;

export function cityMesh(drawn: DrawnPicture): THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> {
  const { view, colour, distance, distancesOfBytes } = drawn;
  const material = new THREE.ShaderMaterial({
    vertexShader: kVertexShader,
    fragmentShader: `${kDisplayConstants}\n${kFragmentShader}`,
    uniforms: {
      colourAndOpacity: { value: colour },
      distanceAndOpacity: { value: distance },
      part: { value: new THREE.Vector4() },
      clipFromScene: { value: new THREE.Matrix4() },
      origin: { value: new THREE.Matrix3() },
      ray: { value: new THREE.Matrix3() },
      resolution: view.resolution,
      opaqueDepth: view.opaqueDepth,
      display: view.display,
    },
    defines: distancesOfBytes ? { DISTANCES_OF_BYTES: '' } : {},
    transparent: true, // drawn after the opaque objects
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
  mesh.visible = false; // until there is an image
  mesh.renderOrder = kFirstRenderOrder;
  mesh.raycast = () => {};
  // Cameras other than those that were rendered show the first picture.
  mesh.onBeforeRender = (_renderer, _scene, camera) => {
    const { uniforms } = material;
    const { part, origin, ray, clipFromScene } = drawn.pictures.find((one) => one.camera === camera) ?? drawn.pictures[0];
    for (const [name, value] of Object.entries({ part, origin, ray, clipFromScene })) uniforms[name].value = value;
    material.uniformsNeedUpdate = true; // for each camera rather than once a frame
  };
  return mesh;
}
