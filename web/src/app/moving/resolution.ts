// Chooses the render resolution of the scene: while the camera moves, as much as the machine can render in time; at
// rest, the full resolution; and while only models move, as much as still allows a smooth animation in a scene at rest.

const kSteps = [0.25, 0.375, 0.5, 0.75, 1]; // few, as the render targets are reallocated for each

export type Motion = 'move' | 'play' | 'rest';

export interface ResolutionTarget {
  target: number; // largest acceptable frame time in ms
  // Number of timely frames after which a higher resolution is tried although its cost is unknown, as frame times never
  // fall below the refresh interval of the screen. It doubles with each failed trial.
  patience: number;
  share: number; // initial resolution along an edge, relative to full resolution
}

const kPatience = 120; // frames
const kLongestWait = 16; // as a multiple of the patience
const kUnmeasured = 3; // frames that are not measured after a trial began, as the render targets are reallocated

export class Resolution {
  // Resolution that the user has chosen, at rest and in motion.
  fixed?: number;
  private moving: Measured;
  private readonly playing: Measured;
  private lastMove = -Infinity;
  private lastPlay = -Infinity;

  // `target` and `playTarget` are the largest frame times in ms while the camera moves and while only models move;
  // `rest` is the time in ms after which the scene counts as being at rest.
  constructor(
    private readonly target = 40,
    playTarget = 100,
    private readonly rest = 300,
  ) {
    this.moving = new Measured(makeResolutionTarget(target));
    this.playing = new Measured(makeResolutionTarget(playTarget));
  }

  // Replaces the target for motion of the camera; undefined restores the default.
  set pace(pace: ResolutionTarget | undefined) {
    this.moving = new Measured(pace ?? makeResolutionTarget(this.target));
  }

  moved(now: number): void {
    this.lastMove = now;
  }

  // Is called when an animated model moves.
  played(now: number): void {
    this.lastPlay = now;
  }

  motion(now: number): Motion {
    if (now - this.lastMove <= this.rest) return 'move';
    return now - this.lastPlay <= this.rest ? 'play' : 'rest';
  }

  // The resolution at rest.
  get whole(): number {
    return this.fixed ?? 1;
  }

  scale(now: number): number {
    const motion = this.motion(now);
    return this.fixed ?? (motion === 'rest' ? 1 : this.of(motion).scale);
  }

  // Reports the frame time of a frame that was drawn during `motion`.
  took(milliseconds: number, motion: Motion): void {
    if (motion !== 'rest') this.of(motion).took(milliseconds);
  }

  private of(motion: 'move' | 'play'): Measured {
    return motion === 'move' ? this.moving : this.playing;
  }
}

function makeResolutionTarget(target: number): ResolutionTarget {
  return { target, patience: kPatience, share: 1 };
}

class Measured {
  private step: number;
  private measured = 0; // ms per frame at the current step's resolution
  private wait: number; // current patience in frames
  private inTime = 0; // timely frames since the last step
  private unmeasured = 0;
  private tried = false; // the current step is a trial

  constructor(private readonly pace: ResolutionTarget) {
    this.step = Math.max(0, kSteps.filter((share) => share <= pace.share).length - 1);
    this.wait = pace.patience;
  }

  get scale(): number {
    return kSteps[this.step];
  }

  took(milliseconds: number): void {
    if (this.unmeasured > 0) {
      --this.unmeasured;
      return;
    }
    const { target, patience } = this.pace;
    this.measured = this.measured === 0 ? milliseconds : 0.6 * this.measured + 0.4 * milliseconds;
    const expected = (step: number) => this.measured * (kSteps[step] / kSteps[this.step]) ** 2;
    if (this.measured > target) {
      this.inTime = 0;
      if (this.step === 0) return;
      this.change(this.step - 1);
      if (this.tried) this.wait = Math.min(2 * this.wait, kLongestWait * patience);
      this.tried = false;
      return;
    }
    if (++this.inTime > this.wait) this.tried = false; // the trial has succeeded
    if (this.step + 1 < kSteps.length) {
      if (expected(this.step + 1) < 0.7 * target) this.change(this.step + 1);
      else if (this.inTime > this.wait) this.tryMore();
    }
  }

  private change(step: number): void {
    this.measured *= (kSteps[step] / kSteps[this.step]) ** 2;
    this.step = step;
    this.inTime = 0;
  }

  private tryMore(): void {
    this.change(this.step + 1);
    this.tried = true;
    this.measured = 0;
    this.unmeasured = kUnmeasured;
  }
}
