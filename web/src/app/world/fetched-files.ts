// Fetches the files of models from the addresses in a world: each file once, and with a limit on the total size.
import { SceneError } from '../../scene-error';
import { fetchFile, TooLarge } from '../../scene-files';
import { kModelBytes } from '../models/load-model';
import type { ModelFile } from '../models/model-files';
import { megabytes } from '../page/panels';
import { addressOfFile } from './world-address';
import { kMaxFilesHeld } from './world-file';

export const kMaxFetched = { files: kMaxFilesHeld, bytes: 1000 * 1000 * 1000 };

export class FetchedFiles {
  private readonly files = new Map<string, Promise<Blob>>(); // by address
  private bytes = 0;

  // `address` is that of the world called `name`, if known.
  constructor(private readonly name: string, private readonly address: string | undefined, private readonly maximum = kMaxFetched) {}

  // Returns undefined if `path` is not an absolute address and the address of the world is unknown. Throws SceneError
  // if the file does not exist or the total size for one world is exceeded; `place` in the world is what needs it.
  async file(path: string, place: string): Promise<ModelFile | undefined> {
    const isKnown = this.address !== undefined || /^https?:/i.test(path);
    const url = isKnown ? addressOfFile(path, this.address ?? location.href) : undefined;
    if (url === undefined) return undefined;
    const file = this.files.get(url) ?? this.fetch(url, path, place);
    this.files.set(url, file);
    return { path, file: await file };
  }

  private async fetch(url: string, path: string, place: string): Promise<Blob> {
    const { name, maximum } = this;
    if (this.files.size >= maximum.files) throw new SceneError(name, place, `needs more than ${maximum.files} files of models`, 'keep fewer models');
    const left = Math.min(kModelBytes, maximum.bytes - this.bytes);
    try {
      const bytes = await fetchNamed(url, path, left, 'put it where the world says');
      this.bytes += bytes.length;
      return new Blob([bytes]);
    } catch (error) {
      if (!(error instanceof TooLarge)) throw error;
      this.bytes += left;
      if (left === kModelBytes) throw error;
      throw new SceneError(name, place, `needs more than ${megabytes(maximum.bytes)} of models`, 'keep fewer models, or smaller ones');
    }
  }
}

export async function fetchNamed(url: string, name: string, maximum: number, remedy: string): Promise<Uint8Array<ArrayBuffer>> {
  try {
    return await fetchFile(url, name, maximum);
  } catch (error) {
    if (error instanceof TooLarge) throw new TooLarge(name, remedy);
    throw error instanceof SceneError ? new SceneError(error.what, error.place, error.reason, remedy) : error;
  }
}
