// How many pixels of the scene to draw: as many as the machine can while the camera moves; all of them when it rests, and
// while only models move as many as still make a picture of a scene at rest with something moving in it.

const kSteps = [0.25, 0.375, 0.5, 0.75, 1]; // few, as targets are made anew for each

export type Motion = 'move' | 'play' | 'rest';

export interface Pace {
  target: number; // ms that a picture may take
  // Pictures in time after which more pixels are tried, though nobody knows what they take: where none comes sooner than a
  // screen shows it. Longer each time that they took too long.
  patience: number;
  share: number; // of the pixels along an edge, to begin with
}

const kPatience = 120; // pictures
const kLongestWait = 16; // times the patience
const kUnmeasured = 3; // pictures after more pixels are tried: of targets that are made anew

export class Resolution {
  // A share that somebody has chosen, whether the camera moves or not.
  fixed?: number;
  private moving: Measured;
  private readonly playing: Measured;
  private lastMove = -Infinity;
  private lastPlay = -Infinity;

  // `target`, `playTarget`: ms that a picture may take while the camera moves, and while models alone do; `rest`: ms after
  // which it rests.
  constructor(
    private readonly target = 40,
    playTarget = 100,
    private readonly rest = 300,
  ) {
    this.moving = new Measured(paceOf(target));
    this.playing = new Measured(paceOf(playTarget));
  }

  // Of the camera's motion. None: its own.
  set pace(pace: Pace | undefined) {
    this.moving = new Measured(pace ?? paceOf(this.target));
  }

  moved(now: number): void {
    this.lastMove = now;
  }

  // A model moves by itself.
  played(now: number): void {
    this.lastPlay = now;
  }

  motion(now: number): Motion {
    if (now - this.lastMove <= this.rest) return 'move';
    return now - this.lastPlay <= this.rest ? 'play' : 'rest';
  }

  // When all rests.
  get whole(): number {
    return this.fixed ?? 1;
  }

  scale(now: number): number {
    const motion = this.motion(now);
    return this.fixed ?? (motion === 'rest' ? 1 : this.of(motion).scale);
  }

  // What a picture took that was drawn in that motion.
  took(milliseconds: number, motion: Motion): void {
    if (motion !== 'rest') this.of(motion).took(milliseconds);
  }

  private of(motion: 'move' | 'play'): Measured {
    return motion === 'move' ? this.moving : this.playing;
  }
}

function paceOf(target: number): Pace {
  return { target, patience: kPatience, share: 1 };
}

class Measured {
  private step: number;
  private measured = 0; // ms of a picture, at the step's resolution
  private wait: number; // pictures, of patience
  private inTime = 0; // pictures, since the last step
  private unmeasured = 0;
  private tried = false; // the step was

  constructor(private readonly pace: Pace) {
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
    if (++this.inTime > this.wait) this.tried = false; // it has stood the trial
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
