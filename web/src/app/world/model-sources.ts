// The files of models: how they are called in a world, and which of several of one name is meant.
import { SceneError } from '../../scene-error';
import { findFile, isModel, nameOf, type ModelFile } from '../models/model-files';
import type { ModelSource, PlacedModel } from '../models/models';
import { contentOf } from './file-content';
import type { WorldModel } from './world-file';

// Of the files that the models came from.
export function bytesOf(list: readonly PlacedModel[]): number {
  const files = new Set(list.flatMap(({ source }) => source.files));
  return [...files].reduce((sum, { file }) => sum + file.size, 0);
}

type NamedFiles = Pick<WorldModel, 'files' | 'contents'>;

// The same for models of the same files.
export function keyOf({ files, contents }: NamedFiles): string {
  return JSON.stringify([files, contents]);
}

// As they came; in a folder with a number, where another source has a file of that name, or one of `absent` another
// file. Throws SceneError that names the file that cannot be read any more.
export async function namesOf(
  sources: ReadonlySet<Pick<ModelSource, 'files'>>, absent: readonly NamedFiles[] = [],
): Promise<Map<ModelFile, string>> {
  const names = new Map<ModelFile, string>();
  const taken = new Set<string>();
  const ofAbsent = takenBy(absent);
  for (const { files } of sources) {
    const fresh = files.filter((file) => !names.has(file));
    const contents = await contentsOf(fresh);
    const inFolder = (number: number) => (path: string) => (number === 1 ? path : `${number}/${path}`);
    let number = 1;
    const isFree = ({ path }: ModelFile, i: number) => {
      const name = inFolder(number)(path).toLowerCase(); // as findFile compares them
      return !taken.has(name) && [...(ofAbsent.get(name) ?? [])].every((content) => content === contents[i]);
    };
    while (!fresh.every(isFree)) ++number;
    for (const file of fresh) {
      names.set(file, inFolder(number)(file.path));
      taken.add(names.get(file)!.toLowerCase());
    }
  }
  return names;
}

// What is in files of those names, where it is known. Of what a model needs beside its own file, and nobody knows, it is
// the name that counts.
function takenBy(absent: readonly NamedFiles[]): Map<string, Set<string | undefined>> {
  const taken = new Map<string, Set<string | undefined>>();
  for (const { files, contents } of absent) {
    for (const [i, name] of files.entries()) {
      if (i > 0 && contents[i] === undefined) continue;
      const key = name.toLowerCase();
      taken.set(key, (taken.get(key) ?? new Set()).add(contents[i]));
    }
  }
  return taken;
}

// The one that holds what is meant, if anybody knows that; else the one of that name.
export async function fileOfContent(
  path: string, content: string | undefined, isMain: boolean, all: readonly ModelFile[],
): Promise<ModelFile | undefined> {
  const files = isMain ? all.filter(isModel) : all;
  if (content !== undefined) {
    const size = Number(content.split('-')[0]);
    const name = nameOf(path).toLowerCase();
    for (const one of files) {
      const mayBe = one.file.size === size && nameOf(one.path).toLowerCase() === name;
      if (mayBe && (await contentOf(one.file)) === content) return one;
    }
  }
  return findFile(path, '', files);
}

// Throws SceneError that names the file that cannot be read any more.
export function contentsOf(files: readonly ModelFile[]): Promise<string[]> {
  return Promise.all(files.map(({ path, file }) => contentOf(file).catch(() => {
    throw unreadable(path);
  })));
}

export function base64Of({ path, file }: ModelFile): Promise<string> {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve((reader.result as string).replace(/^[^,]*,/, ''));
    reader.onerror = () => reject(unreadable(path));
    reader.readAsDataURL(file);
  });
}

function unreadable(path: string): SceneError {
  return new SceneError(nameOf(path), '', 'could not be read', 'see that it is still there, and drop it again');
}
