// The files of models: their names in a world, and the choice among several files of one name.
import { SceneError } from '../../scene-error';
import { findFile, isModel, baseName, type ModelFile } from '../models/model-files';
import type { ModelSource, PlacedModel } from '../models/models';
import { computeContentId } from './file-content';
import type { WorldModel } from './world-file';

// The files that the models were loaded from.
export function countFileBytes(list: readonly PlacedModel[]): number {
  const files = new Set(list.flatMap(({ source }) => source.files));
  return [...files].reduce((sum, { file }) => sum + file.size, 0);
}

type NamedFiles = Pick<WorldModel, 'files' | 'contents'>;

// Equal for models of the same files.
export function modelKey({ files, contents }: NamedFiles): string {
  return JSON.stringify([files, contents]);
}

// Returns the names of the files: as provided, or in a numbered folder if another source, or one of `absent`, has a
// different file of that name. Throws SceneError that names a file that can no longer be read.
export async function assignFileNames(
  sources: ReadonlySet<Pick<ModelSource, 'files'>>, absent: readonly NamedFiles[] = [],
): Promise<Map<ModelFile, string>> {
  const names = new Map<ModelFile, string>();
  const taken = new Set<string>();
  const ofAbsent = takenBy(absent);
  for (const { files } of sources) {
    const fresh = files.filter((file) => !names.has(file));
    const contents = await computeContentIds(fresh);
    const inFolder = (number: number) => (path: string) => (number === 1 ? path : `${number}/${path}`);
    let number = 1;
    const isFree = ({ path }: ModelFile, i: number) => {
      const name = inFolder(number)(path).toLowerCase(); // compared as in findFile
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

// Returns the digests of files by name, where they are known. For companion files without a digest only the name
// counts.
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

// Returns the file with the given content if the content is known, otherwise the file of that name.
export async function fileOfContent(
  path: string, content: string | undefined, isMain: boolean, all: readonly ModelFile[],
): Promise<ModelFile | undefined> {
  const files = isMain ? all.filter(isModel) : all;
  if (content !== undefined) {
    const size = Number(content.split('-')[0]);
    const name = baseName(path).toLowerCase();
    for (const one of files) {
      const mayBe = one.file.size === size && baseName(one.path).toLowerCase() === name;
      if (mayBe && (await computeContentId(one.file)) === content) return one;
    }
  }
  return findFile(path, '', files);
}

// Throws SceneError that names a file that can no longer be read.
export function computeContentIds(files: readonly ModelFile[]): Promise<string[]> {
  return Promise.all(files.map(({ path, file }) => computeContentId(file).catch(() => {
    throw unreadable(path);
  })));
}

export function readBase64({ path, file }: ModelFile): Promise<string> {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve((reader.result as string).replace(/^[^,]*,/, ''));
    reader.onerror = () => reject(unreadable(path));
    reader.readAsDataURL(file);
  });
}

function unreadable(path: string): SceneError {
  return new SceneError(baseName(path), '', 'could not be read', 'check that it still exists, and drop it again');
}
