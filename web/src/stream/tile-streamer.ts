// Keeps what a view needs on the graphics card, within a number of bytes that is never passed: what a content takes is
// known, and room made for it, before any of it is allocated.
//
// A tile's way: absent → fetching (its file) → fetched (its size on the card is known; it waits for what it shares with
// others, and for room) → decoding (in a worker) → uploading (slice by slice) → resident. The coarsest tiles and the
// surround come first and stay. Of the others those go that the selector does not want any more, when there is need of
// their room: what has not been drawn for longest first, and at last what is drawn, which then is drawn coarser.
import { SceneError } from '../scene-error';
import { SharedResources, type ResourceSource } from './shared-resources';
import type { Cut, TileSelector } from './tile-selector';
import type { SelectionView } from './tile-view';

export type UploadStep = 'more' | 'wait' | 'done';

// Where contents come from, and what becomes of them. `Fetched` is a file, `Decoded` its texels, `Resident` what is drawn,
// `Resource` what a tile shares with others: it is given its own, in its order.
export interface TileSource<Fetched, Decoded, Resident, Resource = unknown> {
  readonly resources?: ResourceSource<Resource>; // none where tiles share nothing
  promisedBytes(tile: number): number; // of its file; 0 where nobody knows
  fetch(tile: number, signal: AbortSignal): Promise<{ file: Fetched; fileBytes: number; cardBytes: number }>;
  decode(tile: number, file: Fetched, resources: readonly Resource[]): Promise<Decoded>;
  allocate(tile: number, decoded: Decoded, resources: readonly Resource[]): Resident;
  // Takes the next slice to the card, and says what comes next: another; to wait for the card; or that it can be drawn.
  upload(resident: Resident): UploadStep;
  free(resident: Resident): void;
}

export interface StreamSettings {
  cardBytes: number; // of contents on the card, at most
  pageBytes: number; // of files and texels in the page; what is most urgent may pass it
  fetches: number; // at once
  decodes: number;
  patience: number; // ms for which a tile must be wanted before it is fetched, and unwanted before a fetch is given up
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
  reserved: boolean; // cardBytes count: it is on the card, or will be
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
  refused: number; // that the last view asked for, and the budget has no room for
  failures: number;
}

export class TileStreamer<Fetched, Decoded, Resident, Resource = unknown> {
  private readonly entries = new Map<number, Entry<Fetched, Resident>>();
  private readonly uploads: number[] = [];
  private frame = 0;
  private disposed = false;
  private toldOfBudget = false;
  private nextRetry = Infinity;
  private readonly known = { tiles: 0, promisedBytes: 0, cardBytes: 0 }; // of those whose size on the card is known
  readonly statistics: StreamStatistics = {
    cardBytes: 0, mostCardBytes: 0, pageBytes: 0, fetchedBytes: 0, resident: 0, pending: 0, loads: 0, evictions: 0,
    refused: 0, failures: 0,
  };
  private readonly shared: SharedResources<Resource>;
  // Of tiles that cannot be had, and of what they share; told once each.
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

  residentOf(tile: number): Resident | undefined {
    const entry = this.entries.get(tile);
    return entry?.state === 'resident' ? entry.resident : undefined;
  }

  errorOf(tile: number): SceneError | undefined {
    return this.entries.get(tile)?.error ?? this.shared.errorOf(tile);
  }

  // All that is to be there always is, or cannot be had.
  get complete(): boolean {
    return this.selector.pinned.every((tile) => this.residentOf(tile) !== undefined || this.errorOf(tile) !== undefined);
  }

  // Nothing is on its way, and nothing would be now if the view stayed as it is.
  get idle(): boolean {
    return this.statistics.pending === 0 && this.now() < this.nextRetry;
  }

  // Once a frame: what to draw, front to back, and behind it; and another step of what is on its way. `uploadFor` ms at
  // most are spent on uploads (but one slice a frame is always taken).
  update(view: SelectionView, uploadFor = 4): Cut {
    ++this.frame;
    this.uploadSlices(uploadFor);
    const now = this.now();
    this.nextRetry = Infinity;
    const { wanted, refused } = this.selector.choose(view, {
      budget: this.settings.cardBytes,
      holds: (tile) => this.entry(tile).reserved,
      bytesOf: (tile) => this.bytesOf(tile),
      canBeHad: (tile) => this.canBeHad(tile, now),
      resourcesOf: (tile) => this.shared.of(tile),
      bytesOfResource: (id) => this.shared.bytesOf(id),
    });
    this.statistics.refused = refused;
    this.keepToBudget(wanted);
    const isTooMuch = this.pinnedBytes() > this.settings.cardBytes;
    if (isTooMuch) this.failPinned();
    else this.toldOfBudget = false;
    const missing = isTooMuch ? [] : this.selector.pinned.filter((tile) => !this.residentOf(tile) && this.canBeHad(tile, now));
    this.load(this.complete ? [...missing, ...wanted] : missing, now);
    // The coarsest count as there, though some may be missing: of the others the picture is right all the same.
    const { tiles, surround } = this.selector.cut(view, (tile) => this.entry(tile).pinned || this.residentOf(tile) !== undefined);
    const drawn = tiles.map((one) => ({ ...one, visible: one.visible && this.residentOf(one.content) !== undefined }));
    for (const { content, visible } of drawn) if (visible) this.entry(content).lastUsed = this.frame;
    if (surround >= 0) this.entry(surround).lastUsed = this.frame;
    return { tiles: drawn, surround };
  }

  // Lets go of everything, and of what is still on its way when it comes.
  dispose(): void {
    this.disposed = true;
    for (const [tile, entry] of this.entries) this.drop(tile, entry);
    this.shared.keepOnlyOf([]);
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

  private load(wanted: number[], now: number): void {
    const isWanted = new Set(wanted);
    for (const tile of wanted) {
      const entry = this.entry(tile);
      if (Number.isNaN(entry.wantedSince)) entry.wantedSince = now;
      entry.lastWanted = now;
    }
    for (const [tile, entry] of this.entries) this.giveUpIfUnwanted(tile, entry, isWanted, now);
    let fetches = this.count('fetching');
    let mayPass = true; // the page's bytes: what is most urgent
    for (const tile of wanted) {
      const entry = this.entry(tile);
      if (entry.state === 'resident') continue;
      const isPatient = entry.pinned || now - entry.wantedSince >= this.settings.patience;
      const hasRoom = mayPass || this.statistics.pageBytes + this.source.promisedBytes(tile) <= this.settings.pageBytes;
      mayPass = false;
      if (!entry.reserved && isPatient && hasRoom) this.shared.load(tile, this.settings, this.settings.fetches - fetches);
      if (entry.state === 'absent' && isPatient && hasRoom && fetches + this.shared.loading < this.settings.fetches) {
        ++fetches;
        void this.fetch(tile, entry);
      }
      if (entry.state === 'fetched' && !entry.reserved) this.admit(tile, entry, isWanted);
    }
    this.forgetResources(wanted);
    this.startDecodes(wanted);
    this.countPending(isWanted, now);
  }

  // Of the card, as far as is known; else as for the others, whose files are as well packed.
  private bytesOf(tile: number): number {
    const { cardBytes } = this.entry(tile);
    if (cardBytes > 0 || this.known.tiles === 0) return cardBytes;
    const promised = this.source.promisedBytes(tile);
    if (promised > 0 && this.known.promisedBytes > 0) return (promised * this.known.cardBytes) / this.known.promisedBytes;
    return this.known.cardBytes / this.known.tiles;
  }

  // Not what is to be tried again later.
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

  private giveUpIfUnwanted(tile: number, entry: Entry<Fetched, Resident>, wanted: Set<number>, now: number): void {
    if (wanted.has(tile) || entry.state === 'resident') return;
    if (now - entry.lastWanted < this.settings.patience) return;
    entry.wantedSince = NaN;
    if (entry.state === 'fetching') entry.abort!.abort();
    if (entry.state === 'fetched') this.forget(tile, entry);
  }

  // The budget may have become smaller: pictures of a larger window take their share of the card. Of what is wanted, the
  // least urgent goes; there is need of that only while something is on its way that is not.
  private keepToBudget(wanted: number[]): void {
    if (this.statistics.cardBytes <= this.settings.cardBytes) return;
    const isWanted = new Set(wanted);
    const least = wanted.map((tile) => [tile, this.entry(tile)] as const).filter(([, { state }]) => state === 'resident').reverse();
    this.evict([...this.unwanted(isWanted), ...least]);
  }

  // What could go, what has not been drawn for longest first.
  private unwanted(wanted: Set<number>): [number, Entry<Fetched, Resident>][] {
    return [...this.entries]
      .filter(([tile, { state, pinned }]) => state === 'resident' && !pinned && !wanted.has(tile))
      .sort(([, a], [, b]) => a.lastUsed - b.lastUsed);
  }

  // Until the budget has room for `bytes` more, or nothing is left.
  private evict(going: readonly (readonly [number, Entry<Fetched, Resident>])[], bytes = 0): void {
    for (const [tile, entry] of going) {
      if (this.statistics.cardBytes + bytes <= this.settings.cardBytes) return;
      this.drop(tile, entry);
      ++this.statistics.evictions;
    }
  }

  // Makes room for it, now that its size is known, and that of what it shares; or waits, for what is on its way and not
  // wanted any more.
  private admit(tile: number, entry: Entry<Fetched, Resident>, wanted: Set<number>): void {
    if (!this.shared.areLoaded(tile)) return;
    const going = this.unwanted(wanted);
    const freed = this.shared.bytesFreedBy(going.map(([one]) => one), tile);
    const free = going.reduce((sum, [, { cardBytes }]) => sum + cardBytes, this.settings.cardBytes - this.statistics.cardBytes) + freed;
    if (entry.cardBytes + this.shared.bytesToHold(tile) > free) return;
    this.shared.hold(tile); // before others go, with which it would go too
    this.evict(going, entry.cardBytes);
    entry.reserved = true;
    this.statistics.cardBytes += entry.cardBytes;
    this.statistics.mostCardBytes = Math.max(this.statistics.mostCardBytes, this.statistics.cardBytes);
  }

  private pinnedBytes(): number {
    const { pinned } = this.selector;
    return pinned.reduce((sum, tile) => sum + this.entry(tile).cardBytes, this.shared.knownBytesOf(pinned));
  }

  private failPinned(): void {
    const mebibytes = (bytes: number) => Math.max(0, bytes / 2 ** 20).toFixed(1);
    const error = new SceneError(
      'scene', '',
      `its coarsest level takes ${mebibytes(this.pinnedBytes())} MiB on the graphics card, the budget leaves ${mebibytes(this.settings.cardBytes)} MiB for it`,
      'raise the budget, draw fewer pixels, or bake more levels of detail');
    const isMissing = this.selector.pinned.some((tile) => !this.residentOf(tile));
    if (isMissing && !this.toldOfBudget) this.onError(error, this.selector.pinned[0]);
    this.toldOfBudget = true;
    for (const tile of this.selector.pinned) {
      const entry = this.entry(tile);
      if (entry.state !== 'resident') entry.error = error;
      if (entry.state === 'fetched' && !entry.reserved) this.forget(tile, entry);
    }
  }

  // Those that no tile needs which is wanted, on its way or on the card.
  private forgetResources(wanted: number[]): void {
    if (!this.source.resources) return;
    const there = [...this.entries].filter(([, { state }]) => state !== 'absent').map(([tile]) => tile);
    this.shared.keepOnlyOf([...wanted, ...there]);
  }

  private async fetch(tile: number, entry: Entry<Fetched, Resident>): Promise<void> {
    entry.state = 'fetching';
    entry.abort = new AbortController();
    const { signal } = entry.abort;
    this.holdInPage(entry, this.source.promisedBytes(tile));
    try {
      const { file, fileBytes, cardBytes } = await this.source.fetch(tile, signal);
      if (this.disposed || signal.aborted) return;
      if (entry.cardBytes === 0) this.learn(tile, cardBytes);
      entry.file = file;
      entry.cardBytes = cardBytes;
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

  private learn(tile: number, cardBytes: number): void {
    const promised = this.source.promisedBytes(tile);
    ++this.known.tiles;
    this.known.promisedBytes += promised;
    this.known.cardBytes += cardBytes;
  }

  private holdInPage(entry: Entry<Fetched, Resident>, fileBytes: number): void {
    this.statistics.pageBytes += fileBytes - entry.fileBytes;
    entry.fileBytes = fileBytes;
  }

  private startDecodes(wanted: number[]): void {
    let decodes = this.count('decoding');
    for (const tile of wanted) {
      const entry = this.entry(tile);
      if (entry.state !== 'fetched' || !entry.reserved || decodes >= this.settings.decodes) continue;
      const hasRoom = this.statistics.pageBytes + entry.cardBytes <= this.settings.pageBytes;
      if (!hasRoom && (decodes > 0 || this.uploads.length > 0)) continue;
      ++decodes;
      void this.decode(tile, entry);
    }
  }

  private async decode(tile: number, entry: Entry<Fetched, Resident>): Promise<void> {
    entry.state = 'decoding';
    this.statistics.pageBytes += entry.cardBytes; // texels take as much in the page until they are on the card
    try {
      const resources = this.shared.loadedOf(tile);
      const decoded = await this.source.decode(tile, entry.file!, resources);
      if (this.disposed) throw new Error('disposed');
      entry.resident = this.source.allocate(tile, decoded, resources);
      entry.state = 'uploading';
      this.uploads.push(tile);
    } catch (error) {
      if (!this.disposed) this.fail(tile, entry, error);
      this.statistics.pageBytes -= entry.cardBytes;
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
  private forget(tile: number, entry: Entry<Fetched, Resident>): void {
    this.holdInPage(entry, 0);
    entry.file = undefined;
    entry.state = 'absent';
    this.release(tile, entry);
  }

  private release(tile: number, entry: Entry<Fetched, Resident>): void {
    if (!entry.reserved) return;
    entry.reserved = false;
    this.statistics.cardBytes -= entry.cardBytes;
    this.shared.release(tile);
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
    this.forget(tile, entry);
  }

  private countPending(wanted: Set<number>, now: number): void {
    let pending = this.shared.loading;
    for (const [tile, { state, reserved, retryAt }] of this.entries) {
      const comes = state === 'fetching' || state === 'decoding' || state === 'uploading' || (state === 'fetched' && reserved);
      const waits = wanted.has(tile) && state !== 'resident' && now >= retryAt;
      if (comes || waits) ++pending;
    }
    this.statistics.pending = pending;
  }
}
