// Measurements in the world: lines, dots and areas that are visible through everything and have a constant size on the
// screen.
import * as THREE from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import type { Vec3 } from '../../tiles/tileset';
import type { GroundFrame } from './geodesy';
import { corner, onPlane, type Measurement } from './measurement';

const kAccent = 0x6fc2d0;
const kShade = 0x0b1013; // outline that makes bright marks visible on bright ground
// Visible through everything; transparent, so that it ends no rays of the scene.
const kThrough = { transparent: true, depthTest: false, depthWrite: false, toneMapped: false } as const;

const kDotVertexShader = `
uniform float pixelRatio;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_PointSize = 13.0 * pixelRatio;
}`;

const kDotFragmentShader = `
uniform vec3 shade;
uniform float pixelRatio;
void main() {
  float radius = 13.0 * length(gl_PointCoord - 0.5);
  float soft = 0.5 / pixelRatio;
  float outer = 1.0 - smoothstep(6.0 - soft, 6.0 + soft, radius);
  gl_FragColor = vec4(mix(vec3(1.0), shade, smoothstep(4.2 - soft, 4.2 + soft, radius)), outer);
  #include <colorspace_fragment>
}`;

type Segment = readonly [Vec3, Vec3];

export class MeasuringMarks {
  readonly group = new THREE.Group();
  private readonly shade = new LineMaterial({ color: kShade, linewidth: 5, opacity: 0.6, ...kThrough });
  private readonly thinShade = new LineMaterial({ color: kShade, linewidth: 3, opacity: 0.5, ...kThrough });
  private readonly line = new LineMaterial({ color: kAccent, linewidth: 2.5, ...kThrough });
  private readonly thinLine = new LineMaterial({ color: 0xffffff, linewidth: 1.5, opacity: 0.8, ...kThrough });
  private readonly fill = new THREE.MeshBasicMaterial({ color: kAccent, opacity: 0.28, side: THREE.DoubleSide, ...kThrough });
  private readonly dot = new THREE.ShaderMaterial({
    vertexShader: kDotVertexShader,
    fragmentShader: kDotFragmentShader,
    uniforms: { pixelRatio: { value: 1 }, shade: { value: new THREE.Color(kShade) } },
    ...kThrough,
  });
  private readonly geometries: THREE.BufferGeometry[] = [];

  constructor() {
    this.group.name = 'measurements';
    this.group.userData.isTool = true;
  }

  // Replaces the marks.
  show(measurements: readonly Measurement[], frame: GroundFrame): void {
    this.clear();
    const [lines, thinLines, triangles]: [Segment[], Segment[], Vec3[]] = [[], [], []];
    for (const { kind, places } of measurements) {
      if (kind === 'height' && places.length === 2) {
        const foot = corner(places, frame);
        const isUp = frame.height(places[1]) > frame.height(places[0]);
        lines.push([foot, places[isUp ? 1 : 0]]);
        thinLines.push([foot, places[isUp ? 0 : 1]]);
        continue;
      }
      for (let i = 1; i < places.length; ++i) lines.push([places[i - 1], places[i]]);
      if (kind !== 'area' || places.length < 3) continue;
      lines.push([places[places.length - 1], places[0]]);
      const flat = onPlane(places).map(([x, y]) => new THREE.Vector2(x, y));
      for (const corners of THREE.ShapeUtils.triangulateShape(flat, [])) triangles.push(...corners.map((i) => places[i]));
    }
    if (triangles.length > 0) this.add(new THREE.Mesh(this.withPositions(new THREE.BufferGeometry(), triangles), this.fill), 0);
    this.addLines(thinLines, this.thinShade, this.thinLine);
    this.addLines(lines, this.shade, this.line);
    const dots = measurements.flatMap(({ places }) => places);
    if (dots.length === 0) return;
    const points = new THREE.Points(this.withPositions(new THREE.BufferGeometry(), dots), this.dot);
    points.onBeforeRender = (renderer) => (this.dot.uniforms.pixelRatio.value = renderer.getPixelRatio());
    this.add(points, 3);
  }

  // Frees the GPU memory.
  clear(): void {
    for (const geometry of this.geometries) geometry.dispose();
    this.geometries.length = 0;
    this.group.clear();
  }

  dispose(): void {
    this.clear();
    for (const material of [this.shade, this.thinShade, this.line, this.thinLine, this.fill, this.dot]) material.dispose();
    this.group.removeFromParent();
  }

  private addLines(segments: readonly Segment[], shade: LineMaterial, material: LineMaterial): void {
    if (segments.length === 0) return;
    const geometry = new LineSegmentsGeometry().setPositions(segments.flat().flat());
    this.geometries.push(geometry);
    this.add(new LineSegments2(geometry, shade), 1);
    this.add(new LineSegments2(geometry, material), 2);
  }

  private add(object: THREE.Object3D, order: number): void {
    object.renderOrder = 1e6 + order;
    object.frustumCulled = false;
    this.group.add(object);
  }

  private withPositions(geometry: THREE.BufferGeometry, places: readonly Vec3[]): THREE.BufferGeometry {
    this.geometries.push(geometry);
    return geometry.setAttribute('position', new THREE.Float32BufferAttribute(places.flat(), 3));
  }
}
