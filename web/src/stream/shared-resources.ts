// Loads and counts the resources that tiles share (docs/tile-format.md, section 3, `resources`). Each resource is
// loaded once, however many tiles need it, and its bytes are counted once: in the page while it is needed by a tile
// that is requested, in progress or on the GPU; on the GPU from when the first tile that needs it is admitted until the
// last such tile is evicted.
import { SceneError } from '../scene-error';
import type { StreamSettings, StreamStatistics } from './tile-streamer';

export interface ResourceSource<Resource> {
  tileResources(tile: number): readonly number[]; // indices of resources, without duplicates
  declaredBytes(id: number): number; // size of its file in bytes; 0 if unknown
  // Fetches and decodes a resource. `pageBytes` is what it takes in the page for as long as tiles still to be loaded
  // may need it.
  load(id: number, signal: AbortSignal): Promise<{ resource: Resource; fileBytes: number; pageBytes: number; gpuBytes: number }>;
}

interface Entry<Resource> {
  state: 'absent' | 'loading' | 'loaded';
  resource?: Resource;
  abort?: AbortController;
  pageBytes: number;
  gpuBytes?: number; // undefined until known
  holders: number; // tiles that are on the GPU or admitted to it; gpuBytes is counted while this is above 0
  failures: number;
  retryAt: number;
  error?: SceneError;
}

export class SharedResources<Resource> {
  private readonly entries = new Map<number, Entry<Resource>>();
  loading = 0;
  // Called once for each resource that cannot be loaded, with a tile that needs it.
  onError: (error: SceneError, tile: number) => void = () => {};

  // Without a source, tiles share nothing.
  constructor(
    private readonly source: ResourceSource<Resource> | undefined,
    private readonly statistics: StreamStatistics,
    private readonly now: () => number,
  ) {}

  of(tile: number): readonly number[] {
    return this.source?.tileResources(tile) ?? [];
  }

  // Returns the GPU bytes of a resource: the exact size if known, otherwise the size of its file.
  estimateBytes(id: number): number {
    return this.entry(id).gpuBytes ?? this.source!.declaredBytes(id);
  }

  // Returns the known GPU bytes of the resources that these tiles need, each counted once.
  knownResourceBytes(tiles: readonly number[]): number {
    return sum([...this.neededBy(tiles)].map((id) => this.entry(id).gpuBytes ?? 0));
  }

  // Returns the additional GPU bytes that a tile's resources take once the tile is admitted. All of them must be
  // loaded.
  bytesToHold(tile: number): number {
    return sum(this.tileEntries(tile).filter(({ holders }) => holders === 0).map(({ gpuBytes }) => gpuBytes!));
  }

  // Returns the bytes of the resources that leave the GPU when these tiles are evicted and that the tile `staying` does
  // not need.
  bytesFreedBy(tiles: readonly number[], staying: number): number {
    const neededAfterwards = new Set(this.of(staying));
    const leaving = new Map<number, number>();
    for (const id of tiles.flatMap((tile) => this.of(tile))) leaving.set(id, (leaving.get(id) ?? 0) + 1);
    return sum([...leaving].map(([id, count]) => {
      const { holders, gpuBytes = 0 } = this.entry(id);
      return !neededAfterwards.has(id) && holders === count ? gpuBytes : 0;
    }));
  }

  // Returns the time in ms from which the resources of a tile may be requested: those that failed wait until their next
  // retry.
  retryAt(tile: number): number {
    return Math.max(-Infinity, ...this.tileEntries(tile).map(({ state, retryAt }) => (state === 'absent' ? retryAt : -Infinity)));
  }

  tileError(tile: number): SceneError | undefined {
    return this.tileEntries(tile).find(({ error }) => error)?.error;
  }

  areLoaded(tile: number): boolean {
    return this.tileEntries(tile).every(({ state }) => state === 'loaded');
  }

  // Returns the resources of a tile in the tile's order. All of them must be loaded.
  loadedResources(tile: number): Resource[] {
    return this.tileEntries(tile).map(({ resource }) => resource!);
  }

  // Starts to load the resources of a tile that are absent, with at most `maximum` resources loading at the same time.
  load(tile: number, { firstRetry, lastRetry }: StreamSettings, maximum: number): void {
    for (const id of this.of(tile)) {
      const entry = this.entry(id);
      if (entry.state !== 'absent' || this.loading >= maximum) continue;
      void this.fetch(id, entry, (error) => {
        entry.error = error instanceof SceneError ? error : new SceneError(`resource ${id}`, '', String(error), 'reload the page');
        entry.retryAt = this.now() + Math.min(lastRetry, firstRetry * 2 ** entry.failures);
        ++this.statistics.failures;
        if (entry.failures++ === 0) this.onError(entry.error, tile);
      });
    }
  }

  // Counts the resources of a tile on the GPU when the tile is admitted.
  hold(tile: number): void {
    for (const entry of this.tileEntries(tile)) if (entry.holders++ === 0) this.statistics.gpuBytes += entry.gpuBytes!;
  }

  release(tile: number): void {
    for (const entry of this.tileEntries(tile)) if (--entry.holders === 0) this.statistics.gpuBytes -= entry.gpuBytes!;
  }

  // Releases every resource that none of these tiles needs.
  releaseAllExcept(tiles: readonly number[]): void {
    const needed = this.neededBy(tiles);
    for (const [id, entry] of this.entries) if (entry.state !== 'absent' && !needed.has(id)) this.forget(entry);
  }

  private neededBy(tiles: readonly number[]): Set<number> {
    return new Set(tiles.flatMap((tile) => this.of(tile)));
  }

  private tileEntries(tile: number): Entry<Resource>[] {
    return this.of(tile).map((id) => this.entry(id));
  }

  private entry(id: number): Entry<Resource> {
    let entry = this.entries.get(id);
    if (!entry) {
      entry = { state: 'absent', pageBytes: 0, holders: 0, failures: 0, retryAt: -Infinity };
      this.entries.set(id, entry);
    }
    return entry;
  }

  private async fetch(id: number, entry: Entry<Resource>, fail: (error: unknown) => void): Promise<void> {
    entry.state = 'loading';
    entry.abort = new AbortController();
    const { signal } = entry.abort;
    ++this.loading;
    this.holdInPage(entry, this.source!.declaredBytes(id));
    try {
      const { resource, fileBytes, pageBytes, gpuBytes } = await this.source!.load(id, signal);
      if (signal.aborted) return;
      Object.assign(entry, { state: 'loaded', resource, gpuBytes, failures: 0, error: undefined });
      this.holdInPage(entry, pageBytes);
      this.statistics.fetchedBytes += fileBytes;
    } catch (error) {
      if (signal.aborted) return;
      this.forget(entry);
      fail(error);
    } finally {
      --this.loading;
    }
  }

  private forget(entry: Entry<Resource>): void {
    entry.abort?.abort();
    entry.abort = undefined;
    this.holdInPage(entry, 0);
    entry.resource = undefined;
    entry.state = 'absent';
  }

  private holdInPage(entry: Entry<Resource>, bytes: number): void {
    this.statistics.pageBytes += bytes - entry.pageBytes;
    entry.pageBytes = bytes;
  }
}

function sum(numbers: number[]): number {
  return numbers.reduce((all, one) => all + one, 0);
}
