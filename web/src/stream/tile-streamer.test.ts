import { describe, expect, it } from 'vitest';
import { SceneError } from '../scene-error';
import { addBackgroundBlocks, testTree, testView, randomNumbers } from '../testing/test-tree';
import { TileSelector } from './tile-selector';
import type { TileTree } from './tile-tree';
import { kStreamSettings, TileStreamer, type StreamSettings, type TileSource, type UploadStep } from './tile-streamer';

// Simulates the network and the GPU with counters; the clock only advances when a test advances it.
class FakeSource implements TileSource<number, number, { tile: number; slices: number }> {
  onGpu = 0;
  maxOnGpu = 0;
  fetches: number[] = [];
  aborted = 0;
  broken = new Set<number>(); // tiles that cannot be fetched
  tooLarge = new Set<number>(); // tiles that no GPU can take
  latency = () => 1; // turns of the event loop
  constructor(private readonly bytes: (tile: number) => number) {}

  declaredBytes(tile: number) {
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
    if (this.tooLarge.has(tile)) throw new SceneError(`tiles/${tile}.glb`, '', 'is too large', 'bake smaller blocks', true);
    return { file: tile, fileBytes: this.bytes(tile) / 4, gpuBytes: this.bytes(tile) };
  }
  async decode(_tile: number, file: number) {
    await Promise.resolve();
    return file;
  }
  allocate(tile: number, decoded: number) {
    expect(decoded).toBe(tile);
    this.onGpu += this.bytes(tile);
    this.maxOnGpu = Math.max(this.maxOnGpu, this.onGpu);
    return { tile, slices: 2 };
  }
  upload(resident: { tile: number; slices: number }): UploadStep {
    return --resident.slices === 0 ? 'done' : 'more';
  }
  free({ tile }: { tile: number }) {
    this.onGpu -= this.bytes(tile);
  }
}

function make(tree: TileTree, gpuBytes: number, settings: Partial<StreamSettings> = {}) {
  const source = new FakeSource((tile) => (tile === tree.backgroundBlock ? 50 : 100));
  const clock = { now: 0 };
  const streamer = new TileStreamer(
    new TileSelector(tree), source, { ...kStreamSettings, gpuBytes, ...settings }, () => clock.now);
  return { source, clock, streamer };
}

async function turns(count: number): Promise<void> {
  for (let i = 0; i < count; ++i) await Promise.resolve();
}

async function settle({ clock, streamer }: Pick<ReturnType<typeof make>, 'clock' | 'streamer'>, view: ReturnType<typeof testView>, frames = 60) {
  let { tiles: cut } = streamer.update(view);
  for (let i = 0; i < frames; ++i) {
    clock.now += 20;
    await turns(12);
    ({ tiles: cut } = streamer.update(view));
  }
  return cut;
}

const near = testView([0, 0, 1], 0.3, -0.3);
const far = testView([0, 0, 400], 0, -1.5);

describe('a tile streamer', () => {
  it('draws the coarsest first, and then the finer ones', async () => {
    const setup = make(testTree(2), 1000);
    expect(setup.streamer.update(near)).toEqual({ tiles: [{ tile: 0, content: 0, visible: false }], backgroundBlock: -1 });
    const cut = await settle(setup, near);
    expect(setup.streamer.complete).toBe(true);
    expect(setup.streamer.idle).toBe(true);
    expect(cut.filter(({ visible }) => visible).every(({ tile }) => tile > 0)).toBe(true);
    expect(setup.streamer.statistics.gpuBytes).toBe(setup.source.onGpu);
    expect(setup.streamer.statistics.pageBytes).toBe(0);
  });

  it('never exceeds its budget, never evicts the coarsest, and frees everything', async () => {
    const tree = testTree(8);
    const { coarse } = addBackgroundBlocks(tree);
    const random = randomNumbers(11);
    const setup = make(tree, 900, { patience: 0 });
    setup.source.latency = () => 1 + Math.floor(random() * 30);
    await settle(setup, far, 40);
    let view = far;
    for (let round = 0; round < 2000; ++round) {
      if (round % 40 === 0) {
        view = testView([(random() - 0.5) * 16, (random() - 0.5) * 16, random() * 4], random() * 7, -random());
      }
      setup.clock.now += 16;
      const { tiles: cut } = setup.streamer.update(view);
      expect(setup.streamer.findResident(0)).toBeDefined();
      expect(setup.streamer.findResident(coarse)).toBeDefined();
      for (const { content, visible } of cut) expect(!visible || setup.streamer.findResident(content) !== undefined).toBe(true);
      expect(setup.source.onGpu).toBeLessThanOrEqual(setup.streamer.statistics.gpuBytes);
      expect(setup.streamer.statistics.gpuBytes).toBeLessThanOrEqual(900);
      await turns(Math.floor(random() * 8));
    }
    expect(setup.streamer.statistics.evictions).toBeGreaterThan(10);
    expect(setup.source.maxOnGpu).toBeGreaterThan(600);
    setup.streamer.dispose();
    await turns(100);
    expect(setup.source.onGpu).toBe(0);
    expect(setup.streamer.statistics.gpuBytes).toBe(0);
    expect(setup.streamer.statistics.pageBytes).toBe(0);
  });

  it('does not fetch tiles that are visible only briefly, and cancels fetches of tiles that are no longer visible', async () => {
    const setup = make(testTree(8), 1e6);
    await settle(setup, far);
    const before = setup.source.fetches.length;
    setup.streamer.update(near);
    setup.clock.now += 20;
    await settle(setup, far, 2);
    expect(setup.source.fetches.length).toBe(before);
    setup.source.latency = () => 1e6;
    await settle(setup, near, 20);
    expect(setup.source.fetches.length).toBeGreaterThan(before);
    await settle(setup, far, 20);
    expect(setup.source.aborted).toBeGreaterThan(0);
    expect(setup.streamer.idle).toBe(true);
  });

  it('does not repeatedly fetch tiles that do not fit', async () => {
    const setup = make(testTree(2), 250);
    await settle(setup, near, 20);
    const before = setup.source.fetches.length;
    await settle(setup, near, 100);
    expect(setup.source.fetches.length).toBe(before);
    expect(setup.streamer.statistics.refused).toBeGreaterThan(0);
    expect(setup.streamer.idle).toBe(true);
  });

  it('finishes with a page budget of a single file', async () => {
    const setup = make(testTree(8), 1e6, { pageBytes: 20, fetches: 1 });
    const cut = await settle(setup, near, 400);
    expect(setup.streamer.idle).toBe(true);
    const generous = make(testTree(8), 1e6);
    expect(cut).toEqual(await settle(generous, near, 400));
  });

  it('reports that the coarsest level alone exceeds the budget', async () => {
    const setup = make(testTree(2), 60);
    const errors: SceneError[] = [];
    setup.streamer.onError = (error) => errors.push(error);
    await settle(setup, far);
    expect(errors).toHaveLength(1);
    expect(errors[0].message).toContain('coarsest level');
    expect(setup.source.onGpu).toBe(0);
  });

  it('retries with increasing delays, and reports a failure once', async () => {
    const setup = make(testTree(2), 1000, { firstRetry: 1000, lastRetry: 4000 });
    const errors: SceneError[] = [];
    setup.streamer.onError = (error) => errors.push(error);
    setup.source.broken.add(0);
    const attempts = () => setup.source.fetches.filter((tile) => tile === 0).length;
    await settle(setup, far, 5);
    expect(attempts()).toBe(1);
    for (const [wait, expected] of [[1000, 2], [1900, 2], [200, 3], [4000, 4], [3000, 4], [1100, 5]]) {
      setup.clock.now += wait;
      setup.streamer.update(far);
      await turns(10);
      expect(attempts()).toBe(expected);
    }
    expect(errors).toHaveLength(1);
    setup.source.broken.clear();
    setup.clock.now += 5000;
    await settle(setup, far, 10);
    expect(setup.streamer.complete).toBe(true);
  });

  it('draws the rest if one of the coarsest tiles fails, and that tile once it loads', async () => {
    const tree = testTree(2);
    const { coarse, fine } = addBackgroundBlocks(tree);
    const setup = make(tree, 1e6);
    setup.source.broken.add(coarse).add(fine);
    const cut = await settle(setup, near);
    expect(cut.filter(({ visible }) => visible).every(({ tile }) => tile > 0)).toBe(true);
    expect(setup.streamer.findResident(0)).toBeDefined();
    expect(setup.streamer.complete).toBe(true);
    expect(setup.streamer.idle).toBe(true);
    setup.source.broken.clear();
    setup.clock.now += 60000;
    expect(setup.streamer.idle).toBe(false);
    await settle(setup, near);
    expect(setup.streamer.findResident(coarse)).toBeDefined();
    expect(setup.streamer.tileError(coarse)).toBeUndefined();
  });

  it('draws finer tiles in place of the coarsest one if that fails, however far it is', async () => {
    const tree = testTree(4);
    const setup = make(tree, 1e6);
    setup.source.broken.add(0);
    const cut = await settle(setup, far);
    const below = tree.tiles[0].children.filter((one) => far.sees(tree.tiles[one]));
    expect(below.length).toBeGreaterThan(0);
    for (const one of below) expect(cut.find(({ tile }) => tile === one)).toEqual({ tile: one, content: one, visible: true });
    expect(setup.streamer.idle).toBe(true);
    setup.source.broken.clear();
    setup.clock.now += 60000;
    expect(await settle(setup, far)).toEqual([{ tile: 0, content: 0, visible: true }]);
  });

  it('does not fetch again what the GPU cannot take', async () => {
    const setup = make(testTree(2), 1000);
    setup.source.tooLarge.add(0);
    await settle(setup, far, 5);
    setup.clock.now += 1e7;
    await settle(setup, far, 5);
    expect(setup.source.fetches.filter((tile) => tile === 0)).toEqual([0]);
    expect(setup.streamer.idle).toBe(true);
  });

  it('evicts at once when the budget becomes smaller', async () => {
    const setup = make(testTree(2), 1000);
    await settle(setup, near);
    const before = setup.source.onGpu;
    setup.streamer.settings = { ...setup.streamer.settings, gpuBytes: before - 50 };
    setup.streamer.update(near);
    expect(setup.source.onGpu).toBeLessThanOrEqual(before - 50);
    expect(setup.streamer.findResident(0)).toBeDefined();
  });

  it('draws the children of a tile that cannot be loaded', async () => {
    const tree = testTree(4);
    const setup = make(tree, 1e6);
    const child = tree.tiles[0].children.find((one) => near.sees(tree.tiles[one]))!;
    setup.source.broken.add(child);
    const cut = await settle(setup, near);
    expect(setup.streamer.tileError(child)?.message).toContain('was not found');
    const below = tree.tiles[child].children.filter((one) => near.sees(tree.tiles[one]));
    expect(below.length).toBeGreaterThan(0);
    for (const one of below) expect(cut.find(({ tile }) => tile === one)).toEqual({ tile: one, content: one, visible: true });
  });

  it('keeps the most urgent tiles when the budget becomes smaller, without fetching them again', async () => {
    const tree = testTree(8);
    const setup = make(tree, 1e6);
    await settle(setup, near, 200);
    const { settings } = setup.streamer;
    const large = setup.streamer.statistics.gpuBytes;
    for (let round = 0; round < 3; ++round) {
      setup.source.fetches.length = 0;
      setup.streamer.settings = { ...settings, gpuBytes: large - 300 };
      await settle(setup, near, 60);
      expect(setup.source.onGpu).toBeLessThanOrEqual(large - 300);
      expect(setup.source.fetches).toEqual([]);
      setup.streamer.settings = { ...settings, gpuBytes: large };
      await settle(setup, near, 60);
      expect(setup.source.fetches.length).toBe(3);
    }
  });

  it('stays within its budget whatever sizes files declare, and comes to rest', async () => {
    const random = randomNumbers(23);
    for (let round = 0; round < 30; ++round) {
      const setup = make(testTree(8), 300 + 2000 * random());
      const wrong = new Map<number, number>();
      setup.source.declaredBytes = (tile) => {
        if (!wrong.has(tile)) wrong.set(tile, random() < 0.3 ? 0 : 1000 * random() ** 3);
        return wrong.get(tile)!;
      };
      await settle(setup, testView([(random() - 0.5) * 12, (random() - 0.5) * 12, 1], random() * 7, -0.5), 150);
      expect(setup.source.maxOnGpu).toBeLessThanOrEqual(setup.streamer.settings.gpuBytes);
      expect(setup.streamer.idle).toBe(true);
      const times = new Map<number, number>();
      for (const tile of setup.source.fetches) times.set(tile, (times.get(tile) ?? 0) + 1);
      expect(Math.max(...times.values())).toBeLessThanOrEqual(4); // estimates of sizes improve with each load
    }
  });
});
