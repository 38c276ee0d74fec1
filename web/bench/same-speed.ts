// Two builds of the viewer alternately render the same views: bench/same_speed.sh.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage } from '../src/headless-page';
import { launch, serve, type Server } from '../test/machine';
import { capturedViews } from '../test/pictures';
import { needed, verdict } from './verdict';

declare const headlessPage: HeadlessPage;

// SCENES: folders of scenes, separated by spaces; VIEWS: those of the capture. BEFORE_VIEWER, AFTER_VIEWER: outputs of
// tools/build-web.sh for the two commits.
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
    await page.goto(`${server.url}headless.html`);
    await page.waitForFunction(() => 'headlessPage' in window);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    return page;
  }

  it.each(scenes)('draws as many frames a second as before: %s', async (scene) => {
    const servers = await Promise.all(viewers.map((viewer) => serve(scene, viewer)));
    const pages = await Promise.all(servers.map(open));
    const sums = [0, 0]; // sums of the fastest frame of each view, in seconds
    const ratios: number[] = [];
    for (const { view } of capturedViews(views, kViews)) {
      for (const page of pages) await page.evaluate((one) => headlessPage.settle(one), view);
      const best = [Infinity, Infinity];
      for (let round = 0; round < kRounds; ++round) {
        for (const which of round % 2 === 0 ? [0, 1] : [1, 0]) { // alternates, as the first to run may benefit from a cooler machine
          await pages[which].bringToFront();
          best[which] = Math.min(best[which], await pages[which].evaluate((one) => headlessPage.time(one, 3), view));
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
