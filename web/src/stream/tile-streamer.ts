// Keeps the tiles that a view needs on the GPU, within a budget that is never exceeded: the size of a content is known,
// and memory is freed for it, before any of it is allocated.
//
// The states of a tile are: absent → fetching (its file) → fetched (its size on the GPU is known; it waits for shared
// resources and for memory) → decoding (in a worker) → uploading (slice by slice) → resident. The coarsest tiles and
// the background block are loaded first and are never evicted. When memory is needed, tiles that the selector no longer
// requests are evicted, the least recently drawn first; tiles that are still drawn are evicted last and are then
// replaced by coarser ones.
import { SceneError } from '../scene-error';
import { SharedResources, type ResourceSource } from './shared-resources';
import type { Cut, TileSelector } from './tile-selector';
import type { SelectionView } from './tile-view';

export type UploadStep = 'more' | 'wait' | 'done';

// Loads contents and manages their GPU memory. `Fetched` is a file, `Decoded` its texels, `Resident` what is drawn, and
// `Resource` what tiles share: each tile is given its own resources, in its order.
export interface TileSource<Fetched, Decoded, Resident, Resource = unknown> {
  readonly resources?: ResourceSource<Resource>; // undefined where tiles share nothing
  declaredBytes(tile: number): number; // size of its file in bytes; 0 if unknown
  fetch(tile: number, signal: AbortSignal): Promise<{ file: Fetched; fileBytes: number; gpuBytes: number }>;
  decode(tile: number, file: Fetched, resources: readonly Resource[]): Promise<Decoded>;
  allocate(tile: number, decoded: Decoded, resources: readonly Resource[]): Resident;
  // Uploads the next slice to the GPU. Returns 'more' if another slice follows, 'wait' while the GPU is busy, and
  // 'done' when the content can be drawn.
  upload(resident: Resident): UploadStep;
  free(resident: Resident): void;
}

export interface StreamSettings {
  gpuBytes: number; // budget for contents on the GPU
  pageBytes: number; // budget for files and texels in the page, which only the most urgent tile may exceed
  fetches: number; // concurrent fetches
  decodes: number; // concurrent decodes; also the number of worker threads of a scene
  patience: number; // ms for which a tile must be requested before it is fetched, and unrequested before its fetch is cancelled
  firstRetry: number; // ms after the first failure; doubled after each further failure
  lastRetry: number; // ms; the largest delay between two attempts
}

export const kStreamSettings: StreamSettings = {
  gpuBytes: 512 * 2 ** 20, pageBytes: 256 * 2 ** 20, fetches: 6, decodes: 2, patience: 150,
  firstRetry: 1000, lastRetry: 60000,
};

type State = 'absent' | 'fetching' | 'fetched' | 'decoding' | 'uploading' | 'resident';

interface Entry<Fetched, Resident> {
  state: State;
  pinned: boolean;
  lastUsed: number; // the frame in which it was last drawn
  requestedSince: number; // ms; NaN while it is not requested
  lastRequested: number;
  abort?: AbortController;
  file?: Fetched;
  fileBytes: number; // in the page
  gpuBytes: number; // 0 until known
  reserved: boolean; // true while gpuBytes is counted: the tile is on the GPU or has been admitted to it
  resident?: Resident;
  failures: number;
  retryAt: number;
  error?: SceneError;
}

export interface StreamStatistics {
  gpuBytes: number; // of contents on the GPU, now
  maxGpuBytes: number; // its maximum so far
  pageBytes: number; // of files and texels in the page, now
  fetchedBytes: number; // sum over all fetches
  resident: number; // tiles on the GPU
  pending: number; // requested tiles that are not resident yet
  loads: number; // tiles that became resident so far
  evictions: number; // tiles that were removed from the GPU so far
  refused: number; // tiles of the last view that do not fit into the budget
  failures: number;
}

export class TileStreamer<Fetched, Decoded, Resident, Resource = unknown> {
  private readonly entries = new Map<number, Entry<Fetched, Resident>>();
  private readonly uploads: number[] = [];
  private frame = 0;
  private disposed = false;
  private toldOfBudget = false;
  private nextRetry = Infinity;
  private readonly known = { tiles: 0, declaredBytes: 0, gpuBytes: 0 }; // sums over the tiles whose size on the GPU is known
  readonly statistics: StreamStatistics = {
    gpuBytes: 0, maxGpuBytes: 0, pageBytes: 0, fetchedBytes: 0, resident: 0, pending: 0, loads: 0, evictions: 0,
    refused: 0, failures: 0,
  };
  private readonly shared: SharedResources<Resource>;
  // Called once for each tile, and each shared resource, that cannot be loaded.
  onError: (error: SceneError, tile: number) => void = () => {};

  constructor(
    private readonly selector: TileSelector,
    private readonly source: TileSource<Fetched, Decoded, Resident, Resource>,
    public settings: StreamSettings = { ...kStreamSettings },
    private readonly now: () => number = () => performance.now(),
  ) {
    for (const tile of selector.pinned) this.entry(tile).pinned = true;
    this.shared = new SharedResources(source.resources, this.statistics, now);
    this.shared.onError = (error, tile) => this.onError(error, tile);
  }

  findResident(tile: number): Resident | undefined {
    const entry = this.entries.get(tile);
    return entry?.state === 'resident' ? entry.resident : undefined;
  }

  tileError(tile: number): SceneError | undefined {
    return this.entries.get(tile)?.error ?? this.shared.tileError(tile);
  }

  // True when every pinned tile is resident or cannot be loaded.
  get complete(): boolean {
    return this.selector.pinned.every((tile) => this.findResident(tile) !== undefined || this.tileError(tile) !== undefined);
  }

  // True when nothing is in progress and nothing would be started if the view did not change.
  get idle(): boolean {
    return this.statistics.pending === 0 && this.now() < this.nextRetry;
  }

  // Is called once a frame. Returns what to draw, front to back, and the background block behind it, and advances the
  // loading by one step. At most `uploadFor` ms are spent on uploads, but at least one slice is uploaded in each frame.
  update(view: SelectionView, uploadFor = 4): Cut {
    ++this.frame;
    this.uploadSlices(uploadFor);
    const now = this.now();
    this.nextRetry = Infinity;
    const { requested, refused } = this.selector.choose(view, {
      budget: this.settings.gpuBytes,
      holds: (tile) => this.entry(tile).reserved,
      estimateBytes: (tile) => this.estimateBytes(tile),
      canBeHad: (tile) => this.canBeHad(tile, now),
      hasFailed: (tile) => this.tileError(tile) !== undefined,
      tileResources: (tile) => this.shared.of(tile),
      bytesOfResource: (id) => this.shared.estimateBytes(id),
    });
    this.statistics.refused = refused;
    this.keepToBudget(requested);
    const isTooMuch = this.pinnedBytes() > this.settings.gpuBytes;
    if (isTooMuch) this.failPinned();
    else this.toldOfBudget = false;
    const missing = isTooMuch ? [] : this.selector.pinned.filter((tile) => !this.findResident(tile) && this.canBeHad(tile, now));
    this.load(this.complete ? [...missing, ...requested] : missing, now);
    // Pinned tiles count as resident while some are loaded: what is drawn of the others is correct all the same.
    const { tiles, backgroundBlock } = this.selector.cut(view, (tile) =>
      this.findResident(tile) !== undefined || (this.entry(tile).pinned && this.tileError(tile) === undefined));
    const drawn = tiles.map((one) => ({ ...one, visible: one.visible && this.findResident(one.content) !== undefined }));
    for (const { content, visible } of drawn) if (visible) this.entry(content).lastUsed = this.frame;
    if (backgroundBlock >= 0) this.entry(backgroundBlock).lastUsed = this.frame;
    return { tiles: drawn, backgroundBlock };
  }

  // Frees everything; contents that are still being loaded are dropped when they arrive.
  dispose(): void {
    this.disposed = true;
    for (const [tile, entry] of this.entries) this.drop(tile, entry);
    this.shared.releaseAllExcept([]);
  }

  private entry(tile: number): Entry<Fetched, Resident> {
    let entry = this.entries.get(tile);
    if (!entry) {
      entry = {
        state: 'absent', pinned: false, lastUsed: 0, requestedSince: NaN, lastRequested: -Infinity, fileBytes: 0, gpuBytes: 0,
        reserved: false, failures: 0, retryAt: 0,
      };
      this.entries.set(tile, entry);
    }
    return entry;
  }

  private load(requested: number[], now: number): void {
    const isRequested = new Set(requested);
    for (const tile of requested) {
      const entry = this.entry(tile);
      if (Number.isNaN(entry.requestedSince)) entry.requestedSince = now;
      entry.lastRequested = now;
    }
    for (const [tile, entry] of this.entries) this.cancelIfUnrequested(tile, entry, isRequested, now);
    let fetches = this.count('fetching');
    let mayPass = true; // whether this tile may exceed the page budget: only the most urgent one may
    for (const tile of requested) {
      const entry = this.entry(tile);
      if (entry.state === 'resident') continue;
      const isPatient = entry.pinned || now - entry.requestedSince >= this.settings.patience;
      const fitsBudget = mayPass || this.statistics.pageBytes + this.source.declaredBytes(tile) <= this.settings.pageBytes;
      mayPass = false;
      if (!entry.reserved && isPatient && fitsBudget) this.shared.load(tile, this.settings, this.settings.fetches - fetches);
      if (entry.state === 'absent' && isPatient && fitsBudget && fetches + this.shared.loading < this.settings.fetches) {
        ++fetches;
        void this.fetch(tile, entry);
      }
      if (entry.state === 'fetched' && !entry.reserved) this.admit(tile, entry, isRequested);
    }
    this.forgetResources(requested);
    this.startDecodes(requested);
    this.countPending(isRequested, now);
  }

  // Returns the GPU bytes of a tile if known, otherwise an estimate that assumes the compression ratio of the known
  // tiles.
  private estimateBytes(tile: number): number {
    const { gpuBytes } = this.entry(tile);
    if (gpuBytes > 0 || this.known.tiles === 0) return gpuBytes;
    const declared = this.source.declaredBytes(tile);
    if (declared > 0 && this.known.declaredBytes > 0) return (declared * this.known.gpuBytes) / this.known.declaredBytes;
    return this.known.gpuBytes / this.known.tiles;
  }

  // Returns false for tiles that failed and are to be retried later.
  private canBeHad(tile: number, now: number): boolean {
    const entry = this.entry(tile);
    const retryAt = Math.max(entry.state === 'absent' ? entry.retryAt : -Infinity, this.shared.retryAt(tile));
    if (now >= retryAt) return true;
    this.nextRetry = Math.min(this.nextRetry, retryAt);
    return false;
  }

  private count(state: State): number {
    let count = 0;
    for (const entry of this.entries.values()) count += entry.state === state ? 1 : 0;
    return count;
  }

  private cancelIfUnrequested(tile: number, entry: Entry<Fetched, Resident>, requested: Set<number>, now: number): void {
    if (requested.has(tile) || entry.state === 'resident') return;
    if (now - entry.lastRequested < this.settings.patience) return;
    entry.requestedSince = NaN;
    if (entry.state === 'fetching') entry.abort!.abort();
    if (entry.state === 'fetched') this.forget(tile, entry);
  }

  // Evicts down to a budget that may have become smaller, as when a larger window takes more GPU memory for its render
  // targets. Of the requested tiles the least urgent are evicted first, and only while unrequested tiles that are still
  // being loaded occupy the memory.
  private keepToBudget(requested: number[]): void {
    if (this.statistics.gpuBytes <= this.settings.gpuBytes) return;
    const isRequested = new Set(requested);
    const minimum = requested.map((tile) => [tile, this.entry(tile)] as const).filter(([, { state }]) => state === 'resident').reverse();
    this.evict([...this.unrequested(isRequested), ...minimum]);
  }

  // Returns the tiles that may be evicted, the least recently drawn first.
  private unrequested(requested: Set<number>): [number, Entry<Fetched, Resident>][] {
    return [...this.entries]
      .filter(([tile, { state, pinned }]) => state === 'resident' && !pinned && !requested.has(tile))
      .sort(([, a], [, b]) => a.lastUsed - b.lastUsed);
  }

  // Evicts tiles until `bytes` more fit into the budget, or no tile is left.
  private evict(going: readonly (readonly [number, Entry<Fetched, Resident>])[], bytes = 0): void {
    for (const [tile, entry] of going) {
      if (this.statistics.gpuBytes + bytes <= this.settings.gpuBytes) return;
      this.drop(tile, entry);
      ++this.statistics.evictions;
    }
  }

  // Admits a tile once its size and those of its resources are known, evicting others. Returns without admitting it
  // while the memory is held by unrequested tiles that are still being loaded.
  private admit(tile: number, entry: Entry<Fetched, Resident>, requested: Set<number>): void {
    if (!this.shared.areLoaded(tile)) return;
    const going = this.unrequested(requested);
    const freed = this.shared.bytesFreedBy(going.map(([one]) => one), tile);
    const free = going.reduce((sum, [, { gpuBytes }]) => sum + gpuBytes, this.settings.gpuBytes - this.statistics.gpuBytes) + freed;
    if (entry.gpuBytes + this.shared.bytesToHold(tile) > free) return;
    this.shared.hold(tile); // before the evictions, which would otherwise release its resources
    this.evict(going, entry.gpuBytes);
    entry.reserved = true;
    this.statistics.gpuBytes += entry.gpuBytes;
    this.statistics.maxGpuBytes = Math.max(this.statistics.maxGpuBytes, this.statistics.gpuBytes);
  }

  private pinnedBytes(): number {
    const { pinned } = this.selector;
    return pinned.reduce((sum, tile) => sum + this.entry(tile).gpuBytes, this.shared.knownResourceBytes(pinned));
  }

  private failPinned(): void {
    const mebibytes = (bytes: number) => Math.max(0, bytes / 2 ** 20).toFixed(1);
    const error = new SceneError(
      'scene', '',
      `its coarsest level takes ${mebibytes(this.pinnedBytes())} MiB on the GPU, the budget leaves ${mebibytes(this.settings.gpuBytes)} MiB for it`,
      'raise the budget, draw fewer pixels, or bake more levels of detail');
    const isMissing = this.selector.pinned.some((tile) => !this.findResident(tile));
    if (isMissing && !this.toldOfBudget) this.onError(error, this.selector.pinned[0]);
    this.toldOfBudget = true;
    for (const tile of this.selector.pinned) {
      const entry = this.entry(tile);
      if (entry.state !== 'resident') entry.error = error;
      if (entry.state === 'fetched' && !entry.reserved) this.forget(tile, entry);
    }
  }

  // Releases the resources that no tile needs which is requested, in progress or on the GPU.
  private forgetResources(requested: number[]): void {
    if (!this.source.resources) return;
    const there = [...this.entries].filter(([, { state }]) => state !== 'absent').map(([tile]) => tile);
    this.shared.releaseAllExcept([...requested, ...there]);
  }

  private async fetch(tile: number, entry: Entry<Fetched, Resident>): Promise<void> {
    entry.state = 'fetching';
    entry.abort = new AbortController();
    const { signal } = entry.abort;
    this.holdInPage(entry, this.source.declaredBytes(tile));
    try {
      const { file, fileBytes, gpuBytes } = await this.source.fetch(tile, signal);
      if (this.disposed || signal.aborted) return;
      if (entry.gpuBytes === 0) this.learn(tile, gpuBytes);
      entry.file = file;
      entry.gpuBytes = gpuBytes;
      entry.state = 'fetched';
      this.holdInPage(entry, fileBytes);
      this.statistics.fetchedBytes += fileBytes;
    } catch (error) {
      if (!signal.aborted && !this.disposed) this.fail(tile, entry, error);
    } finally {
      entry.abort = undefined;
      if (entry.state === 'fetching') this.forget(tile, entry);
    }
  }

  private learn(tile: number, gpuBytes: number): void {
    const declared = this.source.declaredBytes(tile);
    ++this.known.tiles;
    this.known.declaredBytes += declared;
    this.known.gpuBytes += gpuBytes;
  }

  private holdInPage(entry: Entry<Fetched, Resident>, fileBytes: number): void {
    this.statistics.pageBytes += fileBytes - entry.fileBytes;
    entry.fileBytes = fileBytes;
  }

  private startDecodes(requested: number[]): void {
    let decodes = this.count('decoding');
    for (const tile of requested) {
      const entry = this.entry(tile);
      if (entry.state !== 'fetched' || !entry.reserved || decodes >= this.settings.decodes) continue;
      const fitsBudget = this.statistics.pageBytes + entry.gpuBytes <= this.settings.pageBytes;
      if (!fitsBudget && (decodes > 0 || this.uploads.length > 0)) continue;
      ++decodes;
      void this.decode(tile, entry);
    }
  }

  private async decode(tile: number, entry: Entry<Fetched, Resident>): Promise<void> {
    entry.state = 'decoding';
    this.statistics.pageBytes += entry.gpuBytes; // decoded texels take as much memory in the page until they are on the GPU
    try {
      const resources = this.shared.loadedResources(tile);
      const decoded = await this.source.decode(tile, entry.file!, resources);
      if (this.disposed) throw new Error('disposed');
      entry.resident = this.source.allocate(tile, decoded, resources);
      entry.state = 'uploading';
      this.uploads.push(tile);
    } catch (error) {
      if (!this.disposed) this.fail(tile, entry, error);
      this.statistics.pageBytes -= entry.gpuBytes;
      this.release(tile, entry);
      entry.state = 'absent';
    } finally {
      this.holdInPage(entry, 0);
      entry.file = undefined;
    }
  }

  private uploadSlices(milliseconds: number): void {
    const end = this.now() + milliseconds;
    while (this.uploads.length > 0) {
      const tile = this.uploads[0];
      const entry = this.entry(tile);
      const step = this.source.upload(entry.resident!);
      if (step === 'wait') return;
      if (step === 'done') {
        this.uploads.shift();
        entry.state = 'resident';
        entry.failures = 0;
        entry.error = undefined;
        entry.lastUsed = this.frame;
        entry.requestedSince = NaN;
        this.statistics.pageBytes -= entry.gpuBytes;
        ++this.statistics.loads;
        ++this.statistics.resident;
      }
      if (this.now() >= end) return;
    }
  }

  private fail(tile: number, entry: Entry<Fetched, Resident>, error: unknown): void {
    const { firstRetry, lastRetry } = this.settings;
    entry.error = error instanceof SceneError ? error : new SceneError(`tile ${tile}`, '', String(error), 'reload the page');
    entry.retryAt = entry.error.isFinal ? Infinity : this.now() + Math.min(lastRetry, firstRetry * 2 ** entry.failures);
    if (entry.failures++ === 0) this.onError(entry.error, tile);
    ++this.statistics.failures;
  }

  // Drops a file that is no longer needed.
  private forget(tile: number, entry: Entry<Fetched, Resident>): void {
    this.holdInPage(entry, 0);
    entry.file = undefined;
    entry.state = 'absent';
    this.release(tile, entry);
  }

  private release(tile: number, entry: Entry<Fetched, Resident>): void {
    if (!entry.reserved) return;
    entry.reserved = false;
    this.statistics.gpuBytes -= entry.gpuBytes;
    this.shared.release(tile);
  }

  private drop(tile: number, entry: Entry<Fetched, Resident>): void {
    entry.abort?.abort();
    if (entry.resident) this.source.free(entry.resident);
    if (entry.state === 'resident') --this.statistics.resident;
    if (entry.state === 'uploading') {
      this.uploads.splice(this.uploads.indexOf(tile), 1);
      this.statistics.pageBytes -= entry.gpuBytes;
    }
    entry.resident = undefined;
    if (entry.state === 'decoding') return; // decode drops it when its worker has finished
    this.forget(tile, entry);
  }

  private countPending(requested: Set<number>, now: number): void {
    let pending = this.shared.loading;
    for (const [tile, { state, reserved, retryAt }] of this.entries) {
      const comes = state === 'fetching' || state === 'decoding' || state === 'uploading' || (state === 'fetched' && reserved);
      const waits = requested.has(tile) && state !== 'resident' && now >= retryAt;
      if (comes || waits) ++pending;
    }
    this.statistics.pending = pending;
  }
}
