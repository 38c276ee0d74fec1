// Reads the thumbsticks of a headset's controllers (xr-standard mapping: if there are four axes, those after the two of
// the touchpad).
import { beyondDeadZone } from '../moving/gamepad';

export interface Stick {
  right: number; // -1 to 1
  up: number;
}

interface InputSource {
  handedness: string;
  gamepad?: { axes: readonly number[] } | null;
}

export function readStick(sources: Iterable<InputSource>, hand: 'left' | 'right'): Stick {
  for (const { handedness, gamepad } of sources) {
    if (handedness !== hand || !gamepad || gamepad.axes.length < 2) continue;
    const [right, down] = gamepad.axes.length < 4 ? gamepad.axes : gamepad.axes.slice(2);
    return { right, up: -down };
  }
  return { right: 0, up: 0 };
}

// Shares of full speed: the left stick moves to the right and forward, the right stick moves upwards.
export function computeGlide({ right, up }: Stick): { right: number; forward: number } {
  return { right: beyondDeadZone(right), forward: beyondDeadZone(up) };
}

// A stick that is pushed sideways turns and does not rise.
export function computeRise({ right, up }: Stick): number {
  return Math.abs(up) > Math.abs(right) ? beyondDeadZone(up) : 0;
}

const kTurn = Math.PI / 6;
const kPushed = 0.7;
const kReleased = 0.4;

// Turns in steps, one for each time that the stick is pushed sideways: views that turn smoothly cause motion sickness.
export class StepTurn {
  private isPushed = false;

  // Returns radians to the left.
  updateTurn({ right, up }: Stick): number {
    const wasPushed = this.isPushed;
    this.isPushed = Math.abs(right) > (wasPushed ? kReleased : kPushed);
    const isAside = Math.abs(right) > Math.abs(up);
    return this.isPushed && !wasPushed && isAside ? -Math.sign(right) * kTurn : 0;
  }
}
