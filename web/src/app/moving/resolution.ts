// How many pixels of the scene to draw: as many as the machine can while the camera moves, all of them when it rests.

const kSteps = [0.25, 0.375, 0.5, 0.75, 1]; // few, as targets are made anew for each

export class Resolution {
  // A share that somebody has chosen, whether the camera moves or not.
  fixed?: number;
  private step = kSteps.length - 1;
  private lastMove = -Infinity;
  private measured = 0; // ms of a picture, at the step's resolution

  // `target`: ms that a picture may take while the camera moves; `rest`: ms after which it rests.
  constructor(
    private readonly target = 40,
    private readonly rest = 300,
  ) {}

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
