import { describe, expect, it } from 'vitest';
import { SceneError } from '../scene-error';
import { addSurrounds, madeTree, madeView, randomNumbers } from '../testing/made-tree';
import { TileSelector } from './tile-selector';
import type { TileTree } from './tile-tree';
import { kStreamSettings, TileStreamer, type StreamSettings, type TileSource, type UploadStep } from './tile-streamer';

// A network and a card that count; time stands still but where a test lets it pass.
class FakeSource implements TileSource<number, number, { tile: number; slices: number }> {
  onCard = 0;
  mostOnCard = 0;
  fetches: number[] = [];
  aborted = 0;
  broken = new Set<number>(); // tiles that cannot be fetched
  latency = () => 1; // turns of the loop
  constructor(private readonly bytes: (tile: number) => number) {}

  promisedBytes(tile: number) {
    return this.bytes(tile) / 4;
  }
  async fetch(tile: number, signal: AbortSignal) {
    this.fetches.push(tile);
    for (let turns = this.latency(); turns > 0; --turns) {
      await Promise.resolve();
      if (signal.aborted) {
        ++this.aborted;
        throw new DOMException('aborted', 'AbortError');
      }
    }
    if (this.broken.has(tile)) throw new SceneError(`tiles/${tile}.glb`, '', 'was not found', 'copy the scene again');
    return { file: tile, fileBytes: this.bytes(tile) / 4, cardBytes: this.bytes(tile) };
  }
  async decode(_tile: number, file: number) {
    await Promise.resolve();
    return file;
  }
  allocate(tile: number, decoded: number) {
    expect(decoded).toBe(tile);
    this.onCard += this.bytes(tile);
    this.mostOnCard = Math.max(this.mostOnCard, this.onCard);
    return { tile, slices: 2 };
  }
  upload(resident: { tile: number; slices: number }): UploadStep {
    return --resident.slices === 0 ? 'done' : 'more';
  }
  free({ tile }: { tile: number }) {
    this.onCard -= this.bytes(tile);
  }
}

function make(tree: TileTree, cardBytes: number, settings: Partial<StreamSettings> = {}) {
  const source = new FakeSource((tile) => (tile === tree.surround ? 50 : 100));
  const clock = { now: 0 };
  const streamer = new TileStreamer(
    new TileSelector(tree), source, { ...kStreamSettings, cardBytes, ...settings }, () => clock.now);
  return { source, clock, streamer };
}

async function turns(count: number): Promise<void> {
  for (let i = 0; i < count; ++i) await Promise.resolve();
}

async function settle({ clock, streamer }: Pick<ReturnType<typeof make>, 'clock' | 'streamer'>, view: ReturnType<typeof madeView>, frames = 60) {
  let { tiles: cut } = streamer.update(view);
  for (let i = 0; i < frames; ++i) {
    clock.now += 20;
    await turns(12);
    ({ tiles: cut } = streamer.update(view));
  }
  return cut;
}

const near = madeView([0, 0, 1], 0.3, -0.3);
const far = madeView([0, 0, 400], 0, -1.5);

describe('a tile streamer', () => {
  it('draws the coarsest first, and then the finer ones', async () => {
    const made = make(madeTree(2), 1000);
    expect(made.streamer.update(near)).toEqual({ tiles: [{ tile: 0, content: 0, visible: false }], surround: -1 });
    const cut = await settle(made, near);
    expect(made.streamer.complete).toBe(true);
    expect(made.streamer.idle).toBe(true);
    expect(cut.filter(({ visible }) => visible).every(({ tile }) => tile > 0)).toBe(true);
    expect(made.streamer.statistics.cardBytes).toBe(made.source.onCard);
    expect(made.streamer.statistics.pageBytes).toBe(0);
  });

  it('never passes its budget, never lacks the coarsest, and gives everything back', async () => {
    const tree = madeTree(8);
    const { coarse } = addSurrounds(tree);
    const random = randomNumbers(11);
    const made = make(tree, 900, { patience: 0 });
    made.source.latency = () => 1 + Math.floor(random() * 30);
    await settle(made, far, 40);
    let view = far;
    for (let round = 0; round < 2000; ++round) {
      if (round % 40 === 0) {
        view = madeView([(random() - 0.5) * 16, (random() - 0.5) * 16, random() * 4], random() * 7, -random());
      }
      made.clock.now += 16;
      const { tiles: cut } = made.streamer.update(view);
      expect(made.streamer.residentOf(0)).toBeDefined();
      expect(made.streamer.residentOf(coarse)).toBeDefined();
      for (const { content, visible } of cut) expect(!visible || made.streamer.residentOf(content) !== undefined).toBe(true);
      expect(made.source.onCard).toBeLessThanOrEqual(made.streamer.statistics.cardBytes);
      expect(made.streamer.statistics.cardBytes).toBeLessThanOrEqual(900);
      await turns(Math.floor(random() * 8));
    }
    expect(made.streamer.statistics.evictions).toBeGreaterThan(10);
    expect(made.source.mostOnCard).toBeGreaterThan(600);
    made.streamer.dispose();
    await turns(100);
    expect(made.source.onCard).toBe(0);
    expect(made.streamer.statistics.cardBytes).toBe(0);
    expect(made.streamer.statistics.pageBytes).toBe(0);
  });

  it('fetches nothing that was looked at for a moment only, and gives up what nobody looks at any more', async () => {
    const made = make(madeTree(8), 1e6);
    await settle(made, far);
    const before = made.source.fetches.length;
    made.streamer.update(near);
    made.clock.now += 20;
    await settle(made, far, 2);
    expect(made.source.fetches.length).toBe(before);
    made.source.latency = () => 1e6;
    await settle(made, near, 20);
    expect(made.source.fetches.length).toBeGreaterThan(before);
    await settle(made, far, 20);
    expect(made.source.aborted).toBeGreaterThan(0);
    expect(made.streamer.idle).toBe(true);
  });

  it('does not fetch again and again what there is no room for', async () => {
    const made = make(madeTree(2), 250);
    await settle(made, near, 20);
    const before = made.source.fetches.length;
    await settle(made, near, 100);
    expect(made.source.fetches.length).toBe(before);
    expect(made.streamer.statistics.refused).toBeGreaterThan(0);
    expect(made.streamer.idle).toBe(true);
  });

  it('comes to an end with a page that holds a single file', async () => {
    const made = make(madeTree(8), 1e6, { pageBytes: 20, fetches: 1 });
    const cut = await settle(made, near, 400);
    expect(made.streamer.idle).toBe(true);
    const generous = make(madeTree(8), 1e6);
    expect(cut).toEqual(await settle(generous, near, 400));
  });

  it('says that the coarsest level alone is too much', async () => {
    const made = make(madeTree(2), 60);
    const errors: SceneError[] = [];
    made.streamer.onError = (error) => errors.push(error);
    await settle(made, far);
    expect(errors).toHaveLength(1);
    expect(errors[0].message).toContain('coarsest level');
    expect(made.source.onCard).toBe(0);
  });

  it('tries again, less and less often, and tells of a failure once', async () => {
    const made = make(madeTree(2), 1000, { firstRetry: 1000, lastRetry: 4000 });
    const errors: SceneError[] = [];
    made.streamer.onError = (error) => errors.push(error);
    made.source.broken.add(0);
    await settle(made, far, 5);
    expect(made.source.fetches).toEqual([0]);
    for (const [wait, expected] of [[1000, 2], [1900, 2], [200, 3], [4000, 4], [3000, 4], [1100, 5]]) {
      made.clock.now += wait;
      made.streamer.update(far);
      await turns(10);
      expect(made.source.fetches.length).toBe(expected);
    }
    expect(errors).toHaveLength(1);
    made.source.broken.clear();
    made.clock.now += 5000;
    await settle(made, far, 10);
    expect(made.streamer.complete).toBe(true);
  });

  it('draws the rest where one of the coarsest cannot be had, and that too when it can', async () => {
    const tree = madeTree(2);
    const { coarse, fine } = addSurrounds(tree);
    const made = make(tree, 1e6);
    made.source.broken.add(coarse).add(fine);
    const cut = await settle(made, near);
    expect(cut.filter(({ visible }) => visible).every(({ tile }) => tile > 0)).toBe(true);
    expect(made.streamer.residentOf(0)).toBeDefined();
    expect(made.streamer.complete).toBe(true);
    expect(made.streamer.idle).toBe(true);
    made.source.broken.clear();
    made.clock.now += 60000;
    expect(made.streamer.idle).toBe(false);
    await settle(made, near);
    expect(made.streamer.residentOf(coarse)).toBeDefined();
    expect(made.streamer.errorOf(coarse)).toBeUndefined();
  });

  it('gives way at once when the budget becomes smaller', async () => {
    const made = make(madeTree(2), 1000);
    await settle(made, near);
    const before = made.source.onCard;
    made.streamer.settings = { ...made.streamer.settings, cardBytes: before - 50 };
    made.streamer.update(near);
    expect(made.source.onCard).toBeLessThanOrEqual(before - 50);
    expect(made.streamer.residentOf(0)).toBeDefined();
  });

  it('goes on without a tile that cannot be had, with what lies below it', async () => {
    const tree = madeTree(4);
    const made = make(tree, 1e6);
    const child = tree.tiles[0].children.find((one) => near.sees(tree.tiles[one]))!;
    made.source.broken.add(child);
    const cut = await settle(made, near);
    expect(made.streamer.errorOf(child)?.message).toContain('was not found');
    const below = tree.tiles[child].children.filter((one) => near.sees(tree.tiles[one]));
    expect(below.length).toBeGreaterThan(0);
    for (const one of below) expect(cut.find(({ tile }) => tile === one)).toEqual({ tile: one, content: one, visible: true });
  });

  it('keeps what is most urgent when the budget becomes smaller, and fetches none of it again', async () => {
    const tree = madeTree(8);
    const made = make(tree, 1e6);
    await settle(made, near, 200);
    const { settings } = made.streamer;
    const large = made.streamer.statistics.cardBytes;
    for (let round = 0; round < 3; ++round) {
      made.source.fetches.length = 0;
      made.streamer.settings = { ...settings, cardBytes: large - 300 };
      await settle(made, near, 60);
      expect(made.source.onCard).toBeLessThanOrEqual(large - 300);
      expect(made.source.fetches).toEqual([]);
      made.streamer.settings = { ...settings, cardBytes: large };
      await settle(made, near, 60);
      expect(made.source.fetches.length).toBe(3);
    }
  });

  it('keeps to its budget whatever files promise, and comes to rest', async () => {
    const random = randomNumbers(23);
    for (let round = 0; round < 30; ++round) {
      const made = make(madeTree(8), 300 + 2000 * random());
      const wrong = new Map<number, number>();
      made.source.promisedBytes = (tile) => {
        if (!wrong.has(tile)) wrong.set(tile, random() < 0.3 ? 0 : 1000 * random() ** 3);
        return wrong.get(tile)!;
      };
      await settle(made, madeView([(random() - 0.5) * 12, (random() - 0.5) * 12, 1], random() * 7, -0.5), 150);
      expect(made.source.mostOnCard).toBeLessThanOrEqual(made.streamer.settings.cardBytes);
      expect(made.streamer.idle).toBe(true);
      const times = new Map<number, number>();
      for (const tile of made.source.fetches) times.set(tile, (times.get(tile) ?? 0) + 1);
      expect(Math.max(...times.values())).toBeLessThanOrEqual(4); // sizes are learned
    }
  });
});
