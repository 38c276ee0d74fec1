// An ordinary model, of files that somebody gave: untrusted. Nothing is fetched for it but what came with it.
import * as THREE from 'three';
import { SceneError } from '../../scene-error';
import { checkGltf } from './gltf-check';
import { findFile, isOfNetwork, kindOf, nameOf, type ModelFile } from './model-files';
import { prepareModel } from './model-materials';

export const kModelBytes = 512 * 1024 * 1024; // of a file
const kDepth = 256; // of objects in objects
const kNoFile = 'data:,';

export interface LoadedModel {
  object: THREE.Object3D; // metres, y up
  box: THREE.Box3;
  clips: THREE.AnimationClip[];
  files: ModelFile[]; // the model's own first, then those it needs
  lacking: string[]; // textures and materials that did not come with it
}

// Throws SceneError that names the file.
export async function loadModel(main: ModelFile, files: readonly ModelFile[]): Promise<LoadedModel> {
  const name = nameOf(main.path);
  const companions = new Companions(main, files);
  try {
    const { object, clips } = await read(main, companions);
    await companions.allCame();
    if (companions.refused) {
      throw new SceneError(name, '', `asks for ${companions.refused.slice(0, 200)}, and nothing is fetched for a model`, 'put its textures beside it, and drop all together');
    }
    if (depthOf(object) > kDepth) throw new SceneError(name, '', 'is nested too deep', 'export it again, with fewer groups in groups');
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

async function bytesOf({ path, file }: ModelFile): Promise<ArrayBuffer> {
  const name = nameOf(path);
  if (file.size > kModelBytes) throw new SceneError(name, '', `is larger than ${kModelBytes >> 20} MB`, 'export it with fewer triangles, or smaller textures');
  try {
    return await file.arrayBuffer();
  } catch {
    throw new SceneError(name, '', 'could not be read', 'see that it is still there, and drop it again');
  }
}

async function read(main: ModelFile, companions: Companions): Promise<{ object: THREE.Object3D; clips: THREE.AnimationClip[] }> {
  const { manager } = companions;
  const bytes = await bytesOf(main);
  const { TGALoader } = await import('three/addons/loaders/TGALoader.js');
  manager.addHandler(/\.tga$/i, new TGALoader(manager));
  switch (kindOf(main.path)) {
    case 'obj': {
      const { OBJLoader } = await import('three/addons/loaders/OBJLoader.js');
      const loader = new OBJLoader(manager);
      const text = new TextDecoder().decode(bytes);
      const materials = await materialsOf(text, companions);
      if (materials) loader.setMaterials(materials);
      return { object: loader.parse(text), clips: [] };
    }
    case 'fbx': {
      const { FBXLoader } = await import('three/addons/loaders/FBXLoader.js');
      const made = new FBXLoader(manager).parse(bytes, '');
      const centimetres = Number(made.userData.unitScaleFactor ?? 1);
      const object = new THREE.Group().add(made);
      if (centimetres > 0 && Number.isFinite(centimetres)) object.scale.setScalar(centimetres / 100);
      return { object, clips: made.animations };
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

// Of the libraries that an OBJ file names; of the only one, if it names another.
async function materialsOf(text: string, companions: Companions) {
  const names = [...text.matchAll(/^\s*mtllib\s+(.+?)\s*$/gm)].map(([, name]) => name);
  const all = companions.files.filter(({ path }) => kindOf(path) === 'mtl');
  const libraries = [...new Set(names.map((name) => companions.find(name)).filter((one) => one !== undefined))];
  if (libraries.length === 0 && names.length > 0 && all.length === 1) libraries.push(companions.use(all[0]));
  else for (const name of names) if (!companions.find(name)) companions.lack(name);
  if (libraries.length === 0) return undefined;
  const { MTLLoader } = await import('three/addons/loaders/MTLLoader.js');
  const texts = await Promise.all(libraries.map(bytesOf));
  const materials = new MTLLoader(companions.manager).parse(texts.map((one) => new TextDecoder().decode(one)).join('\n'), '');
  materials.preload();
  return materials;
}

function depthOf({ children }: THREE.Object3D): number {
  return 1 + children.reduce((most, child) => Math.max(most, depthOf(child)), 0);
}

// The files that a model names, as urls of this page for three's loaders; nothing else has one.
class Companions {
  readonly manager = new THREE.LoadingManager();
  readonly used: ModelFile[];
  readonly lacking = new Set<string>();
  refused?: string; // an address of the network
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
    const found = findFile(uri, this.main.path, this.files);
    return found && this.use(found);
  }

  use(file: ModelFile): ModelFile {
    if (!this.used.includes(file)) this.used.push(file);
    return file;
  }

  lack(uri: string): void {
    this.lacking.add(nameOf(uri.replaceAll('\\', '/')));
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
    const found = this.find(uri);
    if (!found || found.file.size > kModelBytes) {
      this.lack(uri);
      return kNoFile;
    }
    const url = this.urls.get(found) ?? URL.createObjectURL(found.file);
    this.urls.set(found, url);
    return url;
  }
}
