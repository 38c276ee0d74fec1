// Files of models that lie where a world says: each fetched once, and not without end.
import { SceneError } from '../../scene-error';
import { fetchFile, TooLarge } from '../../scene-files';
import { kModelBytes } from '../models/load-model';
import type { ModelFile } from '../models/model-files';
import { megabytes } from '../page/panels';
import { addressOfFile } from './world-address';
import { kMostFilesHeld } from './world-file';

export const kMostFetched = { files: kMostFilesHeld, bytes: 1000 * 1000 * 1000 };

export class FetchedFiles {
  private readonly files = new Map<string, Promise<Blob>>(); // by their addresses
  private bytes = 0;

  // `address`: of the world, called `name`, if anybody knows it.
  constructor(private readonly name: string, private readonly address: string | undefined, private readonly most = kMostFetched) {}

  // Nothing where `path` is no whole address, and nobody knows what it is relative to. Throws SceneError where it is not
  // there, or is more than is fetched for one world; `place`: in the world, of what needs it.
  async file(path: string, place: string): Promise<ModelFile | undefined> {
    const isKnown = this.address !== undefined || /^https?:/i.test(path);
    const url = isKnown ? addressOfFile(path, this.address ?? location.href) : undefined;
    if (url === undefined) return undefined;
    const file = this.files.get(url) ?? this.fetch(url, path, place);
    this.files.set(url, file);
    return { path, file: await file };
  }

  private async fetch(url: string, path: string, place: string): Promise<Blob> {
    const { name, most } = this;
    if (this.files.size >= most.files) throw new SceneError(name, place, `needs more than ${most.files} files of models`, 'keep fewer models');
    const left = Math.min(kModelBytes, most.bytes - this.bytes);
    try {
      const bytes = await fetchNamed(url, path, left, 'put it where the world says');
      this.bytes += bytes.length;
      return new Blob([bytes]);
    } catch (error) {
      if (!(error instanceof TooLarge)) throw error;
      this.bytes += left;
      if (left === kModelBytes) throw error;
      throw new SceneError(name, place, `needs more than ${megabytes(most.bytes)} of models`, 'keep fewer models, or smaller ones');
    }
  }
}

export async function fetchNamed(url: string, name: string, most: number, remedy: string): Promise<Uint8Array<ArrayBuffer>> {
  try {
    return await fetchFile(url, name, most);
  } catch (error) {
    if (error instanceof TooLarge) throw new TooLarge(name, remedy);
    throw error instanceof SceneError ? new SceneError(error.what, error.place, error.reason, remedy) : error;
  }
}
