import { describe, expect, it } from 'vitest';
import { computeGlide, computeRise, readStick, StepTurn } from './sticks';

describe('the sticks of a headset', () => {
  it('are distinguished by hand, with touchpads as a fallback', () => {
    const sources = [
      { handedness: 'none', gamepad: { axes: [0.9, 0.9] } }, { handedness: 'left', gamepad: null },
      { handedness: 'left', gamepad: { axes: [0.1, 0.2, 0.3, 0.4] } }, { handedness: 'right', gamepad: { axes: [0.5, -0.6] } },
    ];
    expect(readStick(sources, 'left')).toEqual({ right: 0.3, up: -0.4 });
    expect(readStick(sources, 'right')).toEqual({ right: 0.5, up: 0.6 });
    expect(readStick([], 'left')).toEqual({ right: 0, up: 0 });
  });

  it('have a dead zone', () => {
    expect(Object.values(computeGlide({ right: 0.1, up: -0.1 })).map(Math.abs)).toEqual([0, 0]);
    expect(computeRise({ right: 0, up: 0.1 })).toBe(0);
  });

  it('turn by one step each time that they are pushed sideways', () => {
    const turning = new StepTurn();
    const turns = [0, 0.5, 0.8, 1, 0.6, 0.75, 0.2, -0.9, -1].map((right) => turning.updateTurn({ right, up: 0.1 }));
    const step = Math.PI / 6;
    expect(turns.map((x) => x + 0)).toEqual([0, 0, -step, 0, 0, 0, 0, step, 0]);
  });

  it('never turn and rise at the same time', () => {
    const turning = new StepTurn();
    expect(turning.updateTurn({ right: 0.72, up: 0.8 })).toBe(0);
    expect(computeRise({ right: 0.72, up: 0.8 })).toBeGreaterThan(0);
    expect(computeRise({ right: 0.8, up: 0.72 })).toBe(0);
  });
});
