// How many pixels of the scene to draw: as many as the machine can while the camera moves, all of them when it rests.

const kSteps = [0.25, 0.375, 0.5, 0.75, 1]; // few, as targets are made anew for each

export interface Pace {
  target: number; // ms that a picture may take while the camera moves
  // Pictures in time after which more pixels are tried, though nobody knows what they take: where none comes sooner than a
  // screen shows it. Longer each time that they took too long.
  patience: number;
  share: number; // of the pixels, to begin with
}

const kPatience = 120; // pictures
const kLongestWait = 16; // times the patience
const kUnmeasured = 3; // pictures after more pixels are tried: of targets that are made anew

export class Resolution {
  // A share that somebody has chosen, whether the camera moves or not.
  fixed?: number;
  private step = kSteps.length - 1;
  private lastMove = -Infinity;
  private measured = 0; // ms of a picture, at the step's resolution
  private wait: number; // pictures, of patience
  private inTime = 0; // pictures, since the last step
  private unmeasured = 0;
  private tried = false; // the step was
  private current: Pace;

  // `target` as of a pace; `rest`: ms after which the camera rests.
  constructor(
    private readonly target = 40,
    private readonly rest = 300,
  ) {
    this.current = this.ownPace;
    this.wait = this.current.patience;
  }

  // None: its own.
  set pace(pace: Pace | undefined) {
    this.current = pace ?? this.ownPace;
    this.wait = this.current.patience;
    this.measured = this.inTime = this.unmeasured = 0;
    this.step = Math.max(0, kSteps.filter((share) => share <= this.current.share).length - 1);
  }

  private get ownPace(): Pace {
    return { target: this.target, patience: kPatience, share: 1 };
  }

  moved(now: number): void {
    this.lastMove = now;
  }

  isResting(now: number): boolean {
    return now - this.lastMove > this.rest;
  }

  // When the camera rests.
  get whole(): number {
    return this.fixed ?? 1;
  }

  scale(now: number): number {
    return this.fixed ?? (this.isResting(now) ? 1 : kSteps[this.step]);
  }

  // What a picture drawn while the camera moved took.
  took(milliseconds: number): void {
    if (this.unmeasured > 0) {
      --this.unmeasured;
      return;
    }
    const { target, patience } = this.current;
    this.measured = this.measured === 0 ? milliseconds : 0.6 * this.measured + 0.4 * milliseconds;
    const expected = (step: number) => this.measured * (kSteps[step] / kSteps[this.step]) ** 2;
    ++this.inTime;
    if (this.measured > target && this.step > 0) {
      this.change(this.step - 1);
      if (this.tried) this.wait = Math.min(2 * this.wait, kLongestWait * patience);
      this.tried = false;
    } else if (this.step + 1 < kSteps.length) {
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
