// Saves the page's world as world.json, and opens a world.json.
import * as THREE from 'three';
import { TesseraScene } from '../../scene';
import { SceneError } from '../../scene-error';
import { ServedFiles } from '../../scene-files';
import type { HiddenParts } from '../hiding/hidden-parts';
import { loadModel } from '../models/load-model';
import { baseName, type ModelFile } from '../models/model-files';
import { getPlace, setPlace } from '../models/model-place';
import { Models, type ModelSource } from '../models/models';
import { megabytes } from '../page/panels';
import type { Bookmarks } from '../views/bookmarks';
import { formatView, parseView } from '../views/view-address';
import type { Viewer } from '../viewer';
import { FetchedFiles, fetchNamed } from './fetched-files';
import { readBase64, countFileBytes, computeContentIds, fileOfContent, modelKey, assignFileNames } from './model-sources';
import { addressFrom, resolved } from './world-address';
import { kNameLength } from './world-fields';
import { decodeWorld, kEmbeddedBytes, kMax, kWorldBytes, kWorldName, mainScene, savedWorld, type World, type WorldModel, type WorldScene } from './world-file';

// A world.json and its address, to which relative addresses refer.
export interface NamedWorld {
  world: World;
  name: string;
  address: string;
}

// Throws SceneError if it cannot be fetched or is invalid.
export async function fetchWorld(url: string): Promise<NamedWorld> {
  const address = resolved(url, location.href);
  if (address === undefined) throw new SceneError(kWorldName, '', 'has no address of http or https', 'name another in ?world=');
  const name = baseName(new URL(address).pathname) || kWorldName;
  const bytes = await fetchNamed(address, name, kWorldBytes, 'check that the address is right');
  return { world: decodeWorld(new TextDecoder().decode(bytes), name), name, address };
}

// Returns the address of the scene that defines the world's frame. Throws SceneError if it has none.
export function addressOfMain({ world, name, address }: NamedWorld): string {
  const main = mainScene(world);
  return addressOfScene(main, `scenes[${world.scenes.indexOf(main)}]`, name, address);
}

function addressOfScene({ url }: WorldScene, place: string, name: string, address: string): string {
  if (url === '') throw new SceneError(name, `${place}.url`, 'is missing', 'write the address of its tileset.json there');
  const sceneAddress = resolved(url, address);
  if (sceneAddress !== undefined) return sceneAddress;
  throw new SceneError(name, `${place}.url`, 'is relative to an unknown address', 'open the world by its address');
}

export class Worlds {
  private address = location.href; // base of relative addresses
  private absent: Pick<World, 'scenes' | 'models'> = { scenes: [], models: [] }; // could not be loaded; saved all the same
  private last = Promise.resolve(); // the last world that was requested

  constructor(
    private readonly viewer: Viewer,
    private readonly models: Models,
    private readonly hidden: HiddenParts,
    private readonly bookmarks: Bookmarks,
  ) {}

  // Returns the text of world.json. Throws SceneError if it cannot contain the models' files, or could not be opened
  // again.
  async save(withFiles: boolean): Promise<Blob> {
    const { list } = this.models;
    const bytes = countFileBytes(list);
    if (withFiles && bytes > kEmbeddedBytes) {
      throw new SceneError(kWorldName, '', `cannot hold ${megabytes(bytes)} of models, only ${megabytes(kEmbeddedBytes)}`, 'save it without them');
    }
    const names = await assignFileNames(new Set(list.map(({ source }) => source)), this.absent.models);
    const files = new Map<string, string>();
    if (withFiles) for (const [file, name] of names) files.set(name, await readBase64(file));
    const models: WorldModel[] = [];
    for (const model of list) {
      const own = model.source.files;
      models.push({
        name: model.name, files: own.map((file) => names.get(file)!), contents: await computeContentIds(own),
        ...getPlace(model, model.source.base), visible: model.visible, plays: model.plays,
      });
    }
    return savedWorld({
      scenes: [...this.viewer.scenes.map((scene) => this.toWorldScene(scene)), ...this.absent.scenes],
      models: [...models, ...this.absent.models],
      hidden: this.hidden.list.map(({ part }) => part),
      bookmarks: this.bookmarks.list.map(({ name, view }) => ({ name: name || 'View', view: formatView(view) }))
        .filter(({ view }) => parseView(view)).slice(0, kMax.bookmarks),
    }, files);
  }

  // Opens a world that was dropped with accompanying files. Throws SceneError if it cannot be read, and then changes
  // nothing. What cannot be loaded is reported, and the rest is shown.
  async openFile(given: ModelFile, files: readonly ModelFile[], tell: (error: unknown) => void): Promise<void> {
    const name = baseName(given.path);
    if (given.file.size > kWorldBytes) throw new SceneError(name, '', `is larger than ${megabytes(kWorldBytes)}`, 'save it without its models');
    const world = decodeWorld(await given.file.text(), name);
    const { city } = this.viewer;
    await this.inTurn(() => this.show({ world, name, address: this.address }, files, false, tell));
    const main = mainScene(world);
    if (main.name === city.name) return;
    tell(new SceneError(name, '', `is of the scene ${main.name.slice(0, 100)}, and this is ${city.name}`, 'open it in its own scene, if the models stand in odd places'));
  }

  // Opens a world that was fetched, whose main scene is the city. What cannot be loaded is reported, and the rest is
  // shown.
  open(fetched: NamedWorld, tell: (error: unknown) => void): Promise<void> {
    return this.inTurn(() => {
      this.address = fetched.address;
      return this.show(fetched, [], true, tell);
    });
  }

  // Runs after the worlds that were requested before.
  private inTurn(open: () => Promise<void>): Promise<void> {
    const opened = this.last.then(open);
    this.last = opened.catch(() => {}); // the caller reports the error
    return opened;
  }

  private async show(named: NamedWorld, files: readonly ModelFile[], mayFetch: boolean, lacks: (error: unknown) => void): Promise<void> {
    const { world } = named;
    const main = mainScene(world);
    const absent: Worlds['absent'] = { scenes: [], models: [] };
    const scenes = new Map<WorldScene, TesseraScene>([[main, this.viewer.city]]);
    const sources = new Map<string, ModelSource | undefined>();
    const fresh: TesseraScene[] = [];
    try {
      for (const [i, saved] of world.scenes.entries()) {
        if (saved === main) continue;
        const shown = this.viewer.scenes.find((scene) => scene !== this.viewer.city && ![...scenes.values()].includes(scene) && isSameScene(scene, saved, named.address));
        try {
          const scene = shown ?? (await TesseraScene.load(addressOfScene(saved, `scenes[${i}]`, named.name, named.address)));
          if (!shown) fresh.push(scene);
          scenes.set(saved, scene);
        } catch (error) {
          absent.scenes.push(saved);
          lacks(error instanceof SceneError ? new SceneError(named.name, `scenes[${i}]`, `cannot be opened: ${error.reason}`, error.remedy) : error);
        }
      }
      const embedded = [...world.files].map(([path, bytes]): ModelFile => ({ path, file: new Blob([bytes]) }));
      const all = [...embedded, ...files, ...this.models.list.flatMap(({ source }) => source.files)];
      const fetched = new FetchedFiles(named.name, mayFetch ? named.address : undefined);
      for (const [i, saved] of world.models.entries()) {
        const key = modelKey(saved);
        if (sources.has(key)) continue;
        sources.set(key, undefined);
        try {
          sources.set(key, await this.loadSource(saved, all, fetched, named.name, `models[${i}]`));
        } catch (error) {
          lacks(error);
        }
      }
    } catch (error) {
      for (const scene of fresh) scene.dispose();
      throw error;
    }
    this.showScenes(scenes, fresh);
    this.models.changeAll(() => {
      for (const model of [...this.models.list]) this.models.remove(model);
      for (const saved of world.models) {
        const source = sources.get(modelKey(saved));
        if (source) this.place(source, saved);
        else absent.models.push(saved);
      }
    });
    this.absent = absent;
    this.hidden.show(world.hidden);
    this.bookmarks.showWorld(world.bookmarks.map(({ name, view }) => ({ name, view: parseView(view)! })));
  }

  private place(source: ModelSource, saved: WorldModel): void {
    const model = this.models.add(source, this.models.freeName(saved.name));
    setPlace(model, model.source.base, saved);
    model.visible = saved.visible;
    model.plays = saved.plays;
  }

  private showScenes(scenes: ReadonlyMap<WorldScene, TesseraScene>, fresh: readonly TesseraScene[]): void {
    const { viewer } = this;
    const remaining = new Set(scenes.values());
    for (const scene of [...viewer.scenes]) if (!remaining.has(scene)) viewer.removeScene(scene);
    for (const [saved, scene] of scenes) {
      scene.visible = saved.visible;
      if (scene === viewer.city) continue;
      if (saved.name !== '') scene.name = saved.name;
      const { scale, ...place } = saved.place ?? { position: [0, 0, 0], rotation: [0, 0, 0, 1], scale: 1 };
      setPlace(scene, new THREE.Vector3(), { ...place, scale: [scale, scale, scale] });
      if (fresh.includes(scene)) viewer.addScene(scene);
    }
    viewer.changedScenes();
  }

  private toWorldScene(scene: TesseraScene): WorldScene {
    const { position, rotation, scale: [scale] } = getPlace(scene, new THREE.Vector3());
    return {
      name: scene.name.slice(0, kNameLength), url: addressFrom(this.address, scene.files.name), visible: scene.visible,
      ...(scene !== this.viewer.city && { place: { position, rotation, scale } }),
    };
  }

  // The files are embedded in the world, came with it, are in use, or are fetched relative to the world's address, if
  // known.
  private async loadSource(saved: WorldModel, all: readonly ModelFile[], fetched: FetchedFiles, name: string, place: string): Promise<ModelSource> {
    const own: ModelFile[] = [];
    for (const [i, path] of saved.files.entries()) {
      const modelFile = (await fileOfContent(path, saved.contents[i], i === 0, all)) ?? (await fetched.file(path, place));
      if (!modelFile && i === 0) {
        throw new SceneError(name, place, `needs ${path.slice(0, 200)}`, `drop it together with ${name}`);
      }
      if (modelFile) own.push(modelFile);
    }
    return Models.makeSource(await loadModel(own[0], [...own, ...all]));
  }
}

function isSameScene(scene: TesseraScene, { url }: WorldScene, address: string): boolean {
  const sceneAddress = url === '' ? undefined : resolved(url, address);
  return sceneAddress !== undefined && new ServedFiles(sceneAddress).name === scene.files.name;
}
