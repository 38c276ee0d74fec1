// Tests the way from files to the GPU with a codec whose contents share resources.
import type * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { ContentSource, type ContentPath } from './content-source';
import type { SceneDrawer } from './draw/scene-drawer';
import { SceneError } from './scene-error';
import { TileSelector } from './stream/tile-selector';
import { kStreamSettings, TileStreamer, type StreamSettings } from './stream/tile-streamer';
import { testTree, testView, randomNumbers } from './testing/test-tree';
import { decodeResource, type ContentCodec, type Resource } from './tiles/content-codec';

const kContentBytes = 100;
const kResourceBytes = 1000;

interface FakeContent {
  name: string;
  read: readonly Resource[]; // the resources that it was decoded with
}

interface FakeDrawn extends FakeContent {
  resources: readonly Resource[];
}

type FakeCodec = ContentCodec<{ memoryBytes: number }, FakeContent>;

const kCodec: FakeCodec = {
  readHeader: () => ({ memoryBytes: kContentBytes }),
  decode: (_, name, read) => ({ name, read }),
  listBuffers: () => [],
  decodeResource: (file, { uri }) => {
    expect(new TextDecoder().decode(file)).toBe(uri);
    return { memoryBytes: kResourceBytes };
  },
};

const near = testView([0, 0, 1], 0.3, -0.3);
const far = testView([0, 0, 400], 0, -1.5);

// Sets up a city of edge × edge blocks; `tileResources` returns the resources of each tile.
function make(edge: number, tileResources: (tile: number) => number[], settings: Partial<StreamSettings>, codec = kCodec) {
  const tree = testTree(edge);
  tree.tiles.forEach(({ content }, tile) => (content!.resources = tileResources(tile)));
  const resources = Array.from({ length: 4 }, (_, id) => ({ uri: `resources/${id}.bin`, mimeType: 'a/b', bytes: 50 }));
  const drawn = new Set<FakeDrawn>();
  const reads = new Map<string, number>();
  const broken = new Set<string>();
  const gpu = {
    get bytes(): number {
      const shared = new Set([...drawn].flatMap((one) => [...one.resources]));
      return kContentBytes * drawn.size + kResourceBytes * shared.size;
    },
    maximum: 0,
  };
  const drawer: Partial<SceneDrawer<{ memoryBytes: number }, FakeContent, FakeDrawn>> = {
    residentBytes: ({ memoryBytes }) => memoryBytes,
    prepare: () => {},
    allocate: (content, _, shared) => {
      expect(content.read).toEqual(shared);
      const drawnContent = { ...content, resources: shared };
      drawn.add(drawnContent);
      gpu.maximum = Math.max(gpu.maximum, gpu.bytes);
      return drawnContent;
    },
    upload: () => 'done',
    free: (one) => void drawn.delete(one),
  };
  const path = {
    tileset: { representation: 'fake', resources }, tree,
    files: {
      async read(uri: string) {
        reads.set(uri, (reads.get(uri) ?? 0) + 1);
        await Promise.resolve();
        if (broken.has(uri)) throw new SceneError(uri, '', 'was not found', 'copy the scene again');
        return new TextEncoder().encode(uri);
      },
    },
    pool: {
      decode: async ({ file, name, declared, limits, resources: shared }: any) =>
        codec.decode(codec.readHeader(file, name, declared, limits), name, shared),
      decodeResource: async ({ file, from, limits }: any) => decodeResource(codec as ContentCodec, file, from, limits),
    },
    drawer,
  } as unknown as ContentPath;
  const renderer = { getContext: () => ({ getParameter: () => 256 }), extensions: { has: () => false } } as unknown as THREE.WebGLRenderer;
  const clock = { now: 0 };
  const streamer = new TileStreamer(
    new TileSelector(tree), new ContentSource(path, renderer, codec as ContentCodec), { ...kStreamSettings, ...settings }, () => clock.now);
  const errors: string[] = [];
  streamer.onError = ({ message }) => errors.push(message);
  const settle = async (view: typeof near, frames = 60) => {
    for (let i = 0; i < frames; ++i) {
      streamer.update(view);
      clock.now += 20;
      for (let turns = 0; turns < 20; ++turns) await Promise.resolve();
    }
    return streamer.update(view).tiles;
  };
  return { tree, streamer, clock, drawn, reads, broken, gpu, errors, settle };
}

describe('resources that tiles share', () => {
  it('are fetched once and counted once', async () => {
    const setup = make(2, (tile) => (tile === 0 ? [] : [2]), { gpuBytes: 1e6 });
    const { streamer, drawn, reads } = setup;
    const cut = await setup.settle(near);
    const visible = cut.filter((one) => one.visible);
    expect(visible.length).toBeGreaterThan(1);
    expect(visible.every(({ tile, content }) => tile > 0 && tile === content)).toBe(true);
    expect([...reads].filter(([uri]) => uri.startsWith('resources'))).toEqual([['resources/2.bin', 1]]);
    expect(new Set([...drawn].flatMap(({ resources }) => [...resources])).size).toBe(1);
    expect(streamer.statistics.gpuBytes).toBe(setup.gpu.bytes);
    expect(streamer.statistics.gpuBytes).toBe(kContentBytes * drawn.size + kResourceBytes);
    expect(streamer.statistics.pageBytes).toBe(kResourceBytes); // held for tiles that are still to be loaded
    expect(streamer.idle).toBe(true);
  });

  it('are released with the last tile that needs them, and fetched again with the first', async () => {
    const setup = make(2, (tile) => (tile === 0 ? [] : [2]), { gpuBytes: 1e6 });
    const { streamer, reads, drawn } = setup;
    await setup.settle(near);
    const settings = { ...streamer.settings };
    streamer.settings = { ...settings, gpuBytes: streamer.statistics.gpuBytes - 1 };
    await setup.settle(near);
    expect(streamer.statistics.gpuBytes).toBe(kContentBytes * drawn.size + kResourceBytes);
    expect(drawn.size).toBeGreaterThan(1);
    streamer.settings = { ...settings, gpuBytes: kResourceBytes };
    await setup.settle(near);
    expect([...drawn].map(({ name }) => name)).toEqual(['tiles/0.glb']);
    expect([streamer.statistics.gpuBytes, streamer.statistics.pageBytes]).toEqual([kContentBytes, 0]);
    expect(reads.get('resources/2.bin')).toBe(1);
    streamer.settings = settings;
    await setup.settle(near);
    expect(drawn.size).toBeGreaterThan(1);
    expect(reads.get('resources/2.bin')).toBe(2);
  });

  it('prevent tiles that need them from loading while they fail, and are retried', async () => {
    const setup = make(2, (tile) => (tile === 0 ? [] : [1]), { gpuBytes: 1e6, firstRetry: 10000 });
    const { streamer, broken, clock } = setup;
    broken.add('resources/1.bin');
    const cut = await setup.settle(near);
    expect(cut.filter(({ visible }) => visible).every(({ content }) => content === 0)).toBe(true);
    expect(setup.errors).toHaveLength(1);
    expect(setup.errors[0]).toContain('resources/1.bin');
    expect(streamer.tileError(setup.tree.tiles[0].children[0])?.message).toContain('was not found');
    expect([streamer.idle, streamer.statistics.pageBytes]).toEqual([true, 0]);
    broken.clear();
    clock.now += 10000;
    expect(streamer.idle).toBe(false);
    await setup.settle(near);
    expect(setup.drawn.size).toBeGreaterThan(1);
    expect(streamer.tileError(setup.tree.tiles[0].children[0])).toBeUndefined();
  });

  it('are rejected if contents of the representation share nothing', async () => {
    const setup = make(2, (tile) => (tile === 0 ? [] : [1]), { gpuBytes: 1e6 }, { ...kCodec, decodeResource: undefined });
    const cut = await setup.settle(near);
    expect(cut.filter(({ visible }) => visible).every(({ content }) => content === 0)).toBe(true);
    expect(setup.errors).toEqual([expect.stringMatching(/resources.1\.bin.*contents of this representation do not have/)]);
    expect([...setup.drawn].map(({ name }) => name)).toEqual(['tiles/0.glb']);
  });

  it('count for the size of the coarsest level', async () => {
    const setup = make(1, () => [0], { gpuBytes: kResourceBytes });
    await setup.settle(far);
    expect(setup.errors).toHaveLength(1);
    expect(setup.errors[0]).toContain('coarsest level');
    expect(setup.drawn.size).toBe(0);
  });

  it('never exceed the budget, and are all freed', async () => {
    const random = randomNumbers(3);
    const setup = make(8, (tile) => (tile === 0 ? [0] : [tile % 4, (tile + 1 + (tile % 3)) % 4].sort()), { gpuBytes: 3700, patience: 0 });
    const { streamer, gpu } = setup;
    for (let round = 0; round < 60; ++round) {
      const view = testView([(random() - 0.5) * 16, (random() - 0.5) * 16, random() * 4], random() * 7, -random());
      for (let frame = 0; frame < 20; ++frame) {
        await setup.settle(view, 1);
        expect(gpu.bytes).toBeLessThanOrEqual(streamer.statistics.gpuBytes);
        expect(streamer.statistics.gpuBytes).toBeLessThanOrEqual(3700);
      }
      await setup.settle(view, 40);
      expect(streamer.idle).toBe(true);
      expect(streamer.statistics.gpuBytes).toBe(gpu.bytes);
    }
    expect(streamer.statistics.evictions).toBeGreaterThan(10);
    expect(gpu.maximum).toBeGreaterThan(3000);
    await setup.settle(far, 1); // whatever is in progress is dropped when it completes
    await setup.settle(near, 2);
    streamer.dispose();
    for (let turns = 0; turns < 100; ++turns) await Promise.resolve();
    expect([gpu.bytes, streamer.statistics.gpuBytes, streamer.statistics.pageBytes]).toEqual([0, 0, 0]);
  });
});

describe('textures in blocks', () => {
  // Returns whether contents of four tiles with these sizes of files are read for textures in blocks.
  async function takesBlocks(gpu: string, bytes: number, gpuBytes: number, hasBlocks = true): Promise<boolean> {
    const tree = testTree(1);
    tree.tiles.forEach(({ content }) => (content!.bytes = bytes));
    const read: boolean[] = [];
    const codec = {
      ...kCodec,
      readHeader: (_: unknown, name: string, declared: unknown, limits: { blockTextures: boolean }) => {
        expect([name, declared]).toBeDefined();
        read.push(limits.blockTextures);
        return { memoryBytes: kContentBytes };
      },
    } as unknown as ContentCodec;
    const path = {
      tileset: { representation: 'fake', resources: [] }, tree, gpuBytes: gpuBytes * tree.tiles.length,
      files: { read: async () => new Uint8Array() }, drawer: { prepare: () => {}, residentBytes: () => kContentBytes },
    } as unknown as ContentPath;
    const context = { getExtension: () => ({ UNMASKED_RENDERER_WEBGL: 1 }), getParameter: (name?: number) => (name === 1 ? gpu : 256) };
    const renderer = { getContext: () => context, extensions: { has: () => hasBlocks } } as unknown as THREE.WebGLRenderer;
    await new ContentSource(path, renderer, codec).fetch(0, new AbortController().signal);
    return read[0];
  }
  const onCpu = 'ANGLE (Mesa/X.org, llvmpipe (LLVM 15.0.6 256 bits), OpenGL 4.5)';

  it('are for GPUs that sample them', async () => {
    expect(await takesBlocks('ANGLE (NVIDIA GeForce RTX 4090)', 10, 1000)).toBe(true);
    expect(await takesBlocks('ANGLE (NVIDIA GeForce RTX 4090)', 10, 1000, false)).toBe(false);
  });

  it('are for drivers for the CPU if bytes would not fit into the budget', async () => {
    expect(await takesBlocks(onCpu, 10, 20)).toBe(false);
    expect(await takesBlocks('ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero)), SwiftShader driver)', 10, 20)).toBe(false);
    expect(await takesBlocks(onCpu, 10, 19.9)).toBe(true);
    expect(await takesBlocks(onCpu, 0, 1000)).toBe(true); // the sizes are not known
  });
});
