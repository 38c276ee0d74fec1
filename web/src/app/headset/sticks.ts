// What the thumbsticks of a headset's controllers say (xr-standard: those after a touchpad's two axes, where there are four).
import { beyondDeadZone } from '../moving/gamepad';

export interface Stick {
  right: number; // -1 to 1
  up: number;
}

interface InputSource {
  handedness: string;
  gamepad?: { axes: readonly number[] } | null;
}

export function stickOf(sources: Iterable<InputSource>, hand: 'left' | 'right'): Stick {
  for (const { handedness, gamepad } of sources) {
    if (handedness !== hand || !gamepad || gamepad.axes.length < 2) continue;
    const [right, down] = gamepad.axes.length < 4 ? gamepad.axes : gamepad.axes.slice(2);
    return { right, up: -down };
  }
  return { right: 0, up: 0 };
}

// How much of full speed: left stick to the right and forward; right stick, upwards.
export function glideOf({ right, up }: Stick): { right: number; forward: number } {
  return { right: beyondDeadZone(right), forward: beyondDeadZone(up) };
}

// What is pushed aside turns and does not rise.
export function riseOf({ right, up }: Stick): number {
  return Math.abs(up) > Math.abs(right) ? beyondDeadZone(up) : 0;
}

const kTurn = Math.PI / 6;
const kPushed = 0.7;
const kReleased = 0.4;

// In steps, one for each time that the stick is pushed aside: a view that turns smoothly makes people sick.
export class StepTurn {
  private isPushed = false;

  // Radians, to the left.
  turnOf({ right, up }: Stick): number {
    const wasPushed = this.isPushed;
    this.isPushed = Math.abs(right) > (wasPushed ? kReleased : kPushed);
    const isAside = Math.abs(right) > Math.abs(up);
    return this.isPushed && !wasPushed && isAside ? -Math.sign(right) * kTurn : 0;
  }
}
