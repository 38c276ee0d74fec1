import { expect, it } from 'vitest';
import { listedScenes } from './scene-list';

it('scenes are listed if there are several or the only one is hidden', () => {
  const [shown, hidden] = [{ visible: true }, { visible: false }];
  for (const scenes of [[hidden], [shown, shown], [shown, hidden]]) expect(listedScenes(scenes)).toEqual(scenes);
  expect(listedScenes([shown])).toEqual([]);
});
