// Draws `mesh` contents (UE4-NeRF): triangles into images of what is visible, then one evaluation of a network per pixel.
// Half-transparent triangles are dithered, and frames are blended. See web/README.md.
import * as THREE from 'three';
import { colourOfBlock, colourOfLevel } from '../../draw/display-modes';
import { kMaxHiddenBoxes, selectHiddenBoxes, type HiddenBoxes } from '../../draw/hidden-boxes';
import { farthestDepth } from '../../draw/opaque-depth';
import { drawIntoTargets } from '../../draw/own-targets';
import { isParallel, type Picture } from '../../draw/picture';
import { pixelAt, placeAtDistance } from '../../draw/read-surface';
import { kFarAway, type ContentPlace, type DrawnPart, type DrawnScene, type DrawSettings, type SceneDrawer, type SceneView } from '../../draw/scene-drawer';
import { screenTriangle } from '../../draw/screen-triangle';
import type { Box } from '../../tiles/tileset';
import { bytesOfPart, type MeshHeader } from './decode-mesh';
import { patchesAcross, textureSize, type MeshContent, type MeshPart } from './mesh-content';
import { kMeshModes } from './mesh-modes';
import { MeshTargets } from './mesh-targets';
import { MeshTextures } from './mesh-textures';
import { kSortShader, kWholeScreen, PartColours, rectangleMaterial, type ColouredPart } from './part-colours';
import { blendMaterial, kCopyShader, kSkyShader, objectsMaterial, passMaterial } from './passes';
import { joinRuns, makeChunks, screenRectangle, selectChunks, visibleHalfSpaces, type PatchChunk, type ScreenRectangle } from './patch-chunks';
import { bytesOfIndices, drawRange, patchGeometry } from './patch-geometry';
import { distanceToBox, distanceToSides, jittered, frameJitter, rasterProjection, referencePoint, relativeOrigin, relativeTo, matrixRow } from './picture-place';
import { rasterMaterial, type RasterForm, type RasterKind } from './raster-program';

const kWeightInMotion = 0.6; // of a frame; docs/benchmarks.md says why
const kDepthSteps = 4; // between the depths of equal triangles
const kDepthOrders = 4; // parts that may have equal triangles are few, and offsets must not exceed distances of surfaces
const kCosineOfCut = 0.96; // a camera that turns by more than 16° between frames has jumped
const kAllPixels = [0, 1] as const;
const kEverywhere: Box = { low: [-1e9, -1e9, -1e9], high: [1e9, 1e9, 1e9] };

type Uniforms = Record<string, THREE.IUniform>;
type TriangleMesh = THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;

interface DrawnMeshPart {
  part: MeshPart;
  coloured: ColouredPart;
  geometry: THREE.BufferGeometry;
  chunks: PatchChunk[];
  uniforms: Uniforms;
  meshes: Map<string, TriangleMesh[]>; // of each form, one for each time that it is drawn in a picture
}

export interface DrawnMesh {
  id: number;
  box: Box;
  isBackground: boolean;
  textures: MeshTextures;
  parts: DrawnMeshPart[];
}

// What the last frame showed.
interface LastFrame {
  key: string;
  isDrawn: boolean;
  pictures: { clipFromScene: THREE.Matrix4; part: THREE.Vector4; forward: THREE.Vector3 }[];
  contents: DrawnPart<DrawnMesh>[][];
  hidden: HiddenBoxes;
}

export class MeshDrawer implements SceneDrawer<MeshHeader, MeshContent, DrawnMesh> {
  readonly view = { resolution: { value: new THREE.Vector2(1, 1) }, opaqueDepth: { value: null as THREE.Texture | null }, display: { value: 0 } };
  readonly featureLevels = 0;
  readonly crossFades = true;
  pictures: Picture[] = [];
  private readonly targets: MeshTargets;
  private readonly screen = screenTriangle();
  private readonly nothingOpaque = farthestDepth();
  private readonly anyCamera = new THREE.Camera();
  private readonly triangles = new THREE.Scene();
  private readonly pass = new THREE.Scene();
  private readonly uniforms: Uniforms; // of triangles and passes
  private readonly passes: Record<'objects' | 'sort' | 'sky' | 'blend' | 'copy', TriangleMesh>;
  private readonly colours: PartColours;
  private readonly prepared = new Map<string, TriangleMesh>(); // keeps programs alive
  private lastId = 0;
  private last?: LastFrame;
  private framesAtRest = 0; // whose mean the history is; 0: the last frame showed another view
  private wantedFrames = 1;
  private framesInMotion = 0;
  private isGeneral = false; // whether all contents need programs for whatever is seldom needed

  // Throws SceneError if the GPU cannot draw such a scene.
  constructor(private readonly renderer: THREE.WebGLRenderer, private readonly scene: DrawnScene) {
    this.targets = new MeshTargets(renderer);
    const { output, solid, dithered, decoded, history } = this.targets;
    this.uniforms = {
      ...this.view,
      part: { value: new THREE.Vector4() }, jitter: { value: new THREE.Vector2() }, origin: { value: new THREE.Matrix3() }, ray: { value: new THREE.Matrix3() },
      clipFromReference: { value: new THREE.Matrix4() }, depthRow: { value: new THREE.Vector4() }, wRow: { value: new THREE.Vector4() },
      sceneNear: { value: scene.near }, visibility: { value: kFarAway },
      sceneLow: { value: new THREE.Vector3() }, sceneHigh: { value: new THREE.Vector3() },
      withinBox: { value: false }, frame: { value: 0 },
      boxFromReference: { value: Array.from({ length: 2 * kMaxHiddenBoxes }, () => new THREE.Matrix4()) },
      visible: { value: dithered.texture }, solid: { value: solid.texture },
      decoded: { value: decoded.texture }, history: { value: history.texture },
      from: { value: output.target.textures[0] }, sky: { value: null },
      hasSurface: { value: false }, weight: { value: 1 }, hasHistory: { value: false }, isResting: { value: false },
      previousClip: { value: new THREE.Matrix4() }, previousPart: { value: new THREE.Vector4() },
    };
    this.colours = new PartColours(renderer, this.uniforms);
    const ofNoPart = { ...this.uniforms, partNumber: { value: 0 }, rectangle: { value: new THREE.Vector4(...kWholeScreen) } };
    this.passes = {
      objects: this.makePass(objectsMaterial(this.uniforms)),
      sort: this.makePass(passMaterial(kSortShader, this.uniforms)), sky: this.colours.makeMesh(rectangleMaterial(kSkyShader, ofNoPart)),
      blend: this.makePass(blendMaterial(this.uniforms)), copy: this.makePass(passMaterial(kCopyShader, this.uniforms)),
    };
    Object.assign(this.passes.sort.material, { depthTest: true, depthWrite: true, depthFunc: THREE.AlwaysDepth });
    const { defines } = this.passes.blend.material;
    if (this.distancesOfBytes) defines.DISTANCES_OF_BYTES = '';
    else if (this.distance.type === THREE.HalfFloatType) defines.DISTANCES_OF_HALF_FLOATS = '';
    for (const pass of Object.values(this.passes)) renderer.compile(pass, this.anyCamera);
    this.triangles.matrixWorldAutoUpdate = false;
  }

  get colour(): THREE.Texture {
    return this.targets.output.target.textures[0];
  }

  get distance(): THREE.Texture {
    return this.targets.output.target.textures[1];
  }

  get distancesOfBytes(): boolean {
    return this.targets.output.distancesOfBytes;
  }

  get bytesPerPixel(): number {
    return this.targets.bytesPerPixel;
  }

  get bytes(): number {
    return this.targets.bytes + this.colours.bytes + 4 * 9 + 1;
  }

  residentBytes({ parts, isCompressed, skyEdge }: MeshHeader): number {
    return parts.reduce((sum, part) => sum + bytesOfPart(part, isCompressed) + bytesOfIndices(part) + this.colours.bytesOfPart(part),
      24 * skyEdge * skyEdge);
  }

  prepare({ isCompressed, parts }: MeshHeader, { backgroundBlock }: ContentPlace): void {
    for (const kind of ['dithered', 'solid'] as const) {
      for (const isGeneral of [false, true]) {
        const form = { kind, isBackground: backgroundBlock, isGeneral };
        const key = JSON.stringify(form);
        if (this.prepared.has(key)) continue;
        const mesh = new THREE.Mesh(this.screen, rasterMaterial(form));
        this.prepared.set(key, mesh);
        this.renderer.compile(mesh, this.anyCamera);
      }
    }
    for (const part of parts) this.colours.prepare(part, isCompressed, this.anyCamera);
  }

  allocate(content: MeshContent, { box, backgroundBlock, number, level }: ContentPlace): DrawnMesh {
    const { isCompressed } = content;
    const textures = new MeshTextures(content);
    const parts = content.parts.flatMap((part, n): DrawnMeshPart[] => {
      if (part.patches === 0) return [];
      const coloured = this.colours.add(part, isCompressed, textures.parts[n], colourOfBlock(number), colourOfLevel(level), this.anyCamera);
      const uniforms = {
        ...this.uniforms,
        opacityTexels: { value: textures.parts[n].opacity },
        partNumber: { value: coloured.number },
        patchLayout: { value: new THREE.Vector2(part.patchEdge, patchesAcross(part)) },
        texelSize: { value: new THREE.Vector2(...textureSize(part).map((texels) => 1 / texels)) },
        // The same each time that the content is loaded, so that images are, too.
        firstLayer: { value: 0x10001 * (number + 1) + 0x1000193 * n },
        partOrigin: { value: new THREE.Vector3() }, partStep: { value: part.step },
        share: { value: new THREE.Vector2() }, withinLow: { value: new THREE.Vector3() }, withinHigh: { value: new THREE.Vector3() },
        hiddenBoxes: { value: 0 },
      };
      const { vertices } = content.texels[n];
      const geometry = patchGeometry(part, vertices);
      return [{ part, coloured, geometry, chunks: makeChunks(vertices), uniforms, meshes: new Map() }];
    });
    return { id: ++this.lastId, box, isBackground: backgroundBlock, textures, parts };
  }

  upload(content: DrawnMesh): 'more' | 'wait' | 'done' {
    if (!content.textures.upload(this.renderer)) return 'more';
    const isReady = ({ material }: TriangleMesh) => {
      const { currentProgram } = this.renderer.properties.get(material) as { currentProgram?: { isReady(): boolean } };
      return currentProgram?.isReady() ?? true;
    };
    return [...this.prepared.values()].every(isReady) && this.colours.areReady ? 'done' : 'wait';
  }

  free({ textures, parts }: DrawnMesh): void {
    textures.dispose();
    for (const { coloured, geometry, meshes } of parts) {
      this.colours.remove(coloured);
      geometry.dispose();
      for (const [{ material }] of meshes.values()) material.dispose();
    }
  }

  resize({ x, y }: THREE.Vector2): void {
    if (this.targets.resize(x, y)) this.last = undefined;
    this.view.resolution.value.set(x, y);
  }

  draw({ pictures, contents, opaqueDepth, hasOpaqueDepthChanged }: SceneView<DrawnMesh>, settings: DrawSettings): boolean {
    const key = JSON.stringify([
      pictures.map(({ clipFromScene, part }) => [clipFromScene.elements, part]),
      contents.map((parts) => parts.map(({ content: { id }, within, share }) => [id, within, share])), { ...settings, hidesOthers: false }, opaqueDepth !== null,
    ]);
    const isResting = this.last?.key === key && !hasOpaqueDepthChanged;
    this.pictures = pictures;
    this.uniforms.hasSurface.value &&= this.last?.key === key && !hasOpaqueDepthChanged;
    if (isResting && this.framesAtRest >= settings.framesAtRest) return this.last!.isDrawn;
    const hidden = selectHiddenBoxes(settings.hidden, settings.hiddenOfBackgroundBlock);
    this.view.opaqueDepth.value = opaqueDepth ?? this.nothingOpaque;
    this.view.display.value = kMeshModes.findIndex(({ name }) => name === settings.display);
    this.isGeneral = settings.visibility < kFarAway || settings.withinBox;
    this.uniforms.visibility.value = settings.visibility;
    this.uniforms.withinBox.value = settings.withinBox;
    // The frames at rest are a sequence of their own, so that images depend on the view alone.
    this.wantedFrames = settings.framesAtRest;
    this.framesAtRest = isResting ? this.framesAtRest + 1 : 0;
    this.uniforms.frame.value = isResting ? this.framesAtRest - 1 : this.framesInMotion++;
    this.uniforms.isResting.value = isResting;
    this.uniforms.jitter.value = isResting && settings.antialiases ? frameJitter(this.framesAtRest - 1) : new THREE.Vector2();
    this.uniforms.weight.value = isResting ? 1 / this.framesAtRest : kWeightInMotion;
    drawIntoTargets(this.renderer, pictures, () => {
      // What is solid is the same in all frames at rest. In motion it is drawn only if it is needed: it takes as long as
      // what is visible.
      if ((isResting || settings.hidesOthers) && !this.uniforms.hasSurface.value) this.drawSurfaces(pictures, contents, hidden);
      pictures.forEach((picture, i) => this.drawOne(picture, contents[i], settings, hidden, i, isResting));
      this.run([this.passes.copy], this.targets.history, pictures);
    });
    const isDrawn = contents.some((ofOne) => ofOne.length > 0);
    this.last = {
      key, isDrawn, contents, hidden,
      pictures: pictures.map((picture) => ({ clipFromScene: picture.clipFromScene, part: picture.part, forward: viewDirection(picture) })),
    };
    return isDrawn;
  }

  wantsAnotherFrame(): boolean {
    return this.framesAtRest < this.wantedFrames;
  }

  surfaceAt(renderer: THREE.WebGLRenderer, picture: Picture, at: THREE.Vector2): THREE.Vector3 | undefined {
    if (!this.last) return undefined;
    if (!this.uniforms.hasSurface.value) {
      const { contents, hidden } = this.last;
      drawIntoTargets(renderer, this.pictures, () => this.drawSurfaces(this.pictures, contents, hidden));
    }
    const distance = this.targets.readSolidDistance(renderer, pixelAt(picture, at));
    return distance === undefined ? undefined : placeAtDistance(picture, at, distance);
  }

  dispose(): void {
    this.targets.dispose();
    this.colours.dispose();
    this.screen.dispose();
    this.nothingOpaque.dispose();
    for (const { material } of [...Object.values(this.passes), ...this.prepared.values()]) material.dispose();
  }

  private makePass(material: THREE.RawShaderMaterial): TriangleMesh {
    const mesh = new THREE.Mesh(this.screen, material);
    mesh.frustumCulled = false;
    return mesh;
  }

  private run(passes: TriangleMesh[], target: THREE.WebGLRenderTarget, pictures: Picture[]): void {
    this.pass.children = passes;
    for (const { camera, part } of pictures) {
      target.viewport.copy(part);
      this.uniforms.part.value = part;
      this.renderer.setRenderTarget(target);
      this.renderer.render(this.pass, camera);
    }
    this.pass.children = [];
  }

  private drawSurfaces(pictures: readonly Picture[], contents: DrawnPart<DrawnMesh>[][], hidden: HiddenBoxes): void {
    const jitter = this.uniforms.jitter.value;
    this.uniforms.jitter.value = new THREE.Vector2(); // surfaces are those in the middles of pixels
    pictures.forEach((picture, i) => {
      this.drawTriangles(picture, contents[i], 'solid', this.targets.solid, this.place(picture, contents[i], hidden));
    });
    this.uniforms.jitter.value = jitter;
    this.uniforms.hasSurface.value = true;
  }

  private drawOne(picture: Picture, frontToBack: DrawnPart<DrawnMesh>[], settings: DrawSettings, hidden: HiddenBoxes, number: number, isResting: boolean): void {
    const { dithered, decoded, output } = this.targets;
    const point = this.place(picture, frontToBack, hidden);
    const isLayers = settings.display === 'layers';
    const isInspected = settings.display !== 'colour' && settings.display !== 'depth';
    const rectangles = isLayers ? undefined : this.drawTriangles(picture, frontToBack, isInspected ? 'inspected' : 'dithered', dithered, point);
    decoded.viewport.copy(picture.part);
    this.renderer.setRenderTarget(decoded);
    if (number === 0) this.renderer.clear();
    if (!rectangles) {
      for (const isBackground of [true, false]) this.renderTriangles(picture, frontToBack, 'layers', isBackground, decoded, point);
    } else {
      const sky = frontToBack.map(({ content }) => content.textures.sky).find((one) => one !== undefined);
      const passes = [...rectangles].map(([{ colours, inspector }, rectangle]) => {
        const [x, y] = [2 / picture.part.z, 2 / picture.part.w]; // a pixel more, against rounding
        colours.material.uniforms.rectangle.value.set(rectangle[0] - x, rectangle[1] - y, rectangle[2] + x, rectangle[3] + y);
        return isInspected ? inspector : colours;
      });
      if (sky && settings.endsRays && settings.display !== 'triangles' && settings.display !== 'alpha') {
        this.uniforms.sky.value = sky;
        passes.push(this.passes.sky);
      }
      this.run([this.passes.sort], decoded, [picture]);
      this.run(passes, decoded, [picture]);
    }
    const before = this.last?.pictures[number];
    const hasHistory = before !== undefined && before.forward.dot(viewDirection(picture)) > kCosineOfCut;
    this.uniforms.hasHistory.value = hasHistory && (isResting || !isLayers);
    if (before) {
      this.uniforms.previousClip.value = relativeTo(point, before.clipFromScene);
      this.uniforms.previousPart.value = before.part;
    }
    this.run([this.passes.blend], output.target, [picture]);
  }

  // Sets the uniforms of a picture, and returns its reference point.
  private place(picture: Picture, frontToBack: DrawnPart<DrawnMesh>[], { all, ofAllContents }: HiddenBoxes): THREE.Vector3 {
    const { uniforms, scene: { box } } = this;
    const point = referencePoint(picture);
    const clip = relativeTo(point, picture.clipFromScene);
    uniforms.part.value = picture.part;
    uniforms.origin.value = relativeOrigin(point, picture.origin);
    uniforms.ray.value = picture.ray;
    uniforms.depthRow.value = matrixRow(clip, 2);
    uniforms.wRow.value = matrixRow(clip, 3);
    uniforms.sceneLow.value.set(...box.low).sub(point);
    uniforms.sceneHigh.value.set(...box.high).sub(point);
    all.forEach((one, n) => (uniforms.boxFromReference.value[n] = relativeTo(point, one.clone().invert())));
    for (const { content: { parts, isBackground } } of frontToBack) {
      for (const part of parts) part.uniforms.hiddenBoxes.value = isBackground ? all.length : ofAllContents;
    }
    return point;
  }

  // Returns the projection of the triangles of the background block, or of those of tiles: each with its own near plane,
  // as depth is the more precise the farther away that is.
  private project(picture: Picture, frontToBack: DrawnPart<DrawnMesh>[], isBackground: boolean, point: THREE.Vector3): THREE.Matrix4 {
    const boxes = frontToBack.filter(({ content }) => content.isBackground === isBackground).map(({ content }) => content.box);
    const nearest = isBackground ? distanceToSides(this.scene.box, picture.eye) : Math.min(kFarAway, ...boxes.map((box) => distanceToBox(box, picture.eye)));
    const projection = rasterProjection(picture, relativeTo(point, picture.clipFromScene), Math.max(this.scene.near, nearest), boxes);
    return jittered(projection, this.uniforms.jitter.value, picture);
  }

  // Draws the tiles, and the background block behind them. Returns where each part may be visible.
  private drawTriangles(
    picture: Picture, frontToBack: DrawnPart<DrawnMesh>[], kind: RasterKind, target: THREE.WebGLRenderTarget, point: THREE.Vector3,
  ): Map<ColouredPart, ScreenRectangle> {
    target.viewport.copy(picture.part);
    if (picture === this.pictures[0]) this.targets.clear(this.renderer, target);
    const behind = this.renderTriangles(picture, frontToBack, kind, true, target, point);
    return new Map([...behind, ...this.renderTriangles(picture, frontToBack, kind, false, target, point)]);
  }

  private renderTriangles(
    picture: Picture, frontToBack: DrawnPart<DrawnMesh>[], kind: RasterKind, isBackground: boolean, target: THREE.WebGLRenderTarget, point: THREE.Vector3,
  ): Map<ColouredPart, ScreenRectangle> {
    const rectangles = new Map<ColouredPart, ScreenRectangle>();
    const meshes: TriangleMesh[] = [];
    this.uniforms.clipFromReference.value = this.project(picture, frontToBack, isBackground, point);
    const halfSpaces = visibleHalfSpaces(this.uniforms.clipFromReference.value, isParallel(picture.camera));
    const times = new Map<DrawnMeshPart, number>(); // a part may be drawn in several runs, and in place of several tiles
    for (const { content, within = kEverywhere, share = kAllPixels } of frontToBack) {
      if (content.isBackground !== isBackground) continue;
      // Of two contents that fade into each other, the one that most pixels show gives the solid surface.
      if ((kind === 'solid' || kind === 'layers') && !(share[0] <= 0.5 && share[1] > 0.5)) continue;
      const isGeneral = kind === 'inspected' || kind === 'layers' || this.isGeneral || within !== kEverywhere || share !== kAllPixels ||
        isParallel(picture.camera) || content.parts.some(({ uniforms }) => uniforms.hiddenBoxes.value > 0);
      const form = { kind, isBackground, isGeneral };
      const key = JSON.stringify(form);
      const low = new THREE.Vector3(...within.low).sub(point);
      const high = new THREE.Vector3(...within.high).sub(point);
      for (const [order, drawn] of content.parts.entries()) {
        drawn.uniforms.partOrigin.value.set(...drawn.part.origin).sub(point);
        const limits = { low: low.toArray(), high: high.toArray() };
        const chunks = selectChunks(drawn.chunks, drawn.part, drawn.uniforms.partOrigin.value, halfSpaces, limits);
        const rectangle = screenRectangle(chunks, drawn.part, drawn.uniforms.partOrigin.value, this.uniforms.clipFromReference.value);
        if (!rectangle) continue;
        rectangles.set(drawn.coloured, joinRectangles(rectangle, rectangles.get(drawn.coloured) ?? rectangle));
        for (const run of joinRuns(chunks)) {
          const time = times.get(drawn) ?? 0;
          times.set(drawn, time + 1);
          const ofForm = drawn.meshes.get(key) ?? [];
          drawn.meshes.set(key, ofForm);
          const mesh = (ofForm[time] ??= this.makeTriangles(form, drawn, order, ofForm.find((one) => one !== undefined)));
          mesh.onBeforeRender = () => {
            drawRange(drawn.geometry, run);
            drawn.uniforms.withinLow.value.copy(low);
            drawn.uniforms.withinHigh.value.copy(high);
            drawn.uniforms.share.value.set(...share);
            mesh.material.uniformsNeedUpdate = true;
          };
          mesh.renderOrder = meshes.length;
          meshes.push(mesh);
        }
      }
    }
    if (meshes.length === 0) return rectangles;
    if (this.view.opaqueDepth.value === this.nothingOpaque) {
      this.renderer.setRenderTarget(target);
      this.renderer.clear(false, true, false);
    } else {
      this.run([this.passes.objects], target, [picture]);
    }
    this.triangles.children = meshes;
    this.renderer.render(this.triangles, picture.camera);
    this.triangles.children = [];
    return rectangles;
  }

  // `other`: triangles of the same part and kind, whose material they share.
  private makeTriangles(form: RasterForm, { geometry, uniforms }: DrawnMeshPart, order: number, other?: TriangleMesh): TriangleMesh {
    const material = other?.material ?? rasterMaterial(form);
    material.uniforms = uniforms;
    // Of equal triangles, that of the first part is in front, as depths differ by rounding.
    material.polygonOffset = order > 0;
    material.polygonOffsetUnits = kDepthSteps * (order % kDepthOrders);
    const mesh = new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = mesh.matrixWorldAutoUpdate = false;
    return mesh;
  }
}

function viewDirection({ ray }: Picture): THREE.Vector3 {
  return new THREE.Vector3(0, 0, 1).applyMatrix3(ray).normalize();
}

function joinRectangles(a: ScreenRectangle, b: ScreenRectangle): ScreenRectangle {
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[2], b[2]), Math.max(a[3], b[3])];
}
