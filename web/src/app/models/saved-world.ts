// The models of a scene, kept in world.json and brought back.
import type { TesseraScene } from '../../scene';
import { SceneError } from '../../scene-error';
import { loadModel } from './load-model';
import { findFile, isModel, nameOf, type ModelFile } from './model-files';
import { placeOf, setPlace } from './model-place';
import { Models, type ModelSource } from './models';
import { megabytes } from '../page/panels';
import { decodeWorld, encodeWorld, kEmbeddedBytes, kWorldName, kWorldBytes } from './world-file';

// Of the files that the models came from.
export function bytesOfModels({ list }: Models): number {
  const files = new Set(list.flatMap(({ source }) => source.files));
  return [...files].reduce((sum, { file }) => sum + file.size, 0);
}

// world.json. Throws SceneError where it cannot hold the models' files.
export async function saveWorld(models: Models, city: TesseraScene, withFiles: boolean): Promise<Blob> {
  const bytes = bytesOfModels(models);
  if (withFiles && bytes > kEmbeddedBytes) {
    throw new SceneError(kWorldName, '', `cannot hold ${megabytes(bytes)} of models, only ${megabytes(kEmbeddedBytes)}`, 'save it without them');
  }
  const names = namesOf(new Set(models.list.map(({ source }) => source)));
  const files = new Map<string, string>();
  if (withFiles) for (const [file, name] of names) files.set(name, await base64Of(file));
  const text = encodeWorld({
    scene: { name: city.name, url: city.files.name },
    models: models.list.map((model) => ({
      name: model.name, files: model.source.files.map((file) => names.get(file)!),
      ...placeOf(model, model.source.base), visible: model.visible,
    })),
  }, files);
  return new Blob([text], { type: 'application/json' });
}

// Its models in place of those that are there; of files that came with it, are in it, or were in use before. Throws
// SceneError, and then all stays as it is. Answers with what people should know.
export async function openWorld(given: ModelFile, files: readonly ModelFile[], models: Models, city: TesseraScene): Promise<SceneError | undefined> {
  const name = nameOf(given.path);
  if (given.file.size > kWorldBytes) throw new SceneError(name, '', `is larger than ${megabytes(kWorldBytes)}`, 'save it without its models');
  const world = decodeWorld(await given.file.text(), name);
  const held = [...world.files].map(([path, bytes]): ModelFile => ({ path, file: new Blob([bytes]) }));
  const all = [...held, ...files, ...models.list.flatMap(({ source }) => source.files)];
  const sources = new Map<string, ModelSource>();
  for (const [i, { files: names }] of world.models.entries()) {
    const key = names.join('\n');
    if (sources.has(key)) continue;
    const main = findFile(names[0], '', all.filter(isModel));
    if (!main) {
      throw new SceneError(name, `models[${i}]`, `needs ${names[0].slice(0, 200)}`, 'drop the models together with it');
    }
    const own = names.map((one) => findFile(one, '', all)).filter((one) => one !== undefined);
    sources.set(key, Models.sourceOf(await loadModel(main, [...own, ...all])));
  }
  for (const model of [...models.list]) models.remove(model);
  for (const saved of world.models) {
    const model = models.add(sources.get(saved.files.join('\n'))!, saved.name);
    setPlace(model, model.source.base, saved);
    model.visible = saved.visible;
  }
  models.changed();
  if (world.scene.name === city.name) return undefined;
  return new SceneError(name, '', `is of the scene ${world.scene.name.slice(0, 100)}, and this is ${city.name}`, 'open it in its own scene, if the models stand in odd places');
}

// As they came; in a folder with a number, where another source has a file of that name.
function namesOf(sources: ReadonlySet<ModelSource>): Map<ModelFile, string> {
  const names = new Map<ModelFile, string>();
  let number = 0;
  for (const { files } of sources) {
    ++number;
    const taken = new Set(names.values());
    const isFree = files.every((file) => names.has(file) || !taken.has(file.path));
    for (const file of files) if (!names.has(file)) names.set(file, isFree ? file.path : `${number}/${file.path}`);
  }
  return names;
}

function base64Of({ path, file }: ModelFile): Promise<string> {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve((reader.result as string).replace(/^[^,]*,/, ''));
    reader.onerror = () => reject(new SceneError(nameOf(path), '', 'could not be read', 'see that it is still there, and drop it again'));
    reader.readAsDataURL(file);
  });
}
