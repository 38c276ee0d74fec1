// What tiles share (docs/tile-format.md, section 3, `resources`). Each resource is loaded once, however many tiles need it,
// and its bytes count once: in the page while a tile needs it that is wanted, on its way or on the card; on the card from
// the first tile that gets room there to the last one that leaves it.
import { SceneError } from '../scene-error';
import type { StreamSettings, StreamStatistics } from './tile-streamer';

export interface ResourceSource<Resource> {
  resourcesOf(tile: number): readonly number[]; // their numbers, none twice
  promisedBytes(id: number): number; // of its file; 0 where nobody knows
  // Fetches and reads it. `pageBytes` it takes in the page for as long as tiles that come may need it.
  load(id: number, signal: AbortSignal): Promise<{ resource: Resource; fileBytes: number; pageBytes: number; cardBytes: number }>;
}

interface Entry<Resource> {
  state: 'absent' | 'loading' | 'loaded';
  resource?: Resource;
  abort?: AbortController;
  pageBytes: number;
  cardBytes?: number; // where it is known
  holders: number; // tiles that are on the card, or have room there; its cardBytes count while there are any
  failures: number;
  retryAt: number;
  error?: SceneError;
}

export class SharedResources<Resource> {
  private readonly entries = new Map<number, Entry<Resource>>();
  loading = 0;
  // Of one that cannot be had, with a tile that needs it; told once each.
  onError: (error: SceneError, tile: number) => void = () => {};

  // Without a source, tiles share nothing.
  constructor(
    private readonly source: ResourceSource<Resource> | undefined,
    private readonly statistics: StreamStatistics,
    private readonly now: () => number,
  ) {}

  of(tile: number): readonly number[] {
    return this.source?.resourcesOf(tile) ?? [];
  }

  // Of the card, as far as is known.
  bytesOf(id: number): number {
    return this.entry(id).cardBytes ?? this.source!.promisedBytes(id);
  }

  // Of the card: what is known of those that these tiles need, each once.
  knownBytesOf(tiles: readonly number[]): number {
    return sum([...this.neededBy(tiles)].map((id) => this.entry(id).cardBytes ?? 0));
  }

  // What more they take on the card, once this tile is there; all are to be loaded.
  bytesToHold(tile: number): number {
    return sum(this.entriesOf(tile).filter(({ holders }) => holders === 0).map(({ cardBytes }) => cardBytes!));
  }

  // What leaves the card when these tiles do, of what `staying` does not need.
  bytesFreedBy(tiles: readonly number[], staying: number): number {
    const stays = new Set(this.of(staying));
    const leaving = new Map<number, number>();
    for (const id of tiles.flatMap((tile) => this.of(tile))) leaving.set(id, (leaving.get(id) ?? 0) + 1);
    return sum([...leaving].map(([id, count]) => {
      const { holders, cardBytes = 0 } = this.entry(id);
      return !stays.has(id) && holders === count ? cardBytes : 0;
    }));
  }

  // From when on those of a tile may be asked for, in ms: what has failed, not before it is tried again.
  retryAt(tile: number): number {
    return Math.max(-Infinity, ...this.entriesOf(tile).map(({ state, retryAt }) => (state === 'absent' ? retryAt : -Infinity)));
  }

  errorOf(tile: number): SceneError | undefined {
    return this.entriesOf(tile).find(({ error }) => error)?.error;
  }

  areLoaded(tile: number): boolean {
    return this.entriesOf(tile).every(({ state }) => state === 'loaded');
  }

  // In the tile's order; all are to be loaded.
  loadedOf(tile: number): Resource[] {
    return this.entriesOf(tile).map(({ resource }) => resource!);
  }

  // Begins with those of a tile that are not there, at most so many at once in all.
  load(tile: number, { firstRetry, lastRetry }: StreamSettings, most: number): void {
    for (const id of this.of(tile)) {
      const entry = this.entry(id);
      if (entry.state !== 'absent' || this.loading >= most) continue;
      void this.fetch(id, entry, (error) => {
        entry.error = error instanceof SceneError ? error : new SceneError(`resource ${id}`, '', String(error), 'reload the page');
        entry.retryAt = this.now() + Math.min(lastRetry, firstRetry * 2 ** entry.failures);
        ++this.statistics.failures;
        if (entry.failures++ === 0) this.onError(entry.error, tile);
      });
    }
  }

  // The tile gets room on the card, and what it needs with it.
  hold(tile: number): void {
    for (const entry of this.entriesOf(tile)) if (entry.holders++ === 0) this.statistics.cardBytes += entry.cardBytes!;
  }

  release(tile: number): void {
    for (const entry of this.entriesOf(tile)) if (--entry.holders === 0) this.statistics.cardBytes -= entry.cardBytes!;
  }

  // Lets go of what none of these tiles needs.
  keepOnlyOf(tiles: readonly number[]): void {
    const needed = this.neededBy(tiles);
    for (const [id, entry] of this.entries) if (entry.state !== 'absent' && !needed.has(id)) this.forget(entry);
  }

  private neededBy(tiles: readonly number[]): Set<number> {
    return new Set(tiles.flatMap((tile) => this.of(tile)));
  }

  private entriesOf(tile: number): Entry<Resource>[] {
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
    this.holdInPage(entry, this.source!.promisedBytes(id));
    try {
      const { resource, fileBytes, pageBytes, cardBytes } = await this.source!.load(id, signal);
      if (signal.aborted) return;
      Object.assign(entry, { state: 'loaded', resource, cardBytes, failures: 0, error: undefined });
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
