// Loads a model from files that the user provides, which are untrusted. Nothing but these files is read.
import * as THREE from 'three';
import { SceneError } from '../../scene-error';
import { checkGltf } from './gltf-check';
import { findFile, isOfNetwork, fileExtension, baseName, type ModelFile } from './model-files';
import { prepareModel } from './model-materials';

export const kModelBytes = 512 * 1024 * 1024; // limit per file
const kDepth = 256; // limit on the nesting of objects
const kNoFile = 'data:,';

export interface LoadedModel {
  object: THREE.Object3D; // in metres, y up
  box: THREE.Box3;
  clips: THREE.AnimationClip[];
  files: ModelFile[]; // the model's own file first, then those that it needs
  lacking: string[]; // textures and materials that were not provided
}

// Throws SceneError that names the file.
export async function loadModel(main: ModelFile, files: readonly ModelFile[]): Promise<LoadedModel> {
  const name = baseName(main.path);
  const companions = new Companions(main, files);
  try {
    const { object, clips } = await read(main, companions);
    await companions.allCame();
    if (companions.refused) {
      throw new SceneError(name, '', `asks for ${companions.refused.slice(0, 200)}, and nothing is fetched for a model`, 'put its textures beside it, and drop all together');
    }
    if (hierarchyDepth(object) > kDepth) throw new SceneError(name, '', 'is nested too deep', 'export it again, with fewer groups in groups');
    const box = prepareModel(object);
    const size = box.getSize(new THREE.Vector3());
    if (box.isEmpty()) throw new SceneError(name, '', 'holds nothing to draw', 'export it again, with its meshes');
    if (![...box.min, ...box.max].every((x) => Math.abs(x) < 1e9) || size.length() === 0) {
      throw new SceneError(name, '', 'has no size that makes sense', 'export it again, in metres');
    }
    return { object, box, clips, files: companions.used, lacking: [...companions.lacking] };
  } catch (error) {
    if (error instanceof SceneError) throw error;
    const why = (error instanceof Error ? error.message : String(error)).replace(/^THREE\.\w+: /, '').replace(/\.$/, '');
    throw new SceneError(name, '', `cannot be read: ${why.slice(0, 200)}`, 'export it again, as GLB if you can');
  } finally {
    companions.dispose();
  }
}

async function readBytes({ path, file }: ModelFile): Promise<ArrayBuffer> {
  const name = baseName(path);
  if (file.size > kModelBytes) throw new SceneError(name, '', `is larger than ${kModelBytes >> 20} MB`, 'export it with fewer triangles, or smaller textures');
  try {
    return await file.arrayBuffer();
  } catch {
    throw new SceneError(name, '', 'could not be read', 'check that it still exists, and drop it again');
  }
}

async function read(main: ModelFile, companions: Companions): Promise<{ object: THREE.Object3D; clips: THREE.AnimationClip[] }> {
  const { manager } = companions;
  const bytes = await readBytes(main);
  const { TGALoader } = await import('three/addons/loaders/TGALoader.js');
  manager.addHandler(/\.tga$/i, new TGALoader(manager));
  switch (fileExtension(main.path)) {
    case 'obj': {
      const { OBJLoader } = await import('three/addons/loaders/OBJLoader.js');
      const loader = new OBJLoader(manager);
      const text = new TextDecoder().decode(bytes);
      const materials = await loadMaterials(text, companions);
      if (materials) loader.setMaterials(materials);
      return { object: loader.parse(text), clips: [] };
    }
    case 'fbx': {
      const { FBXLoader } = await import('three/addons/loaders/FBXLoader.js');
      const fbx = new FBXLoader(manager).parse(bytes, '');
      const centimetres = Number(fbx.userData.unitScaleFactor ?? 1);
      const object = new THREE.Group().add(fbx);
      if (centimetres > 0 && Number.isFinite(centimetres)) object.scale.setScalar(centimetres / 100);
      return { object, clips: fbx.animations };
    }
    default: {
      const { needsMeshopt } = checkGltf(new Uint8Array(bytes), main, companions.files);
      const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');
      const loader = new GLTFLoader(manager);
      if (needsMeshopt) loader.setMeshoptDecoder((await import('three/addons/libs/meshopt_decoder.module.js')).MeshoptDecoder);
      const { scene, animations } = await loader.parseAsync(bytes, '');
      return { object: scene, clips: animations };
    }
  }
}

// Returns the material library that an OBJ file names; if only one was provided, that one, even if its name differs.
async function loadMaterials(text: string, companions: Companions) {
  const names = [...text.matchAll(/^\s*mtllib\s+(.+?)\s*$/gm)].map(([, name]) => name);
  const all = companions.files.filter(({ path }) => fileExtension(path) === 'mtl');
  const libraries = [...new Set(names.map((name) => companions.find(name)).filter((one) => one !== undefined))];
  if (libraries.length === 0 && names.length > 0 && all.length === 1) libraries.push(companions.use(all[0]));
  else for (const name of names) if (!companions.find(name)) companions.lack(name);
  if (libraries.length === 0) return undefined;
  const { MTLLoader } = await import('three/addons/loaders/MTLLoader.js');
  const texts = await Promise.all(libraries.map(readBytes));
  const materials = new MTLLoader(companions.manager).parse(texts.map((one) => new TextDecoder().decode(one)).join('\n'), '');
  materials.preload();
  return materials;
}

function hierarchyDepth({ children }: THREE.Object3D): number {
  return 1 + children.reduce((maximum, child) => Math.max(maximum, hierarchyDepth(child)), 0);
}

// Maps the files that a model names to object URLs of this page for the loaders of three.js; everything else is
// blocked.
class Companions {
  readonly manager = new THREE.LoadingManager();
  readonly used: ModelFile[];
  readonly lacking = new Set<string>();
  refused?: string; // a network address that the model asked for
  private readonly urls = new Map<ModelFile, string>();
  private loading = false;
  private onRest: () => void = () => {};

  constructor(private readonly main: ModelFile, readonly files: readonly ModelFile[]) {
    this.used = [main];
    this.manager.setURLModifier((url) => this.resolve(url));
    this.manager.onStart = () => (this.loading = true);
    this.manager.onLoad = () => {
      this.loading = false;
      this.onRest();
    };
  }

  find(uri: string): ModelFile | undefined {
    const modelFile = findFile(uri, this.main.path, this.files);
    return modelFile && this.use(modelFile);
  }

  use(file: ModelFile): ModelFile {
    if (!this.used.includes(file)) this.used.push(file);
    return file;
  }

  lack(uri: string): void {
    this.lacking.add(baseName(uri.replaceAll('\\', '/')));
  }

  allCame(): Promise<void> {
    return this.loading ? new Promise((resolve) => (this.onRest = resolve)) : Promise.resolve();
  }

  dispose(): void {
    for (const url of this.urls.values()) URL.revokeObjectURL(url);
  }

  private resolve(uri: string): string {
    if (/^(data|blob):/i.test(uri)) return uri;
    if (isOfNetwork(uri)) {
      this.refused ??= uri;
      return kNoFile;
    }
    const modelFile = this.find(uri);
    if (!modelFile || modelFile.file.size > kModelBytes) {
      this.lack(uri);
      return kNoFile;
    }
    const url = this.urls.get(modelFile) ?? URL.createObjectURL(modelFile.file);
    this.urls.set(modelFile, url);
    return url;
  }
}
