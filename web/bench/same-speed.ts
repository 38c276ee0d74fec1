// Two builds of the viewer draw the same views in turn: bench/same_speed.sh.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain } from '../src/plain';
import { launch, serve, type Server } from '../test/machine';
import { capturedViews } from '../test/pictures';
import { needed, verdict } from './verdict';

declare const plain: Plain;

// SCENES: folders of scenes, one after another; VIEWS: of the capture. BEFORE_VIEWER, AFTER_VIEWER: what tools/build-web.sh made
// of each commit.
const scenes = needed('SCENES').split(' ');
const views = needed('VIEWS');
const viewers = [needed('BEFORE_VIEWER'), needed('AFTER_VIEWER')];
const kViews = 5;
const kRounds = 4;

describe('the viewer after a change of structure', () => {
  let browser: Browser;

  beforeAll(async () => {
    browser = await launch();
  });
  afterAll(() => browser.close());

  async function open(server: Server): Promise<Page> {
    const page = await browser.newPage();
    await page.goto(`${server.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);
    await page.evaluate(() => plain.open('scene/tileset.json', { selection: { mostPixels: 0 } }));
    return page;
  }

  it.each(scenes)('draws as many frames a second as before: %s', async (scene) => {
    const servers = await Promise.all(viewers.map((viewer) => serve(scene, viewer)));
    const pages = await Promise.all(servers.map(open));
    const sums = [0, 0]; // of each view's fastest frame, in seconds
    const ratios: number[] = [];
    for (const { view } of capturedViews(views, kViews)) {
      for (const page of pages) await page.evaluate((one) => plain.settle(one), view);
      const best = [Infinity, Infinity];
      for (let round = 0; round < kRounds; ++round) {
        for (const which of round % 2 === 0 ? [0, 1] : [1, 0]) { // whoever comes first may find the machine colder
          await pages[which].bringToFront();
          best[which] = Math.min(best[which], await pages[which].evaluate((one) => plain.time(one, 3), view));
        }
      }
      ratios.push(best[0] / best[1]);
      best.forEach((seconds, which) => (sums[which] += seconds));
    }
    for (const page of pages) await page.close();
    for (const server of servers) server.close();
    expect(ratios).toHaveLength(kViews);
    const rates = sums.map((sum) => (kViews / sum).toFixed(2));
    console.log(`${scene}: ${rates[0]} before, ${rates[1]} after, a second; of each view ${ratios.map((ratio) => ratio.toFixed(3)).join(' ')}`);
    verdict('frames in the browser, after / before', sums[0] / sums[1], '>=', 0.97);
  });
});
