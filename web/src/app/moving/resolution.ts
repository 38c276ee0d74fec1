// How many pixels of the scene to draw: as many as the machine can while the camera moves; all of them when it rests, and
// while only models move as many as still make a picture of a scene at rest with something moving in it.

const kSteps = [0.25, 0.375, 0.5, 0.75, 1]; // few, as targets are made anew for each

export type Pace = 'move' | 'play' | 'rest';

export class Resolution {
  // A share that somebody has chosen, whether the camera moves or not.
  fixed?: number;
  private readonly moving: Measured;
  private readonly playing: Measured;
  private lastMove = -Infinity;
  private lastPlay = -Infinity;

  // `target`, `playTarget`: ms that a picture may take while the camera moves, and while models alone do; `rest`: ms after
  // which it rests.
  constructor(target = 40, playTarget = 100, private readonly rest = 300) {
    this.moving = new Measured(target);
    this.playing = new Measured(playTarget);
  }

  moved(now: number): void {
    this.lastMove = now;
  }

  // A model moves by itself.
  played(now: number): void {
    this.lastPlay = now;
  }

  pace(now: number): Pace {
    if (now - this.lastMove <= this.rest) return 'move';
    return now - this.lastPlay <= this.rest ? 'play' : 'rest';
  }

  // When all rests.
  get whole(): number {
    return this.fixed ?? 1;
  }

  scale(now: number): number {
    const pace = this.pace(now);
    return this.fixed ?? (pace === 'rest' ? 1 : this.of(pace).scale);
  }

  // What a picture took that was drawn at that pace.
  took(milliseconds: number, pace: Pace): void {
    if (pace !== 'rest') this.of(pace).took(milliseconds);
  }

  private of(pace: 'move' | 'play'): Measured {
    return pace === 'move' ? this.moving : this.playing;
  }
}

class Measured {
  private step = kSteps.length - 1;
  private measured = 0; // ms of a picture, at the step's resolution

  constructor(private readonly target: number) {}

  get scale(): number {
    return kSteps[this.step];
  }

  took(milliseconds: number): void {
    this.measured = this.measured === 0 ? milliseconds : 0.6 * this.measured + 0.4 * milliseconds;
    const expected = (step: number) => this.measured * (kSteps[step] / kSteps[this.step]) ** 2;
    if (this.measured > this.target && this.step > 0) {
      this.change(this.step - 1);
    } else if (this.step + 1 < kSteps.length && expected(this.step + 1) < 0.7 * this.target) {
      this.change(this.step + 1);
    }
  }

  private change(step: number): void {
    this.measured *= (kSteps[step] / kSteps[this.step]) ** 2;
    this.step = step;
  }
}
