// From files to the card, with a codec whose contents share resources.
import type * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { ContentSource, type ContentPath } from './content-source';
import type { SceneDrawer } from './draw/scene-drawer';
import { SceneError } from './scene-error';
import { TileSelector } from './stream/tile-selector';
import { kStreamSettings, TileStreamer, type StreamSettings } from './stream/tile-streamer';
import { madeTree, madeView, randomNumbers } from './testing/made-tree';
import { decodeResource, type ContentCodec, type Resource } from './tiles/content-codec';

const kContentBytes = 100;
const kResourceBytes = 1000;

interface FakeContent {
  name: string;
  read: readonly Resource[]; // with which it was decoded
}

interface FakeDrawn extends FakeContent {
  resources: readonly Resource[];
}

type FakeCodec = ContentCodec<{ memoryBytes: number }, FakeContent>;

const kCodec: FakeCodec = {
  readHeader: () => ({ memoryBytes: kContentBytes }),
  decode: (_, name, read) => ({ name, read }),
  buffersOf: () => [],
  decodeResource: (file, { uri }) => {
    expect(new TextDecoder().decode(file)).toBe(uri);
    return { memoryBytes: kResourceBytes };
  },
};

const near = madeView([0, 0, 1], 0.3, -0.3);
const far = madeView([0, 0, 400], 0, -1.5);

// `resourcesOf`: of each tile of a city of edge × edge blocks.
function make(edge: number, resourcesOf: (tile: number) => number[], settings: Partial<StreamSettings>, codec = kCodec) {
  const tree = madeTree(edge);
  tree.tiles.forEach(({ content }, tile) => (content!.resources = resourcesOf(tile)));
  const resources = Array.from({ length: 4 }, (_, id) => ({ uri: `resources/${id}.bin`, mimeType: 'a/b', bytes: 50 }));
  const drawn = new Set<FakeDrawn>();
  const reads = new Map<string, number>();
  const broken = new Set<string>();
  const card = {
    get bytes(): number {
      const shared = new Set([...drawn].flatMap((one) => [...one.resources]));
      return kContentBytes * drawn.size + kResourceBytes * shared.size;
    },
    most: 0,
  };
  const drawer: Partial<SceneDrawer<{ memoryBytes: number }, FakeContent, FakeDrawn>> = {
    residentBytes: ({ memoryBytes }) => memoryBytes,
    prepare: () => {},
    allocate: (content, _, shared) => {
      expect(content.read).toEqual(shared);
      const made = { ...content, resources: shared };
      drawn.add(made);
      card.most = Math.max(card.most, card.bytes);
      return made;
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
      decode: async ({ file, name, promised, limits, resources: shared }: any) =>
        codec.decode(codec.readHeader(file, name, promised, limits), name, shared),
      decodeResource: async ({ file, from, limits }: any) => decodeResource(codec as ContentCodec, file, from, limits),
    },
    drawer,
  } as unknown as ContentPath;
  const renderer = { getContext: () => ({ getParameter: () => 256 }) } as unknown as THREE.WebGLRenderer;
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
  return { tree, streamer, clock, drawn, reads, broken, card, errors, settle };
}

describe('what tiles share', () => {
  it('is fetched once, and counts once', async () => {
    const made = make(2, (tile) => (tile === 0 ? [] : [2]), { cardBytes: 1e6 });
    const { streamer, drawn, reads } = made;
    const cut = await made.settle(near);
    const visible = cut.filter((one) => one.visible);
    expect(visible.length).toBeGreaterThan(1);
    expect(visible.every(({ tile, content }) => tile > 0 && tile === content)).toBe(true);
    expect([...reads].filter(([uri]) => uri.startsWith('resources'))).toEqual([['resources/2.bin', 1]]);
    expect(new Set([...drawn].flatMap(({ resources }) => [...resources])).size).toBe(1);
    expect(streamer.statistics.cardBytes).toBe(made.card.bytes);
    expect(streamer.statistics.cardBytes).toBe(kContentBytes * drawn.size + kResourceBytes);
    expect(streamer.statistics.pageBytes).toBe(kResourceBytes); // for tiles that are still to come
    expect(streamer.idle).toBe(true);
  });

  it('goes with the last tile that needs it, and comes back with the first', async () => {
    const made = make(2, (tile) => (tile === 0 ? [] : [2]), { cardBytes: 1e6 });
    const { streamer, reads, drawn } = made;
    await made.settle(near);
    const settings = { ...streamer.settings };
    streamer.settings = { ...settings, cardBytes: streamer.statistics.cardBytes - 1 };
    await made.settle(near);
    expect(streamer.statistics.cardBytes).toBe(kContentBytes * drawn.size + kResourceBytes);
    expect(drawn.size).toBeGreaterThan(1);
    streamer.settings = { ...settings, cardBytes: kResourceBytes };
    await made.settle(near);
    expect([...drawn].map(({ name }) => name)).toEqual(['tiles/0.glb']);
    expect([streamer.statistics.cardBytes, streamer.statistics.pageBytes]).toEqual([kContentBytes, 0]);
    expect(reads.get('resources/2.bin')).toBe(1);
    streamer.settings = settings;
    await made.settle(near);
    expect(drawn.size).toBeGreaterThan(1);
    expect(reads.get('resources/2.bin')).toBe(2);
  });

  it('keeps away the tiles that need it where it cannot be had, and is tried again', async () => {
    const made = make(2, (tile) => (tile === 0 ? [] : [1]), { cardBytes: 1e6, firstRetry: 10000 });
    const { streamer, broken, clock } = made;
    broken.add('resources/1.bin');
    const cut = await made.settle(near);
    expect(cut.filter(({ visible }) => visible).every(({ content }) => content === 0)).toBe(true);
    expect(made.errors).toHaveLength(1);
    expect(made.errors[0]).toContain('resources/1.bin');
    expect(streamer.errorOf(made.tree.tiles[0].children[0])?.message).toContain('was not found');
    expect([streamer.idle, streamer.statistics.pageBytes]).toEqual([true, 0]);
    broken.clear();
    clock.now += 10000;
    expect(streamer.idle).toBe(false);
    await made.settle(near);
    expect(made.drawn.size).toBeGreaterThan(1);
    expect(streamer.errorOf(made.tree.tiles[0].children[0])).toBeUndefined();
  });

  it('is refused where contents of the representation share nothing', async () => {
    const made = make(2, (tile) => (tile === 0 ? [] : [1]), { cardBytes: 1e6 }, { ...kCodec, decodeResource: undefined });
    const cut = await made.settle(near);
    expect(cut.filter(({ visible }) => visible).every(({ content }) => content === 0)).toBe(true);
    expect(made.errors).toEqual([expect.stringMatching(/resources.1\.bin.*contents of this representation do not have/)]);
    expect([...made.drawn].map(({ name }) => name)).toEqual(['tiles/0.glb']);
  });

  it('is part of what the coarsest level takes', async () => {
    const made = make(1, () => [0], { cardBytes: kResourceBytes });
    await made.settle(far);
    expect(made.errors).toHaveLength(1);
    expect(made.errors[0]).toContain('coarsest level');
    expect(made.drawn.size).toBe(0);
  });

  it('never passes the budget, whatever tiles share, and everything is given back', async () => {
    const random = randomNumbers(3);
    const made = make(8, (tile) => (tile === 0 ? [0] : [tile % 4, (tile + 1 + (tile % 3)) % 4].sort()), { cardBytes: 3700, patience: 0 });
    const { streamer, card } = made;
    for (let round = 0; round < 60; ++round) {
      const view = madeView([(random() - 0.5) * 16, (random() - 0.5) * 16, random() * 4], random() * 7, -random());
      for (let frame = 0; frame < 20; ++frame) {
        await made.settle(view, 1);
        expect(card.bytes).toBeLessThanOrEqual(streamer.statistics.cardBytes);
        expect(streamer.statistics.cardBytes).toBeLessThanOrEqual(3700);
      }
      await made.settle(view, 40);
      expect(streamer.idle).toBe(true);
      expect(streamer.statistics.cardBytes).toBe(card.bytes);
    }
    expect(streamer.statistics.evictions).toBeGreaterThan(10);
    expect(card.most).toBeGreaterThan(3000);
    await made.settle(far, 1); // what is on its way then lets go of itself
    await made.settle(near, 2);
    streamer.dispose();
    for (let turns = 0; turns < 100; ++turns) await Promise.resolve();
    expect([card.bytes, streamer.statistics.cardBytes, streamer.statistics.pageBytes]).toEqual([0, 0, 0]);
  });
});
