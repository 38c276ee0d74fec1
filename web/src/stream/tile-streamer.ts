// Keeps what a view needs on the graphics card, within a number of bytes that is never passed: what a content takes is
// known, and room made for it, before any of it is allocated.
//
// A tile's way: absent → fetching (its file) → fetched (its size on the card is known; it waits for room, together with
// those that must come with it) → decoding (in a worker) → uploading (slice by slice) → resident. The coarsest tiles and
// the surround come first and stay. Of the others, what has not been drawn for longest goes first.
import { SceneError } from '../scene-error';
import type { Selection, TileRequest, TileSelector } from './tile-selector';
import type { SelectionView } from './tile-view';

export type UploadStep = 'more' | 'wait' | 'done';

// Where contents come from, and what becomes of them. `Fetched` is a file, `Decoded` its texels, `Resident` what is drawn.
export interface TileSource<Fetched, Decoded, Resident> {
  fetch(tile: number, signal: AbortSignal): Promise<{ file: Fetched; fileBytes: number; cardBytes: number }>;
  decode(tile: number, file: Fetched): Promise<Decoded>;
  allocate(tile: number, decoded: Decoded): Resident;
  // Takes the next slice to the card, and says what comes next: another; to wait for the card; or that it can be drawn.
  upload(resident: Resident): UploadStep;
  free(resident: Resident): void;
}

export interface StreamSettings {
  cardBytes: number; // of contents on the card, at most
  pageBytes: number; // of files and texels in the page; what is fetched for the most urgent request may pass it
  fetches: number; // at once
  decodes: number;
  patience: number; // ms for which a request must last before it is fetched, and be gone before a fetch is given up
  firstRetry: number; // ms after the first failure; twice as long after each next
  lastRetry: number;
}

export const kStreamSettings: StreamSettings = {
  cardBytes: 512 * 2 ** 20, pageBytes: 256 * 2 ** 20, fetches: 6, decodes: 2, patience: 150,
  firstRetry: 1000, lastRetry: 60000,
};

type State = 'absent' | 'fetching' | 'fetched' | 'decoding' | 'uploading' | 'resident';

interface Entry<Fetched, Resident> {
  state: State;
  pinned: boolean;
  lastUsed: number; // frames
  wantedSince: number; // ms; NaN where it is not
  lastWanted: number;
  abort?: AbortController;
  file?: Fetched;
  fileBytes: number; // in the page
  cardBytes: number; // 0: not known yet
  reserved: boolean; // cardBytes count
  resident?: Resident;
  failures: number;
  retryAt: number;
  error?: SceneError;
}

export interface StreamStatistics {
  cardBytes: number;
  mostCardBytes: number;
  pageBytes: number;
  fetchedBytes: number;
  resident: number;
  pending: number; // on their way
  loads: number;
  evictions: number;
  refusals: number; // of requests for which there was no room
  failures: number;
}

export class TileStreamer<Fetched, Decoded, Resident> {
  private readonly entries = new Map<number, Entry<Fetched, Resident>>();
  private readonly uploads: number[] = [];
  private frame = 0;
  private disposed = false;
  private toldOfBudget = false;
  private nextRetry = Infinity;
  readonly statistics: StreamStatistics = {
    cardBytes: 0, mostCardBytes: 0, pageBytes: 0, fetchedBytes: 0, resident: 0, pending: 0, loads: 0, evictions: 0,
    refusals: 0, failures: 0,
  };
  // Of tiles that cannot be had; told once each.
  onError: (error: SceneError, tile: number) => void = () => {};

  // `pinned`: the coarsest tiles, of the surround too.
  constructor(
    private readonly selector: TileSelector,
    private readonly source: TileSource<Fetched, Decoded, Resident>,
    private readonly pinned: number[],
    public settings: StreamSettings = { ...kStreamSettings },
    private readonly now: () => number = () => performance.now(),
  ) {
    for (const tile of pinned) this.entry(tile).pinned = true;
  }

  residentOf(tile: number): Resident | undefined {
    const entry = this.entries.get(tile);
    return entry?.state === 'resident' ? entry.resident : undefined;
  }

  errorOf(tile: number): SceneError | undefined {
    return this.entries.get(tile)?.error;
  }

  // All that is to be there always is, or cannot be had.
  get complete(): boolean {
    return this.pinned.every((tile) => this.residentOf(tile) !== undefined || this.errorOf(tile) !== undefined);
  }

  // Nothing is on its way, and nothing would be now if the view stayed as it is.
  get idle(): boolean {
    return this.statistics.pending === 0 && this.now() < this.nextRetry;
  }

  // Once a frame: what to draw, front to back, and behind it; and another step of what is on its way. `uploadFor` ms at
  // most are spent on uploads (but one slice a frame is always taken).
  update(view: SelectionView, uploadFor = 4): Pick<Selection, 'cut' | 'surround'> {
    ++this.frame;
    this.uploadSlices(uploadFor);
    this.keepToBudget();
    const now = this.now();
    const isThere = (tile: number) => this.residentOf(tile) !== undefined;
    // The coarsest count as loaded, though some may be missing: of the others the picture is right all the same.
    const { cut, surround, requests } = this.selector.select(view, (tile) => isThere(tile) || this.entry(tile).pinned);
    const drawn = cut.map(({ tile, visible }) => ({ tile, visible: visible && isThere(tile) }));
    const kept = new Set(drawn.filter(({ visible }) => visible).map(({ tile }) => tile));
    if (surround >= 0) kept.add(surround);
    for (const tile of kept) this.entry(tile).lastUsed = this.frame;
    const first = this.pinned
      .filter((tile) => !isThere(tile))
      .map((tile): TileRequest => ({ tiles: [tile], beside: [], priority: 0, distance: 0 }));
    this.load(this.complete ? [...first, ...requests] : first, kept, now);
    return { cut: drawn, surround };
  }

  // Lets go of everything, and of what is still on its way when it comes.
  dispose(): void {
    this.disposed = true;
    for (const [tile, entry] of this.entries) this.drop(tile, entry);
  }

  private entry(tile: number): Entry<Fetched, Resident> {
    let entry = this.entries.get(tile);
    if (!entry) {
      entry = {
        state: 'absent', pinned: false, lastUsed: 0, wantedSince: NaN, lastWanted: -Infinity, fileBytes: 0, cardBytes: 0,
        reserved: false, failures: 0, retryAt: 0,
      };
      this.entries.set(tile, entry);
    }
    return entry;
  }

  private load(requests: TileRequest[], kept: Set<number>, now: number): void {
    const { settings } = this;
    const wanted = new Set(requests.flatMap(({ tiles }) => tiles));
    for (const tile of wanted) {
      const entry = this.entry(tile);
      if (Number.isNaN(entry.wantedSince)) entry.wantedSince = now;
      entry.lastWanted = now;
    }
    for (const [tile, entry] of this.entries) this.giveUpIfUnwanted(tile, entry, wanted, now);
    let fetches = this.count('fetching');
    let mayPass = true; // the page's bytes: the most urgent request that can be had
    for (const request of requests) {
      const entries = request.tiles.map((tile) => this.entry(tile));
      if (entries.some((entry) => entry.state === 'absent' && now < entry.retryAt)) continue;
      // Where sizes are known and do not fit, nothing is fetched again.
      if (entries.every((entry) => entry.cardBytes > 0) && !this.couldFit(request, kept)) {
        this.refuse(entries);
        continue;
      }
      request.tiles.forEach((tile, i) => {
        const entry = entries[i];
        const isPatient = entry.pinned || now - entry.wantedSince >= settings.patience;
        const hasRoom = this.statistics.pageBytes < settings.pageBytes || mayPass;
        if (entry.state !== 'absent' || !isPatient || !hasRoom || fetches >= settings.fetches) return;
        ++fetches;
        void this.fetch(tile, entry);
      });
      mayPass = false;
      this.admit(request, entries, kept);
    }
    this.startDecodes(requests);
    this.countPending(wanted, now);
  }

  private count(state: State): number {
    let count = 0;
    for (const entry of this.entries.values()) count += entry.state === state ? 1 : 0;
    return count;
  }

  private giveUpIfUnwanted(tile: number, entry: Entry<Fetched, Resident>, wanted: Set<number>, now: number): void {
    if (wanted.has(tile) || entry.state === 'resident') return;
    if (now - entry.lastWanted < this.settings.patience) return;
    entry.wantedSince = NaN;
    if (entry.state === 'fetching') entry.abort!.abort();
    if (entry.state === 'fetched') this.forget(entry);
  }

  private missingBytes(tiles: number[]): number {
    return tiles.reduce((sum, tile) => {
      const entry = this.entry(tile);
      return sum + (entry.reserved ? 0 : entry.cardBytes);
    }, 0);
  }

  // Whether there is room, or may be made.
  private couldFit({ tiles, beside }: TileRequest, kept: Set<number>): boolean {
    const staying = new Set([...tiles, ...beside, ...kept]);
    let bytes = this.missingBytes(tiles);
    for (const [tile, entry] of this.entries) {
      if (entry.reserved && !this.isEvictable(tile, entry, staying)) bytes += entry.cardBytes;
    }
    return bytes <= this.settings.cardBytes;
  }

  // The budget may have become smaller: pictures of a larger window take their share of the card.
  private keepToBudget(): void {
    if (this.statistics.cardBytes <= this.settings.cardBytes) return;
    const oldest = [...this.entries]
      .filter(([tile, entry]) => this.isEvictable(tile, entry, new Set()))
      .sort(([, a], [, b]) => a.lastUsed - b.lastUsed);
    for (const [tile, entry] of oldest) {
      if (this.statistics.cardBytes <= this.settings.cardBytes) return;
      this.drop(tile, entry);
      ++this.statistics.evictions;
    }
  }

  private isEvictable(tile: number, entry: Entry<Fetched, Resident>, staying: Set<number>): boolean {
    return entry.state === 'resident' && !entry.pinned && !staying.has(tile);
  }

  // When all files of a request are there, room is made for all of it; that it can be is known.
  private admit(request: TileRequest, entries: Entry<Fetched, Resident>[], kept: Set<number>): void {
    if (entries.some((entry) => entry.state === 'absent' || entry.state === 'fetching')) return;
    if (entries.every((entry) => entry.reserved)) return;
    const staying = new Set([...request.tiles, ...request.beside, ...kept]);
    const oldest = [...this.entries]
      .filter(([tile, entry]) => this.isEvictable(tile, entry, staying))
      .sort(([, a], [, b]) => a.lastUsed - b.lastUsed);
    while (this.statistics.cardBytes + this.missingBytes(request.tiles) > this.settings.cardBytes) {
      const [tile, entry] = oldest.shift()!;
      this.drop(tile, entry);
      ++this.statistics.evictions;
    }
    for (const entry of entries) {
      if (entry.reserved) continue;
      entry.reserved = true;
      this.statistics.cardBytes += entry.cardBytes;
    }
    this.statistics.mostCardBytes = Math.max(this.statistics.mostCardBytes, this.statistics.cardBytes);
  }

  private refuse(entries: Entry<Fetched, Resident>[]): void {
    ++this.statistics.refusals;
    if (entries.some((entry) => entry.pinned)) this.failPinned();
    for (const entry of entries) if (entry.state === 'fetched' && !entry.reserved) this.forget(entry);
  }

  private failPinned(): void {
    const entries = this.pinned.map((tile) => this.entry(tile));
    const needed = entries.reduce((sum, entry) => sum + entry.cardBytes, 0);
    const mebibytes = (bytes: number) => Math.ceil(bytes / 2 ** 20);
    const error = new SceneError(
      'scene', '', `its coarsest level takes ${mebibytes(needed)} MiB on the graphics card, the budget is ${mebibytes(this.settings.cardBytes)} MiB`,
      'raise the budget, or bake more levels of detail');
    if (!this.toldOfBudget) this.onError(error, this.pinned[0]);
    this.toldOfBudget = true;
    for (const entry of entries) if (entry.state !== 'resident') entry.error = error;
  }

  private async fetch(tile: number, entry: Entry<Fetched, Resident>): Promise<void> {
    entry.state = 'fetching';
    entry.abort = new AbortController();
    const { signal } = entry.abort;
    try {
      const { file, fileBytes, cardBytes } = await this.source.fetch(tile, signal);
      if (this.disposed || signal.aborted) return;
      entry.file = file;
      entry.fileBytes = fileBytes;
      entry.cardBytes = cardBytes;
      entry.state = 'fetched';
      this.statistics.pageBytes += fileBytes;
      this.statistics.fetchedBytes += fileBytes;
    } catch (error) {
      if (!signal.aborted && !this.disposed) this.fail(tile, entry, error);
    } finally {
      entry.abort = undefined;
      if (entry.state === 'fetching') entry.state = 'absent';
    }
  }

  private startDecodes(requests: TileRequest[]): void {
    let decodes = this.count('decoding');
    for (const { tiles } of requests) {
      for (const tile of tiles) {
        const entry = this.entry(tile);
        if (entry.state !== 'fetched' || !entry.reserved || decodes >= this.settings.decodes) continue;
        const hasRoom = this.statistics.pageBytes + entry.cardBytes <= this.settings.pageBytes;
        if (!hasRoom && (decodes > 0 || this.uploads.length > 0)) continue;
        ++decodes;
        void this.decode(tile, entry);
      }
    }
  }

  private async decode(tile: number, entry: Entry<Fetched, Resident>): Promise<void> {
    entry.state = 'decoding';
    this.statistics.pageBytes += entry.cardBytes; // texels take as much in the page until they are on the card
    try {
      const decoded = await this.source.decode(tile, entry.file!);
      if (this.disposed) throw new Error('disposed');
      entry.resident = this.source.allocate(tile, decoded);
      entry.state = 'uploading';
      this.uploads.push(tile);
    } catch (error) {
      if (!this.disposed) this.fail(tile, entry, error);
      this.statistics.pageBytes -= entry.cardBytes;
      this.release(entry);
      entry.state = 'absent';
    } finally {
      this.statistics.pageBytes -= entry.fileBytes;
      entry.fileBytes = 0;
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
        entry.wantedSince = NaN;
        this.statistics.pageBytes -= entry.cardBytes;
        ++this.statistics.loads;
        ++this.statistics.resident;
      }
      if (this.now() >= end) return;
    }
  }

  private fail(tile: number, entry: Entry<Fetched, Resident>, error: unknown): void {
    const { firstRetry, lastRetry } = this.settings;
    entry.error = error instanceof SceneError ? error : new SceneError(`tile ${tile}`, '', String(error), 'reload the page');
    entry.retryAt = this.now() + Math.min(lastRetry, firstRetry * 2 ** entry.failures);
    if (entry.failures++ === 0) this.onError(entry.error, tile);
    ++this.statistics.failures;
  }

  // A file that is not needed after all.
  private forget(entry: Entry<Fetched, Resident>): void {
    this.statistics.pageBytes -= entry.fileBytes;
    entry.fileBytes = 0;
    entry.file = undefined;
    entry.state = 'absent';
    this.release(entry);
  }

  private release(entry: Entry<Fetched, Resident>): void {
    if (entry.reserved) this.statistics.cardBytes -= entry.cardBytes;
    entry.reserved = false;
  }

  private drop(tile: number, entry: Entry<Fetched, Resident>): void {
    entry.abort?.abort();
    if (entry.resident) this.source.free(entry.resident);
    if (entry.state === 'resident') --this.statistics.resident;
    if (entry.state === 'uploading') {
      this.uploads.splice(this.uploads.indexOf(tile), 1);
      this.statistics.pageBytes -= entry.cardBytes;
    }
    entry.resident = undefined;
    if (entry.state === 'decoding') return; // lets go of itself
    this.forget(entry);
  }

  private countPending(wanted: Set<number>, now: number): void {
    let pending = 0;
    this.nextRetry = Infinity;
    for (const [tile, { state, retryAt, reserved, wantedSince }] of this.entries) {
      if (state === 'absent' && wanted.has(tile) && retryAt > now) this.nextRetry = Math.min(this.nextRetry, retryAt);
      const comes = state === 'fetching' || state === 'decoding' || state === 'uploading' || (state === 'fetched' && reserved);
      const waits = state === 'absent' && wanted.has(tile) && now >= retryAt && now - wantedSince < this.settings.patience;
      if (comes || waits) ++pending;
    }
    this.statistics.pending = pending;
  }
}
